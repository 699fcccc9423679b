"""`SeamCurve`: a curve in space over its length, with the direction of the tool along it."""

from functools import cached_property
from itertools import pairwise

import numpy as np

from optiplan.arrays import Array, Index, ReadOnlyArrays
from optiplan.records import dataclass

_LEAST = 1e-9
"""Length below which a direction that is interpolated is no direction."""

_FINEST = 64
"""Parts into which a piece is divided where a bound needs it."""


@dataclass(frozen=True, eq=False)
class SeamCurve(ReadOnlyArrays):
    """A curve c(s) of K polynomial pieces over its length s, m, and the tool's axes along it.

    On piece k, with u = s - breakpoints[k], c(s) = sum_i position[k, i] u^i; the same of the vectors w(s) and h(s).
    The tool's z axis points along w / |w|; its x axis along the part of h across that, where h is given.

    Attributes:
        breakpoints: (K + 1,) m, from 0.
        position: (K, 6, 3) m and m^(1 - i): |c'| is 1 within 1e-4.
        axis: (K, 4, 3) of w.
        heading: (K, 4, 3) of h; None: the tool may turn about its z axis.
        corners: lengths, m, of corners where the direction jumps, so that the tool stops; increasing.
    """

    breakpoints: Array
    position: Array
    axis: Array
    heading: Array | None
    corners: tuple[float, ...] = ()

    @property
    def length(self) -> float:
        """Length of the curve, m."""
        return float(self.breakpoints[-1])

    def piece(self, s: Array) -> Index:
        """Return the pieces (N,) of lengths s (N,), m."""
        return np.searchsorted(self.breakpoints[1:-1], s, side="right")

    def points(self, s: Array, order: int = 0) -> Array:
        """Return c, or its derivative, at lengths s (N,), m: (N, 3)."""
        return self._values(self.position, s, order)

    def directions(self, s: Array) -> Array:
        """Return the unit directions (N, 3) of the tool's z axis at lengths s (N,), m."""
        return _unit(self._values(self.axis, s))

    def rotations(self, s: Array) -> Array:
        """Return the rotations R_WF (N, 3, 3) of the tool at lengths s (N,), m, some where it may turn."""
        z = self.directions(s)
        if self.heading is None:
            near = np.eye(3)[np.abs(z).argmin(axis=1)]
        else:
            near = self._values(self.heading, s)
        return _frame(z, near)

    def _values(self, coefficients: Array, s: Array, order: int = 0) -> Array:
        k = self.piece(s)
        c = _derived(coefficients, order)[k]
        u = (s - self.breakpoints[k])[:, None]
        value = c[:, -1]
        for i in range(c.shape[1] - 2, -1, -1):
            value = value * u + c[:, i]
        return np.asarray(value)

    @cached_property
    def bends(self) -> Array:
        """Bounds (K,) of |c''| on the pieces, 1/m."""
        return _bound(_derived(self.position, 2), np.diff(self.breakpoints))

    @cached_property
    def rates(self) -> Array:
        """Bounds (K,) of |c'| on the pieces."""
        h = np.diff(self.breakpoints)
        middles = 0.5 * (self.breakpoints[1:] + self.breakpoints[:-1])
        return np.asarray(np.linalg.norm(self.points(middles, 1), axis=1) + 0.5 * h * self.bends)

    @cached_property
    def kinks(self) -> Array:
        """Steps (K - 1,) of c' between pieces, of a unit vector; 0 at corners."""
        before = self._ends(_derived(self.position, 1))
        steps = np.linalg.norm(self.position[1:, 1] - before[:-1], axis=1)
        inner = self.breakpoints[1:-1]
        at = np.isin(inner, np.array(self.corners)) if self.corners else np.zeros(len(inner), dtype=bool)
        return np.where(at, 0.0, steps)

    @cached_property
    def gaps(self) -> Array:
        """Steps (K - 1,) of c between pieces, m."""
        return np.asarray(np.linalg.norm(self.position[1:, 0] - self._ends(self.position)[:-1], axis=1))

    @cached_property
    def flips(self) -> Array:
        """Steps (K - 1,) of the tool's frame between pieces, rad: at most the turn of its z axis, or of all axes."""
        before, after = _unit(self._ends(self.axis)[:-1]), _unit(self.axis[1:, 0])
        if self.heading is None:
            return np.asarray(2.0 * np.arcsin(np.minimum(1.0, 0.5 * np.linalg.norm(after - before, axis=1))))
        X = _frame(before, self._ends(self.heading)[:-1]), _frame(after, self.heading[1:, 0])
        off = np.linalg.norm((X[1] - X[0]).reshape(-1, 9), axis=1) / np.sqrt(2.0)
        return np.asarray(2.0 * np.arcsin(np.minimum(1.0, 0.5 * off)))

    @cached_property
    def turns(self) -> Array:
        """Bounds (K,) of how fast the tool's frame turns over the length on the pieces, rad/m.

        |(w / |w|)'| <= |w'| / |w|; of h, across z, likewise with the part of h across, which z' turns besides. Infinite
        where w, or that part of h, may vanish. A piece is divided where that helps.
        """
        found, parts = self._turns(1), 1
        while np.isinf(found).any() and parts < _FINEST:
            parts *= 2
            found = np.minimum(found, self._turns(parts))
        return found

    def _turns(self, parts: int) -> Array:
        """Return the bounds of `turns`, each the largest of those of equal parts of a piece."""
        h = np.repeat(np.diff(self.breakpoints) / parts, parts)
        piece = np.repeat(np.arange(len(self.axis)), parts)
        u = h * (np.tile(np.arange(parts), len(self.axis)) + 0.5)
        w, rate = _about(self.axis[piece], u), _bound_about(_derived(self.axis, 1)[piece], u, h)
        turning = _over(rate, np.linalg.norm(w, axis=1) - 0.5 * h * rate)
        if self.heading is not None:
            z, across = _unit(w), _about(self.heading[piece], u)
            across = across - (across * z).sum(axis=1, keepdims=True) * z
            with np.errstate(invalid="ignore"):  # nothing may turn infinitely: no bound
                own = _bound_about(_derived(self.heading, 1)[piece], u, h)
                own = own + 2.0 * turning * _bound_about(self.heading[piece], u, h)
                turning = turning + _over(own, np.linalg.norm(across, axis=1) - 0.5 * h * own)
        return np.asarray(np.nan_to_num(turning, nan=np.inf, posinf=np.inf).reshape(-1, parts).max(axis=1))

    def _ends(self, coefficients: Array) -> Array:
        h = np.diff(self.breakpoints)[:, None, None] ** np.arange(coefficients.shape[1])[:, None]
        return np.asarray((coefficients * h).sum(axis=1))

    def runs(self) -> list[tuple[float, float]]:
        """Return the parts between corners, from one length to another, m."""
        edges = [0.0, *self.corners, self.length]
        return list(pairwise(edges))


