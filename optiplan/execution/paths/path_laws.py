"""Time laws s(t) along a proved motion p(s), kept within the limits of joints by the native core.

With speed s' in [0, 1] of a law, the robot moves with

    q' = p' s',    q'' = p'' s'^2 + p' s'',    q''' = p''' s'^3 + 3 p'' s' s'' + p' s''',
    tau = M p' s'' + (M p'' + c(p, p')) s'^2 + g(p)

(Verscheure et al. 2009, Time-optimal path tracking for robots). A law is a chain of cubic polynomials. Each keeps the
limits of acceleration and jerk at all times by interval arithmetic on the ranges of p', p'' and p''' in short cells of
the path, and the torque limits by values and a bound on |tau''|.
"""

from collections.abc import Sequence
from copy import copy
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.errors import OptiPlanError, whole_argument
from optiplan.execution.status import Stopping
from optiplan.records import dataclass
from optiplan.robot.native_tree import native_tree
from optiplan.robot.robot import Limits, Robot
from optiplan.trajectory import polynomial
from optiplan.trajectory.joining import cut_trajectory
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.torque import bounds_of
from optiplan.verify.report import VerifyPolicy

if TYPE_CHECKING:
    from optiplan._core._core_base import PathLaws as CoreLaws
    from optiplan._core._core_base import TimeLaw

SHORTEST_STEP, LONGEST_STEP, JOINT_STEPS = 1e-3, 2e-3, 5500
"""s: pieces of a law, and cells of the path; as many as this over all joints where the bounds allow it.

With 1 ms stops of short motions are some per cent shorter than with 2 ms, and searched twice as long.
"""

MOST_CELLS = 20_000
"""Cells of a path at most: those of long motions are wider than a step."""

LOOK = 4
"""Steps in whose intervals the way from each piece to a steady speed is checked."""

MOST_RATE, MOST_JERK = 50.0, 5e3
"""|s''|, 1/s, and |s'''|, 1/s²: bounds of a law where the path stands still, and no joint bounds it."""

PROBES = np.array([[0.0, 0.0], [10.0, 0.0], [20.0, 0.0], [0.0, 1000.0]])
"""|s''|, 1/s, and |s'''|, 1/s², at which torques' curvature is bounded: its factors follow from four values."""

ROUNDED = 1e-9
"""Share of torques' curvature by which the differences of bounds may be rounded."""

RESERVES = (0.0, 0.02, 0.1)
"""Shares of the torque limits that searches leave to the proof, tried in this order."""


def rests(law: "TimeLaw", time: float) -> bool:
    """Return whether a law has come to rest by a time, s, and stays there."""
    return law.target == 0.0 and law.settled <= time


def resting_place(law: "TimeLaw", now: float) -> float:
    """Return the place, s of the path, in which a law that goes on from `now` comes to rest; inf where it does not."""
    return law.at(max(law.settled, now))[0] if law.target == 0.0 else np.inf


class PathPlace(NamedTuple):
    """Place on a path, speed and acceleration of the law there: s, s' and s''."""

    s: float
    speed: float
    acceleration: float


@dataclass(frozen=True, eq=False)
class SetPoint:
    """What a robot is to do at one time.

    Attributes:
        q, v, a: (n,), rad or m and s.
        torque: (n,), feed-forward of the rigid bodies, N·m or N.
        place: on the path.
    """

    q: Array
    v: Array
    a: Array
    torque: Array
    place: PathPlace


@dataclass(frozen=True, eq=False)
class Load:
    """The robot as it is loaded on a stretch of a motion, from `begin` to `end`, s."""

    begin: float
    end: float
    robot: Robot


