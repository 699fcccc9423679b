"""The runs of a figure: named, told apart by colour, with what is drawn of each."""

from collections.abc import Sequence
from functools import cached_property

from optiplan.config.messages import some
from optiplan.errors import InputError, Issue
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory
from optiplan.viewer.plots.curves import MotionCurves, motion_curves


@dataclass(frozen=True, eq=False)
class PlottedRun:
    """One run of a figure.

    Attributes:
        label: its name in the legend.
        problem: whose limits are drawn.
        trajectory: the motion.
        verified: whether the verifier accepts it; else the legend says so.
    """

    label: str
    problem: Problem
    trajectory: Trajectory
    verified: bool

    @cached_property
    def curves(self) -> MotionCurves:
        """What it does, along the motion."""
        return motion_curves(self.problem, self.trajectory)

    @property
    def legend(self) -> str:
        """Label and duration."""
        return f"{self.label}, {self.trajectory.duration:.3f} s{'' if self.verified else ', not verified'}"


def comparable(runs: Sequence[PlottedRun], file: str = "plot") -> tuple[PlottedRun, ...]:
    """The runs, if one figure can hold them.

    Raises:
        InputError: there are none, or they move other joints than the first.
    """
    if not runs:
        raise InputError([Issue(file, None, "runs", "no run with a motion", "at least one that has a trajectory")])
    names = runs[0].problem.robot.joint_names
    expected = f"the joints of '{runs[0].label}', {some(names, 3)}"
    issues = [
        Issue(file, None, "runs", f"'{run.label}' moves {some(found, 3)}", expected)
        for run in runs
        for found in (run.problem.robot.joint_names, run.trajectory.joint_names)
        if found != names
    ]
    if issues:
        raise InputError(issues)
    return tuple(runs)