def _derived(coefficients: Array, order: int) -> Array:
    for _ in range(order):
        coefficients = coefficients[:, 1:] * np.arange(1, coefficients.shape[1])[:, None]
    return coefficients


def _bound(coefficients: Array, h: Array) -> Array:
    """Bound (K,) of the length of polynomials (K, d, 3) on pieces of length h (K,): the sum of their terms' lengths."""
    powers = h[:, None] ** np.arange(coefficients.shape[1])
    return np.asarray((np.linalg.norm(coefficients, axis=2) * powers).sum(axis=1))


def _about(coefficients: Array, u: Array) -> Array:
    """Values (K, 3) of polynomials (K, d, 3) at u (K,)."""
    return np.asarray((coefficients * (u[:, None] ** np.arange(coefficients.shape[1]))[:, :, None]).sum(axis=1))


def _bound_about(coefficients: Array, u: Array, h: Array) -> Array:
    """Bound (K,) of the length of polynomials (K, d, 3) within h / 2 (K,) of u (K,): by its Taylor series there."""
    total, factor = np.zeros(len(u)), 1.0
    for order in range(coefficients.shape[1]):
        derivative = _about(_derived(coefficients, order), u)
        total += np.linalg.norm(derivative, axis=1) * (0.5 * h) ** order / factor
        factor *= order + 1
    return total


def _over(rate: Array, least: Array) -> Array:
    """Return rates (K,) over the least lengths (K,) of vectors; infinite where these may vanish."""
    return np.asarray(np.divide(rate, least, out=np.full(len(rate), np.inf), where=least > _LEAST))


def _frame(z: Array, near: Array) -> Array:
    """Return rotations (N, 3, 3) with these z axes (N, 3), whose x axes are as near to vectors (N, 3) as can be."""
    x = _unit(near - (near * z).sum(axis=1, keepdims=True) * z)
    return np.stack([x, np.cross(z, x), z], axis=2)


def _unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))
