"""Time laws: how one coordinate s runs from 0 to 1, at rest at both ends, in exact polynomial pieces.

A joint that moves by D follows q(t) = q_start + D s(t): its velocity limit v bounds ds/dt by v / |D|, and so on. All
laws are symmetric, s(T - t) = 1 - s(t). Source: the lecture on trajectory planning, and Biagiotti and Melchiorri,
Trajectory Planning for Automatic Machines and Robots, ch. 2 and 3.
"""

from math import inf
from typing import NamedTuple, Protocol

import numpy as np

from optiplan.arrays import Array
from optiplan.records import dataclass
from optiplan.trajectory import polynomial
from optiplan.trajectory.timing.s_curve import s_curve
from optiplan.trajectory.tolerances import SAME_TIME


@dataclass(frozen=True)
class Bounds:
    """Largest |ds/dt| (1/s), |d²s/dt²| (1/s²) and |d³s/dt³| (1/s³); a law uses the bounds it can meet."""

    velocity: float = inf
    acceleration: float = inf
    jerk: float = inf


@dataclass(frozen=True, eq=False)
class LawPieces:
    """s(t) = sum_k coefficients[i, k] (t - t_i)^k on piece i: breakpoints (m + 1,), s; coefficients (m, degree + 1)."""

    breakpoints: Array
    coefficients: Array

    @property
    def duration(self) -> float:
        """Length in time, s."""
        return float(self.breakpoints[-1])

    def stretched(self, duration: float) -> "LawPieces":
        """Return the same curve in another duration, s."""
        rate = self.duration / duration
        return LawPieces(self.breakpoints / rate, self.coefficients * rate ** np.arange(self.coefficients.shape[1]))


class Law(Protocol):
    """A family of curves s(t), one for every duration."""

    def shortest(self, bounds: Bounds) -> float:
        """Return the shortest duration within the bounds, s, or the nearest to meeting them."""
        ...

    def pieces(self, duration: float, bounds: Bounds) -> LawPieces:
        """Return the curve of that duration, s; it keeps the bounds if the duration is long enough for them."""
        ...


@dataclass(frozen=True)
class PolynomialLaw:
    """s = p(t / T) with one polynomial p, its coefficients in ascending order.

    With c_k the largest |p^(k)| on [0, 1], the shortest duration is T = max_k (c_k / bound_k)^(1/k), k = 1, 2, 3.
    """

    shape: tuple[float, ...]

    def peaks(self) -> list[float]:
        """Return c_1, c_2 and c_3 above."""
        found, p = [], np.array([self.shape])
        for _ in range(3):
            p = polynomial.derivative(p)
            ends = polynomial.unit_extrema(p)
            found.append(float(max(-ends.low[0], ends.high[0])))
        return found

    def shortest(self, bounds: Bounds) -> float:
        """See `Law`."""
        v, a, j = self.peaks()
        return float(max(v / bounds.velocity, (a / bounds.acceleration) ** 0.5, np.cbrt(j / bounds.jerk)))

    def pieces(self, duration: float, bounds: Bounds) -> LawPieces:
        """See `Law`; the curve is the same whatever the bounds."""
        return LawPieces(np.array([0.0, 1.0]), np.array([self.shape])).stretched(duration)


CUBIC = PolynomialLaw((0.0, 0.0, 3.0, -2.0))
"""At rest at both ends, where its acceleration jumps."""
QUINTIC = PolynomialLaw((0.0, 0.0, 0.0, 10.0, -15.0, 6.0))
"""At rest without acceleration at both ends: peaks 1.875, 10 / sqrt(3), 60."""
SEPTIC = PolynomialLaw((0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0))
"""At rest without acceleration and jerk at both ends."""


class LawPoint(NamedTuple):
    """A law at a share u of its time: s, ds/du and d²s/du²."""

    s: float
    rate: float
    change: float


def quintic_at(u: float) -> LawPoint:
    """Return `QUINTIC`, s(u) = 10 u³ - 15 u⁴ + 6 u⁵, at u in [0, 1]: factored, so that it is exact at both ends."""
    s = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    return LawPoint(s, 30.0 * u**2 * (1.0 - u) ** 2, 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u))