class PathLaws:
    """Laws along a motion, forwards, or from its end back to a place at which the robot rests.

    Args:
        motion: verified with these limits and loads.
        limits: of the joints.
        loads: of all its stretches, in order.
        tolerance: share by which the motion's report lets these limits be passed.
        starts_at_rest: whether the motion does, so that a law may begin there with any speed.

    Attributes:
        length: s of a law at the end of its path.

    Raises:
        OptiPlanError: the native core is not built.
    """

    def __init__(
        self,
        motion: Trajectory,
        limits: Limits,
        loads: Sequence[Load],
        tolerance: float = VerifyPolicy.limit_tolerance,
        starts_at_rest: bool = False,
    ) -> None:
        if core is None:
            raise OptiPlanError("execution needs the native core of optiplan, which is not built: make core")
        self._forwards, self.length = motion, motion.duration
        self._back, self._rests, self._starts_at_rest = False, True, starts_at_rest
        step = float(np.clip(motion.duration * motion.n / JOINT_STEPS, SHORTEST_STEP, LONGEST_STEP))
        share = 1.0 + tolerance
        # no more than the motion itself takes: another one may have to begin, within the limits, where a law leads
        most = np.clip(np.maximum(*np.abs(motion.extrema(2))), limits.acceleration, limits.acceleration * share)
        rates = np.array([most, limits.jerk * share, limits.torque * share])
        self._core: CoreLaws = core.PathLaws.of(
            motion.breakpoints,
            motion.coefficients,
            rates,
            np.array([load.end for load in loads]),
            [native_tree(load.robot.model) for load in loads],
            max(step, motion.duration / MOST_CELLS),
            np.array([step, LOOK * step, MOST_RATE, MOST_JERK]),
        )
        if np.isfinite(rates[2]).any():
            self._core.set_curvature(_curvature(self._core.sizes(), motion.duration, loads))

    @property
    def motion(self) -> Trajectory:
        """The path, in the direction of the laws, up to where they end."""
        T = self._forwards.duration
        if self._back:
            return reversed_motion(cut_trajectory(self._forwards, T - self.length, T))
        return self._forwards if self.length == T else cut_trajectory(self._forwards, 0.0, self.length)

    @property
    def overloaded(self) -> float | None:
        """The first s at which gravity alone takes more torque than allowed; None where it nowhere does."""
        found = self._core.overloaded
        return None if found < 0.0 else found

    def mirrored(self, rests: bool = True) -> "PathLaws":
        """Return the laws from the end of the motion to its start, without computing anything again.

        Where the motion does not begin at rest (`rests`), only those are laws that stop before, and `rest_to_rest`.
        """
        back = copy(self)
        back._core, back._back, back._rests, back._starts_at_rest = self._core.mirrored(), True, rests, rests
        return back

    def until(self, length: float) -> "PathLaws":
        """Return the same laws along a path that ends at s = `length`, where the robot rests."""
        shorter = copy(self)
        shorter._core, shorter.length = self._core.until(length), length
        return shorter

    def change(self, place: PathPlace, begin: float, target: float) -> "TimeLaw | None":
        """Return the law from a place at time `begin`, s, to a steady speed; None where it cannot begin there.

        Holds at: all times, for acceleration, jerk and torque; velocity is below that of the motion.
        """
        if self._starts_at_rest and place.s == 0.0:
            return self.steady(0.0, target, begin)
        for reserve in RESERVES:
            law = self._core.change(*place, begin, target, reserve)
            if law is not None:
                return self._resting(law)
        return None

    def change_along(self, law: "TimeLaw", now: float, target: float) -> "TimeLaw | None":
        """Return the law that goes on as this one until limits leave room for a change to a steady speed.

        That is at once almost everywhere. None where no change is found until the law itself is steady.

        Holds at: as `change`.
        """
        if self._starts_at_rest and law.at(now)[0] == 0.0:
            return self.steady(0.0, target, now)
        for reserve in RESERVES:
            found = self._core.change_along(law, now, target, reserve)
            if found is not None:
                return self._resting(found)
        return None

    def _resting(self, law: "TimeLaw") -> "TimeLaw | None":
        """Return the law, unless it leads to an end at which the path is in motion."""
        stops = law.target == 0.0 and law.at(law.settled)[0] < self.length
        return law if self._rests or stops else None

    def then_stop(self, law: "TimeLaw", t: float) -> "TimeLaw":
        """Return a law as it is until time t, s, and from there the stop, which begins as soon as limits leave room.

        It is one law until the robot stands still: `SceneWatch.blocked` checks all of it.

        Holds at: all times, where it does for the law.
        """
        if law.at(t)[0] >= self.length:  # at rest there, whatever the law
            return law
        stop = self.change_along(law, t, 0.0)
        return law if stop is None else law.then(stop)

    def rest_to_rest(self, s: float, begin: float) -> "TimeLaw | None":
        """Return the law from rest at s to rest at the end, also where the path is in motion there.

        Holds at: as `change`.
        """
        return self._core.rest_to_rest(s, begin)

    @property
    def keeps_torque(self) -> bool:
        """Whether a motion that was not verified keeps the limits of torque, at all times."""
        return self._core.keeps_torque

    def stopping(self, places: int) -> Stopping:
        """Return the stop along the path from full speed, at equally spaced places of the motion."""
        whole_argument("Executor.stopping", "places", places, 1)
        T = self.motion.duration
        place = np.linspace(0.0, T, places)
        time, travel = np.zeros(places), np.zeros(places)
        for k, s in enumerate(place):
            law = self.change(PathPlace(float(s), 1.0, 0.0), 0.0, 0.0)
            time[k] = T - s if law is None else law.settled
            travel[k] = T - s if law is None else min(law.at(law.settled)[0], T) - s
        return Stopping(place, time, travel)

    def steady(self, s: float, speed: float, begin: float) -> "TimeLaw":
        """Return the law of a steady speed in [0, 1], which every verified motion admits."""
        return core.TimeLaw.steady(s, speed, begin)

    def set_point(self, law: "TimeLaw", t: float) -> SetPoint:
        """Return the set-point of a law at time t, s."""
        values, s, speed, acceleration = self._core.set_point(law, t)
        return SetPoint(values[0], values[1], values[2], values[3], PathPlace(s, speed, acceleration))


