"""All joints from rest to rest by time laws: together on one law, each on its own, or one after another."""

from collections.abc import Callable
from functools import cached_property
from typing import Literal

import numpy as np

from optiplan.arrays import Array, distinct
from optiplan.records import dataclass
from optiplan.robot.robot import Limits
from optiplan.trajectory import polynomial
from optiplan.trajectory.profiles.laws import Bounds, Law, LawPieces
from optiplan.trajectory.timing.s_curve import with_digits
from optiplan.trajectory.tolerances import SAME_TIME, SHORTEST_DURATION
from optiplan.trajectory.trajectory import Trajectory

Synchronisation = Literal["synchronised", "independent", "sequential"]

_LEAST = 1e-9  # rad or m: smaller distances get no larger bounds on s, so that these stay finite


@dataclass(frozen=True, eq=False)
class JointMove:
    """q moves by `step` (n,), rad or m, while s runs from 0 to 1 by `law`, from the time `begin` for `duration`, s.

    `joint` is the one that moves farthest, by `distance`.
    """

    step: Array
    law: Law
    bounds: Bounds
    begin: float
    duration: float

    @property
    def joint(self) -> int:
        """Index of the joint that moves farthest."""
        return int(np.argmax(np.abs(self.step)))

    @property
    def distance(self) -> float:
        """Distance of that joint, rad or m, positive."""
        return float(np.abs(self.step[self.joint]))


@dataclass(frozen=True, eq=False)
class RestToRest:
    """Motion from `start` to `goal`, both (n,) in rad or m, for any duration.

    Synchronised: all joints share one law, q(t) = start + (goal - start) s(t), a straight line. Independent: all start
    together, each as fast as it can; in a given duration, each takes all of it. Sequential: one joint after another,
    base to tip; they share a given duration in proportion to their shortest times, or to their distances.

    Attributes:
        law: gives the law of a joint from the distance that it moves (> 0); synchronised, from the largest distance.
        stretchable: whether the motion is still of its kind when it is slowed down as a whole.
    """

    start: Array
    goal: Array
    limits: Limits
    joint_names: tuple[str, ...]
    law: Callable[[float], Law]
    synchronisation: Synchronisation = "synchronised"
    share_by_distance: bool = False
    stretchable: bool = True

    @cached_property
    def shortest(self) -> float:
        """Shortest duration within velocity, acceleration and jerk limits, or nearest to meeting them, s."""
        times = np.array([part.duration for part in self._fastest])
        if self.synchronisation != "sequential":
            return max(SHORTEST_DURATION, float(times.max(initial=0.0)))
        share = self._weights / self._weights.sum()
        return max(SHORTEST_DURATION, float((times / share).max(initial=0.0)))

    def parts(self, duration: float | None = None) -> list[JointMove]:
        """Return which joints move when, in that duration (s) or the shortest."""
        fastest = self._fastest
        times = np.array([part.duration for part in fastest])
        begin = np.zeros(len(times))
        if self.synchronisation == "sequential":
            times = (self.shortest if duration is None else duration) * self._weights / self._weights.sum()
            begin[1:] = np.cumsum(times)[:-1]
        elif duration is not None:
            times = np.full(len(fastest), duration)
        return [
            JointMove(part.step, part.law, part.bounds, float(b), float(T))
            for part, b, T in zip(fastest, begin, times, strict=True)
        ]

    def trajectory(self, duration: float | None = None) -> Trajectory:
        """The motion, in that duration (s) or as fast as can be."""
        parts = self.parts(duration)
        T = max((part.begin + part.duration for part in parts), default=duration or SHORTEST_DURATION)
        curves = [_within(part.law.pieces(part.duration, part.bounds), part.begin, T) for part in parts]
        edges = distinct(np.concatenate([[0.0, T], *(curve.breakpoints for curve in curves)]))
        edges = edges[np.concatenate([[True], np.diff(edges) > SAME_TIME * T])]
        edges[-1] = T
        size = max((curve.coefficients.shape[1] for curve in curves), default=1)
        q = np.zeros((len(edges) - 1, size, len(self.start)))
        q[:, 0] = self.start
        for part, curve in zip(parts, curves, strict=True):
            q[:, : curve.coefficients.shape[1]] += _on(edges, curve)[:, :, None] * part.step
        return Trajectory(self.joint_names, edges, q)

    @property
    def _weights(self) -> Array:
        """In what proportion sequential parts share the time."""
        return np.array([part.distance if self.share_by_distance else part.duration for part in self._fastest])

    @cached_property
    def _fastest(self) -> list[JointMove]:
        """The parts as if each had the robot to itself, in its shortest time."""
        d = self.goal - self.start
        if not d.any():
            return []
        each = [np.where(np.arange(len(d)) == j, d, 0.0) for j in np.flatnonzero(d)]
        found = []
        for step in [d] if self.synchronisation == "synchronised" else each:
            bounds, law = _bounds(step, self.limits), self.law(float(np.abs(step).max()))
            floor = SHORTEST_DURATION / (len(each) if self.synchronisation == "sequential" else 1)
            found.append(JointMove(step, law, bounds, 0.0, max(law.shortest(bounds), floor)))
        return found


def _bounds(step: Array, limits: Limits) -> Bounds:
    """Bounds on s of a part that moves by `step` (n,): the least of limit_j / |step_j|.

    Accelerations and jerks are those of `with_digits`.
    """
    moving = step != 0.0
    size = np.maximum(np.abs(step[moving]), _LEAST)
    rates = limits.rates
    v, a, j = (float((limit[moving] / size).min()) for limit in rates)
    return Bounds(v, *with_digits(1.0, v, a, j))


def _within(curve: LawPieces, begin: float, T: float) -> LawPieces:
    """The curve from `begin` on, 0 before it and 1 after it, over [0, T]."""
    breakpoints, coefficients = curve.breakpoints + begin, curve.coefficients
    still = np.zeros((1, coefficients.shape[1]))
    if breakpoints[0] > SAME_TIME * T:
        breakpoints, coefficients = np.append(0.0, breakpoints), np.vstack([still, coefficients])
    if breakpoints[-1] < T * (1.0 - SAME_TIME):
        still = np.eye(1, coefficients.shape[1])
        breakpoints, coefficients = np.append(breakpoints, T), np.vstack([coefficients, still])
    return LawPieces(breakpoints, coefficients)


def _on(edges: Array, curve: LawPieces) -> Array:
    """Return coefficients (m, degree + 1) of the curve on the m pieces between `edges`, with its breakpoints."""
    piece = np.searchsorted(curve.breakpoints[1:-1], 0.5 * (edges[1:] + edges[:-1]), side="right")
    moved: Array = polynomial.shifted(curve.coefficients[piece][:, :, None], edges[:-1] - curve.breakpoints[piece])
    return moved[:, :, 0]