@dataclass(frozen=True)
class Trapezoid:
    """Constant acceleration a over the blend time t_b, constant velocity V, and constant deceleration (lspb).

    V = 1 / (T - t_b),  a = V / t_b,  0 < t_b <= T / 2,  hence 1 / T < V <= 2 / T and a >= 4 / T².

    One of the three may be given; the caller checks that the duration fits it. Without any, t_b is as near to T / 3 as
    the bounds allow, and the shortest duration is the least of all: full acceleration up to the velocity bound. Jerk
    is not bounded: the acceleration jumps.

    Attributes:
        velocity: V, 1/s.
        blend_time: t_b, s.
        acceleration: a, 1/s².
    """

    velocity: float | None = None
    blend_time: float | None = None
    acceleration: float | None = None

    def shortest(self, bounds: Bounds) -> float:
        """See `Law`."""
        v, a = bounds.velocity, bounds.acceleration
        if self.velocity is not None:
            return min(1.0 / self.velocity + self.velocity / a, 2.0 / self.velocity)
        if self.blend_time is not None:
            b = self.blend_time
            return max(2.0 * b, b + 1.0 / v, b + 1.0 / (a * b))
        a = a if self.acceleration is None else self.acceleration
        return 2.0 / a**0.5 if a <= v**2 else 1.0 / v + v / a

    def blend(self, duration: float, bounds: Bounds) -> float:
        """t_b, s, in that duration."""
        T = duration
        if self.velocity is not None:
            b = T - 1.0 / self.velocity
        elif self.blend_time is not None:
            b = self.blend_time
        elif self.acceleration is not None:
            b = _least_blend(T, self.acceleration)
        else:
            b = max(min(T / 3.0, T - 1.0 / bounds.velocity), _least_blend(T, bounds.acceleration))
        return min(b, T / 2.0)

    def pieces(self, duration: float, bounds: Bounds) -> LawPieces:
        """See `Law`."""
        T, b = duration, self.blend(duration, bounds)
        V = 1.0 / (T - b)
        half = 0.5 * V / b
        rows = [[0.0, 0.0, half], [0.5 * V * b, V, 0.0], [1.0 - 0.5 * V * b, V, -half]]
        return _without_empty(np.array([0.0, b, T - b, T]), np.array(rows))


def _least_blend(T: float, a: float) -> float:
    """The smaller solution of a t_b (T - t_b) = 1, written without cancellation; T / 2 where there is none."""
    return 2.0 / a / (T + max(T * T - 4.0 / a, 0.0) ** 0.5) if a * T * T > 4.0 else T / 2.0


@dataclass(frozen=True)
class BangBang:
    """The least time under the bounds on acceleration and velocity: full acceleration, then full deceleration.

    Unless the velocity bound comes between, it switches at t_s = sqrt(1 / a), T = 2 t_s, with the peak velocity a t_s.
    In a longer duration: with the least acceleration under the velocity bound, 4 / T² unless that comes between.
    """

    def shortest(self, bounds: Bounds) -> float:
        """See `Law`."""
        return Trapezoid().shortest(bounds)

    def pieces(self, duration: float, bounds: Bounds) -> LawPieces:
        """See `Law`."""
        between = 1.0 < bounds.velocity * duration < 2.0
        law = Trapezoid(velocity=bounds.velocity) if between else Trapezoid(acceleration=4.0 / duration**2)
        return law.pieces(duration, bounds)


@dataclass(frozen=True)
class SCurve:
    """The least time under bounds on velocity, acceleration and jerk (the seven phases of `s_curve`), or stretched."""

    def shortest(self, bounds: Bounds) -> float:
        """See `Law`."""
        return self._fastest(bounds).duration

    def pieces(self, duration: float, bounds: Bounds) -> LawPieces:
        """See `Law`."""
        return self._fastest(bounds).stretched(duration)

    @staticmethod
    def _fastest(bounds: Bounds) -> LawPieces:
        times, rows = s_curve(1.0, bounds.velocity, bounds.acceleration, bounds.jerk)
        return LawPieces(np.concatenate([[0.0], np.cumsum(times)]), rows)


def _without_empty(breakpoints: Array, coefficients: Array) -> LawPieces:
    """Pieces whose share of the time is nothing but rounding are left out."""
    kept = np.diff(breakpoints) > SAME_TIME * breakpoints[-1]
    ends = np.append(breakpoints[:-1][kept], breakpoints[-1])
    ends[0] = 0.0
    return LawPieces(ends, coefficients[kept])
