"""`parabolic`: constant velocities from point to point, changed at constant rates around the vias (blends)."""

from collections.abc import Iterator
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from optiplan.arrays import Array, Index
from optiplan.errors import InputError, Issue
from optiplan.planners.option_schema import OptionError, option
from optiplan.planners.point_to_point.base import SIZE, MotionOptions
from optiplan.planners.vias.via_chains import ThroughVias, chain_tolerances, distinct, via_times
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.robot.robot import Limits
from optiplan.trajectory.paths.parabolic_blends import (
    Blends,
    blends_by_acceleration,
    blends_by_time,
    run_blends,
    with_pseudo_vias,
)
from optiplan.trajectory.paths.via_splines import knot_times
from optiplan.trajectory.timing.stops import stop_at_corners
from optiplan.trajectory.timing.time_scaling import FreeTimes, least_stretch
from optiplan.trajectory.trajectory import Trajectory

_SHARES = (0.05, 0.12, 0.25, 0.4)  # of a segment's time: where pseudo-via points are tried


@dataclass(frozen=True)
class ParabolicOptions(MotionOptions):
    """Also at most one of two, of the blends of every joint; without either, each takes all of its acceleration limit.

    The acceleration jumps, so that only a problem with `limits: {jerk: none}` can have the motion verified.
    """

    acceleration: float | None = option(None, "rad/s² or m/s².", **SIZE)
    blend_time: float | None = option(None, "s.", **SIZE)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.acceleration is not None and self.blend_time is not None:
            raise OptionError("acceleration", "acceleration and blend_time together", "only one of them")


class Parabolic(ThroughVias[ParabolicOptions]):
    """Planner of parabolic blends. A via is missed by what its blend cuts off, or hit between two pseudo-via points."""

    Options = ParabolicOptions

    def profile(self, problem: Problem, goal: Array) -> "ParabolicMotion":
        """The motion along a chain (vias + 2, n).

        Raises:
            InputError: the duration ends before the last via's time.
        """
        tolerances = chain_tolerances(problem)
        times = via_times(problem, "parabolic", self.options.duration)
        kept = distinct(goal, times)
        names = problem.robot.joint_names
        return ParabolicMotion(goal[kept], tolerances[kept], times, self.options, problem.limits, names)


class Refinement(NamedTuple):
    """A step on the way to a motion that misses no via by more than its tolerance.

    Attributes:
        points: (m, n) points with the pseudo-via points so far, rad or m.
        hit: (k,) which of the k points given are hit between two pseudo-via points.
        blends: of `points`.
        late: (k,) which points are missed by more than their tolerance, and are hit in the next step.
    """

    points: Array
    hit: npt.NDArray[np.bool_]
    blends: Blends
    late: npt.NDArray[np.bool_]


def places_of_vias(hit: npt.NDArray[np.bool_]) -> Index:
    """Return the numbers (k,) of the points given in those of a step: two pseudo-via points are about each hit."""
    return np.asarray(np.arange(len(hit)) + 2 * np.cumsum(hit) - hit)


@dataclass(frozen=True, eq=False)
class ParabolicMotion:
    """The motion along points (k, n), which may be missed by tolerances (k,), at times (k - 2,) if any."""

    points: Array
    tolerances: Array
    times: Array
    options: ParabolicOptions
    limits: Limits
    joint_names: tuple[str, ...]

    @property
    def stretchable(self) -> bool:
        """Whether times, accelerations and durations of blends are free."""
        return self.options.acceleration is None and self.options.blend_time is None and not len(self.times)

    @property
    def shortest(self) -> float:
        """See `Profile`."""
        return self._shortest.duration

    def trajectory(self, duration: float | None = None) -> Trajectory:
        """See `Profile`.

        Raises:
            InputError: blends overlap, in that duration or at the times given.
        """
        if duration is None:
            return self._shortest
        if len(self.points) == 1:
            return self._shortest.scaled(duration)
        return self._chosen(self._times.factor(duration))

    @cached_property
    def _shortest(self) -> Trajectory:
        if len(self.points) == 1:
            return stop_at_corners(self.points[[0, 0]], self.limits, self.joint_names)
        return self._chosen(self._factor)

    @cached_property
    def _factor(self) -> float:
        """By how much the free times of the shortest motion are stretched."""
        factors = [least_stretch(partial(self._good, share)) for share in _SHARES]
        return min((factor for factor in factors if factor is not None), default=1.0)

    def refinements(self) -> list[Refinement]:
        """Return the steps to the motion in the option's duration: blends alone, then more and more pseudo-via points.

        Raises:
            InputError: blends overlap at the times given.
        """
        duration = self.options.duration
        factor = self._factor if duration is None else self._times.factor(duration)
        return list(self._refined(factor, self._share(factor)))

    def _good(self, share: float, factor: float) -> bool:
        return self._blends(factor, share).keeps(self.limits.velocity, self.limits.acceleration)

    def _chosen(self, factor: float) -> Trajectory:
        return run_blends(self.points[0], self._blends(factor, self._share(factor)), self.joint_names)

    def _share(self, factor: float) -> float:
        """The first share whose motion is within limits, else the first whose blends do not overlap."""
        fitting: list[tuple[float, Blends]] = []
        issues: list[Issue] = []
        for share in _SHARES:
            blends = self._blends(factor, share)
            overlap = blends.overlap()
            if overlap is None:
                fitting.append((share, blends))
            else:
                issues.append(self._issue(blends.times, *overlap))
        if not fitting:
            raise InputError(issues[-1:])
        velocity, acceleration = self.limits.velocity, self.limits.acceleration
        return next((share for share, blends in fitting if blends.keeps(velocity, acceleration)), fitting[0][0])

    @cached_property
    def _times(self) -> FreeTimes:
        return FreeTimes.of(self.times, knot_times(self.points, self.limits))

    def _blends(self, factor: float, share: float) -> Blends:
        """Blends whose free times are stretched by the factor, with the pseudo-via points that it takes."""
        *_, last = self._refined(factor, share)
        return last.blends

    def _refined(self, factor: float, share: float) -> Iterator[Refinement]:
        times = self._times.at(factor)
        hit = np.zeros(len(times), dtype=bool)
        while True:  # a pseudo-via point changes the velocities, and so the misses, beside it
            points, all_times = with_pseudo_vias(self.points, times, hit, share)
            blends = self._make(points, all_times)
            miss = blends.miss.max(axis=1)[places_of_vias(hit)]
            late = (miss > self.tolerances) & ~hit
            yield Refinement(points, hit, blends, late)
            if not late.any():
                return
            hit = hit | late

    def _make(self, points: Array, times: Array) -> Blends:
        o = self.options
        if o.blend_time is not None:
            return blends_by_time(points, times, o.blend_time)
        acceleration = self.limits.acceleration if o.acceleration is None else np.full(points.shape[1], o.acceleration)
        return blends_by_acceleration(points, times, acceleration)

    def _issue(self, times: Array, i: int, j: int, lack: float) -> Issue:
        where = f"'{self.joint_names[j]}' between {times[i]:.4g} and {times[i + 1]:.4g} s"
        words = f"blends that overlap by {lack:.3g} s" if np.isfinite(lack) else "no blend strong enough"
        o = self.options
        name, value = ("acceleration", o.acceleration) if o.blend_time is None else ("blend_time", o.blend_time)
        return Issue.of_option(
            "parabolic",
            name,
            f"{'the limits' if value is None else value}: {words}, of {where}",
            "a shorter blend time, more acceleration, or more time",
        )
