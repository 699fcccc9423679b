"""The path of a verified run, from which stretch to which it may be run forwards and backwards, and its laws."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from optiplan.errors import wrong_argument
from optiplan.execution.path_laws import Load, PathLaws, reversed_motion
from optiplan.problem.constraints.expression import Expression
from optiplan.problem.constraints.motions import ToolAcceleration
from optiplan.problem.problem import Problem
from optiplan.problem.task.timeline import scene_parts
from optiplan.runs.run import Run
from optiplan.trajectory.joining import cut_trajectory
from optiplan.trajectory.segments import EVENTS, Segment
from optiplan.trajectory.trajectory import Trajectory

TIMED_CONSTRAINTS = (ToolAcceleration, Expression)
"""Path constraints that a slower run of the same path may violate."""


@dataclass(frozen=True, eq=False)
class PathStretch:
    """A part of the path, run in one direction from `start`: place s of its laws is `start` + s, backwards - s.

    Attributes:
        laws: along it.
        start: on the path, s.
        direction: 1.0 or -1.0.
    """

    laws: PathLaws
    start: float
    direction: float

    def place(self, s: float) -> float:
        """Return the place on the whole path."""
        return self.start + self.direction * s


class ProvedPath:
    """The motion of a verified run as a path, whose parameter is the motion's time, s.

    Attributes:
        run: the run.
        events: what is done on the way, in order.
        parts: stretches of the path in which the scene stays the same, in order.
        forwards: the whole path.

    Raises:
        InputError: the run is not verified, obstacles move by the clock, a path constraint depends on accelerations, or
            the robot cannot stand still everywhere.
    """

    def __init__(self, run: Run, called: str) -> None:
        if run.trajectory is None or not run.verified:
            raise wrong_argument(called, "run", "a run that is not verified", "a verified run of op.plan(…)")
        problem = run.problem
        if any(obstacle.motion is not None for obstacle in problem.scene.obstacles):
            found = "a run among obstacles that move by the clock, proved for its own timing alone"
            raise wrong_argument(called, "run", found, "a run among obstacles that stand still")
        for constraint in _constraints(problem):
            if isinstance(constraint, TIMED_CONSTRAINTS):
                found = f"a run with the path constraint `{constraint.KEY}`, which depends on accelerations"
                raise wrong_argument(called, "run", found, "path constraints of poses, positions and speeds")
        self.run = run
        self.parts = scene_parts(problem, self.motion)
        self._loads = [Load(part.begin, part.end, part.problem.robot) for part in self.parts]
        self.events: tuple[Segment, ...] = tuple(one for one in self.motion.segments if one.kind in EVENTS)
        self.forwards = PathStretch(PathLaws(self.motion, problem.limits, self._loads), 0.0, 1.0)
        stops = sorted({0.0, self.motion.duration, *(event.begin for event in self.events)})
        self._ways_back = [self._way_back(begin, end) for begin, end in pairwise(stops)]
        overloaded = self.forwards.laws.overloaded
        if overloaded is not None:
            found = f"a run in which gravity alone takes more torque than allowed at {overloaded:.3f} s"
            raise wrong_argument(called, "run", found, "a motion along which the robot can stand still anywhere")

    @property
    def motion(self) -> Trajectory:
        """The verified motion."""
        assert self.run.trajectory is not None
        return self.run.trajectory

    def backwards(self, place: float) -> PathStretch | None:
        """Return the way back from a place to the last event before it, or to the start; None where there is none.

        An event is not undone: what was taken stays taken.
        """
        if not place > 0.0:
            return None
        k = int(np.searchsorted([stretch.start for stretch in self._ways_back], place))
        return self._ways_back[min(k, len(self._ways_back) - 1)]

    def _way_back(self, begin: float, end: float) -> PathStretch:
        """Return the stretch from `end` back to `begin`."""
        part = reversed_motion(cut_trajectory(self.motion, begin, end))
        loads = [
            Load(end - min(load.end, end), end - max(load.begin, begin), load.robot)
            for load in reversed(self._loads)
            if load.end > begin and load.begin < end
        ]
        return PathStretch(PathLaws(part, self.run.problem.limits, loads), end, -1.0)

    @property
    def starts_at_rest(self) -> bool:
        """Whether the motion begins without velocity and acceleration."""
        return not (self.motion(np.zeros(1), 1).any() or self.motion(np.zeros(1), 2).any())


def _constraints(problem: Problem) -> list[object]:
    """Return the path constraints of a problem and of the steps of its task."""
    found: list[object] = list(problem.path_constraints)
    for step in problem.task:
        found += step.constraints
    return found