def _curvature(sizes: Array, duration: float, loads: Sequence[Load]) -> Array:
    """Factors (cells, 4, n) of s'^2, |s''|, s''^2 and s' |s'''|, whose sum bounds |tau''| in time.

    With |s''| <= c2 and |s'''| <= c3, |q^(k)| for k from 1 to 4 is at most |p'|, |p''| + |p'| c2,
    |p'''| + 3 |p''| c2 + |p'| c3, and |p''''| + 6 |p'''| c2 + 3 |p''| c2² + 4 |p''| c3. The bound that follows from
    these is k0 + k1 c2 + k2 c2² + k3 c3: the terms of inertia are of fourth order in time, those of gravity of second,
    so that k0 has at least the factor s'^2 and k3 the factor s'.

    Args:
        sizes: (5, cells, n) bounds on |p^(k)|, k from 0 to 4, in equal cells of the path.
        duration: of the path, s.
        loads: on it.
    """
    probes, (cells, n) = len(PROBES), sizes.shape[1:]
    edges = duration / cells * np.arange(cells + 1.0)
    c2, c3 = PROBES.T[:, :, None, None]
    q, first, second, third, fourth = (np.broadcast_to(size, (probes, cells, n)) for size in sizes)
    jerk, snap = 3.0 * second * c2 + first * c3, 6.0 * third * c2 + 3.0 * second * c2**2 + 4.0 * second * c3
    rates = np.array([q, first, second + first * c2, third + jerk, fourth + snap])
    found = np.zeros((probes, cells, n))
    for load in loads:
        inside = (edges[1:] >= load.begin) & (edges[:-1] <= load.end)
        bounds = bounds_of(load.robot).over(rates[:, :, inside].reshape(5, -1, n))[1].reshape(probes, -1, n)
        still, slow, fast, jerky = bounds
        slow, fast, jerky = slow - still, fast - still, jerky - still
        factors = np.array([still, 2.0 * slow - 0.5 * fast, 0.5 * fast - slow, jerky])
        factors /= np.array([1.0, PROBES[1, 0], PROBES[1, 0] ** 2, PROBES[3, 1]])[:, None, None]
        found[:, inside] = np.maximum(found[:, inside], factors)
    return np.ascontiguousarray(found.transpose(1, 0, 2)) * (1.0 + ROUNDED)


def reversed_motion(motion: Trajectory) -> Trajectory:
    """Return the same path from its end to its start: p(T - s)."""
    widths = motion.widths[::-1]
    moved = polynomial.shifted(motion.coefficients[::-1], widths)
    moved *= (-1.0) ** np.arange(moved.shape[1])[:, None]
    times = np.concatenate([[0.0], motion.duration - motion.breakpoints[-2::-1]])
    kept = np.diff(times) > 0.0  # rounding may leave nothing of the shortest pieces
    return Trajectory(motion.joint_names, np.append(times[:-1][kept], times[-1]), moved[kept])
