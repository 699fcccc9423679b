"""A line in the program of a stretch: its path is given, and its time law is a spline."""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.planners.task.optimisation.rate_rows import RateRows
from optiplan.planners.trajopt.bspline_basis import FIXED, SplineBasis, moving_breakpoints
from optiplan.planners.trajopt.terms.term import Instants, Mask, SoftRows
from optiplan.planners.trajopt.terms.torques import TorqueTerm
from optiplan.records import dataclass
from optiplan.robot.robot import Limits, Robot
from optiplan.trajectory.trajectory import Trajectory

_SPANS, _BUNCHING = 16, 0.4
"""Spans of the law for each of its lines, and how much they bunch at the ends."""

_SAMPLES, _TORQUES = 5, 3
"""Samples in each of its spans for limits of the joints and for torques; motions are scaled to exact extrema."""


class SpeedLimit(NamedTuple):
    """ds/dt is at most `rate` (N,), 1/s, at places s (N,) of a path, and linear between them: the tool's speed."""

    s: Array
    rate: Array

    def at(self, s: Array) -> tuple[Array, Array]:
        """Return the limit and its slope at places (K,)."""
        part = np.clip(np.searchsorted(self.s, s) - 1, 0, len(self.s) - 2)
        return np.interp(s, self.s, self.rate), (np.diff(self.rate) / np.diff(self.s))[part]


class LinePart:
    """A path q = p(s), s in [0, 1], with the law s = s(w), w in [0, 1] the share of its duration.

    The law is a spline that never decreases, because its control points do not. Its variables are the control points
    (K,) without the fixed ones at its ends: s is 0 and 1 there; at rest, rate and curvature are 0 as well.

    Attributes:
        path: p, over [0, 1].
        terms: of its torques; the path is known to be free.
        basis: of the law.
        free: (K,) which control points are variables.
    """

    def __init__(
        self,
        path: Trajectory,
        robot: Robot,
        limits: Limits,
        rests: tuple[bool, bool],
        slow: SpeedLimit | None = None,
        lines: int = 1,
    ) -> None:
        self.path, self.limits, self.slow = path.scaled(1.0), limits, slow
        self.terms = (TorqueTerm(robot, limits.torque),)
        self.basis = SplineBasis(moving_breakpoints(_SPANS * lines, _BUNCHING, rests))
        self.free: Mask = np.ones(self.basis.size, dtype=bool)
        self.free[: FIXED if rests[0] else 1] = False
        self.free[-(FIXED if rests[1] else 1) :] = False
        edges = self.basis.breakpoints
        self._at = _between(edges, _SAMPLES)
        self._rows = tuple(self.basis.at(self._at, order) for order in range(4))
        self.instants = Instants.of(self.basis, _between(edges, _TORQUES))
        self.terms[0].begin(self.instants)

    @property
    def count(self) -> int:
        """Number of its variables."""
        return int(self.free.sum())

    def control(self, variables: Array) -> Array:
        """Return the control points (K, 1) of the law."""
        found = np.ones((self.basis.size, 1))
        found[:FIXED] = 0.0
        found[self.free, 0] = variables
        return found

    def fitted(self, w: Array, s: Array, ends: Array) -> Array:
        """Return the variables of the law near s (N,) at w (N,), with s, ds/dw and d²s/dw² at both ends, (2, 3)."""
        held = self.basis.ends(ends[0][:, None], ends[1][:, None])
        law = np.clip(np.maximum.accumulate(self.basis.fit(w, s[:, None], held)[:, 0]), 0.0, 1.0)
        return np.asarray(law[self.free])

    def rates(self, control: Array) -> RateRows:
        """Return the derivatives of the joints by w at samples over their limits, and that of s over its own."""
        s, s1, s2, s3 = (rows @ control[:, 0] for rows in self._rows)
        s = np.clip(s, 0.0, 1.0)
        p = [self.path(s, order) for order in range(5)]
        B = self._rows
        by_path = (
            (p[1] * s1[:, None], (_of(p[2], s1, B[0]), _of(p[1], 1.0, B[1]))),
            (
                p[2] * (s1**2)[:, None] + p[1] * s2[:, None],
                (_of(p[3], s1**2, B[0]), _of(p[2], s2, B[0]), _of(p[2], 2.0 * s1, B[1]), _of(p[1], 1.0, B[2])),
            ),
            (
                p[3] * (s1**3)[:, None] + 3.0 * p[2] * (s1 * s2)[:, None] + p[1] * s3[:, None],
                (
                    _of(p[4], s1**3, B[0]),
                    _of(p[3], 3.0 * s1 * s2, B[0]),
                    _of(p[2], s3, B[0]),
                    _of(p[3], 3.0 * s1**2, B[1]),
                    _of(p[2], 3.0 * s2, B[1]),
                    _of(p[2], 3.0 * s1, B[2]),
                    _of(p[1], 1.0, B[3]),
                ),
            ),
        )
        found = [
            RateRows.of(order, value / limit, sum(parts) / limit[None, :, None])
            for order, (limit, (value, parts)) in enumerate(zip(self.limits.rates, by_path, strict=True), 1)
        ]
        if self.slow is not None:
            bound, slope = self.slow.at(s)
            gradient = B[1] / bound[:, None] - (s1 * slope / bound**2)[:, None] * B[0]
            found.append(RateRows(np.ones(len(s), dtype=int), s1 / bound, gradient))
        joined = RateRows.joined(found)
        return joined._replace(gradient=joined.gradient[:, self.free])

    def rising(self) -> Array:
        """Return the matrix (K - 1, count) of the steps between control points, which are not negative."""
        return np.asarray(np.diff(np.eye(self.basis.size), axis=0)[:, self.free])

    def end_state(self, control: Array, last: bool) -> tuple[Array, Array]:
        """Return q, dq/dw and d²q/dw² at an end, (3, n), and their derivatives by the variables, (3, n, count)."""
        law, at = control[:, 0], -1 if last else 0
        first, second = (self.basis.derivative[order][at] for order in (1, 2))
        p = [self.path(float(last), order) for order in range(3)]
        s1, s2 = float(first @ law), float(second @ law)
        state = np.array([p[0], p[1] * s1, p[2] * s1**2 + p[1] * s2])
        by_law = np.zeros((3, len(p[0]), self.basis.size))
        by_law[1] = np.outer(p[1], first)
        by_law[2] = np.outer(2.0 * s1 * p[2], first) + np.outer(p[1], second)
        return state, by_law[:, :, self.free]

    def curve(self, control: Array, duration: float) -> "LawCurve":
        """Return the motion along the path in a duration, s, as terms see it."""
        return LawCurve(self, control[:, 0], duration)


