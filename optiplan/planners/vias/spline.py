"""`spline`: cubic or quintic polynomials from point to point through all vias, which are hit without stopping."""

from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt

from optiplan.arrays import Array
from optiplan.errors import InputError, Issue
from optiplan.planners.common.limit_violations import excess
from optiplan.planners.option_schema import option
from optiplan.planners.point_to_point.base import MotionOptions, Profile
from optiplan.planners.vias.via_chains import ThroughVias, distinct, via_times
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.robot.robot import Limits
from optiplan.trajectory.paths.via_splines import (
    Degree,
    evened_times,
    heuristic_velocities,
    knot_times,
    smooth_spline,
    spline_of_velocities,
)
from optiplan.trajectory.timing.stops import stop_at_corners
from optiplan.trajectory.timing.time_scaling import FreeTimes, least_stretch, scale_to_limits
from optiplan.trajectory.trajectory import Trajectory

Velocities = Literal["given", "heuristic", "continuous"]


@dataclass(frozen=True)
class SplineOptions(MotionOptions):
    """Also which polynomials."""

    degree: Degree = option(
        5,
        "of the polynomials between two points; with 3 and other than continuous velocities, the acceleration jumps "
        "at vias.",
    )
    velocities: Velocities = option(
        "continuous",
        "at vias: `given` by the problem; by the `heuristic` (zero where a joint turns round, else the mean of the "
        "slopes before and after); or such that derivatives are `continuous`: acceleration, and with degree 5 jerk "
        "and snap.",
    )


class Spline(ThroughVias[SplineOptions]):
    """Planner of splines through vias. Given times at vias are kept; else they are chosen from the limits."""

    Options = SplineOptions

    def profile(self, problem: Problem, goal: Array) -> Profile:
        """The spline through a chain (vias + 2, n).

        Raises:
            InputError: velocities are to be given and are not, or the duration ends before the last via's time.
        """
        times = via_times(problem, "spline", self.options.duration)
        kept = distinct(goal, times)
        given = _given(problem, kept) if self.options.velocities == "given" else None
        return SplineMotion(goal[kept], times, given, self.options, problem.limits, problem.robot.joint_names)


@dataclass(frozen=True, eq=False)
class SplineMotion:
    """The motion through points (k, n), at times (k - 2,) if any, with velocities (k, n) if given."""

    points: Array
    times: Array
    velocities: Array | None
    options: SplineOptions
    limits: Limits
    joint_names: tuple[str, ...]

    @property
    def stretchable(self) -> bool:
        """Whether times and velocities are free."""
        return self.velocities is None and not len(self.times)

    @property
    def shortest(self) -> float:
        """See `Profile`."""
        return self._shortest.duration

    def trajectory(self, duration: float | None = None) -> Trajectory:
        """See `Profile`."""
        if duration is None:
            return self._shortest
        if self.stretchable or len(self.points) == 1:
            return self._shortest.scaled(duration)
        return self._at(self._times.factor(duration))

    @cached_property
    def _shortest(self) -> Trajectory:
        if len(self.points) == 1:
            return stop_at_corners(self.points[[0, 0]], self.limits, self.joint_names)
        if self.stretchable:
            return scale_to_limits(self._at(1.0), self.limits)
        factor = least_stretch(lambda factor: excess(self._at(factor), self.limits) is None)
        return self._at(1.0 if factor is None else factor)

    @cached_property
    def _times(self) -> FreeTimes:
        base = knot_times(self.points, self.limits)
        if self.stretchable and self.options.velocities == "continuous":
            base = evened_times(self.points, base, self.limits, self.options.degree)
        return FreeTimes.of(self.times, base)

    def _at(self, factor: float) -> Trajectory:
        """The spline whose free times are stretched by the factor."""
        times = self._times.at(factor)
        degree, names, velocities = self.options.degree, self.joint_names, self.velocities
        if self.options.velocities == "continuous":
            return smooth_spline(self.points, times, degree, names, bool(np.isfinite(self.limits.jerk).any()))
        if velocities is None:
            velocities = heuristic_velocities(self.points, times)
        return spline_of_velocities(self.points, times, velocities, degree, names)


def _given(problem: Problem, kept: npt.NDArray[np.bool_]) -> Array:
    """Velocities of the problem's vias at the points kept, of vias + 2; zero at the ends, also where a via is one.

    Raises:
        InputError: a via has none.
    """
    rows = [np.zeros(problem.robot.n)]
    for k, via in enumerate(problem.vias):
        if via.velocity is None:
            expected = "a velocity at each via of the problem, or velocities: heuristic | continuous"
            raise InputError([Issue.of_option("spline", "velocities", f"'given', but via {k + 1} has none", expected)])
        rows.append(via.velocity)
    velocities = np.array([*rows, np.zeros(problem.robot.n)])[kept]
    velocities[-1] = 0.0
    return velocities