def _between(edges: Array, parts: int) -> Array:
    """Return points at equal steps in each span, ends included."""
    shares = np.arange(parts) / parts
    return np.append((edges[:-1, None] + np.diff(edges)[:, None] * shares).ravel(), edges[-1])


def _of(derivative: Array, factor: Array | float, rows: Array) -> Array:
    """Return (N, n, K): a derivative of the path (N, n) times a factor (N,) and a row of the law's spline (N, K)."""
    return np.asarray((derivative * np.reshape(factor, (-1, 1)))[:, :, None] * rows[:, None, :])


@dataclass(frozen=True, eq=False)
class LawCurve:
    """A motion along a path; to terms what `trajopt.terms.term.Curve` is, its variables those of the law."""

    part: LinePart
    law: Array
    duration: float

    @property
    def samples(self) -> Instants:
        """Samples at which terms are evaluated."""
        return self.part.instants

    @cached_property
    def _on_path(self) -> tuple[list[Array], list[Array]]:
        """Derivatives of the path and of the law by time, at the samples: (N, n) and (N,) each."""
        at = [rows @ self.law / self.duration**order for order, rows in enumerate(self.samples.at)]
        s = np.clip(at[0], 0.0, 1.0)
        return [self.part.path(s, order) for order in range(4)], at

    @cached_property
    def motion(self) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration at the samples, (N, n) each."""
        p, (_, v, a) = self._on_path
        return p[0], p[1] * v[:, None], p[2] * (v**2)[:, None] + p[1] * a[:, None]

    @property
    def variables(self) -> int:
        """Number of variables."""
        return self.part.count

    def rows(self, sample: Index, value: Array, by_state: tuple[Array, Array, Array]) -> SoftRows:
        """Return rows (R,) from their derivatives by q, v and a, (R, n) each; see `Curve.rows`."""
        p, (_, v, a) = ([one[sample] for one in some] for some in self._on_path)
        B = [rows[sample] / self.duration**order for order, rows in enumerate(self.samples.at)]
        dot = [[np.einsum("rj,rj->r", one, by)[:, None] for by in by_state] for one in p]
        v, a = v[:, None], a[:, None]
        by_law = B[0] * (dot[1][0] + dot[2][1] * v + dot[3][2] * v**2 + dot[2][2] * a)
        by_law += B[1] * (dot[1][1] + 2.0 * v * dot[2][2]) + B[2] * dot[1][2]
        by_duration = np.zeros(len(value))
        for order in (1, 2):
            by_duration -= order * np.einsum("rj,rj->r", by_state[order], self.motion[order][sample]) / self.duration
        return SoftRows(sample, value, by_law[:, self.part.free], by_duration)
