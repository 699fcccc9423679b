"""`SeamCurve`: a curve in space over its length, with the direction of the tool along it."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from optiplan.arrays import Array, Index

_LEAST = 1e-3
"""Length below which a direction that is interpolated is no direction."""


@dataclass(frozen=True, eq=False)
class SeamCurve:
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
        x = _unit(near - (near * z).sum(axis=1, keepdims=True) * z)
        return np.stack([x, np.cross(z, x), z], axis=2)

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
    def kink(self) -> float:
        """Largest step of c' between pieces that is not at a corner; of a unit vector."""
        before = self._ends(_derived(self.position, 1))
        steps = np.linalg.norm(self.position[1:, 1] - before[:-1], axis=1)
        inner = self.breakpoints[1:-1]
        at = np.isin(inner, np.array(self.corners)) if self.corners else np.zeros(len(inner), dtype=bool)
        return float(steps[~at].max(initial=0.0))

    @cached_property
    def turns(self) -> Array:
        """Bounds (K,) of how fast the tool's frame turns over the length on the pieces, rad/m.

        |(w / |w|)'| <= |w'| / |w|; of h, across z, likewise with the part of h across, which z' turns besides.
        """
        h = np.diff(self.breakpoints)
        rate = _bound(_derived(self.axis, 1), h)
        least = np.linalg.norm(self._middles(self.axis), axis=1) - 0.5 * h * rate
        turning = rate / np.maximum(least, _LEAST)
        if self.heading is None:
            return np.asarray(turning)
        middles = 0.5 * (self.breakpoints[1:] + self.breakpoints[:-1])
        across = self._values(self.heading, middles)
        z = self.directions(middles)
        across = across - (across * z).sum(axis=1, keepdims=True) * z
        own = _bound(_derived(self.heading, 1), h) + 2.0 * turning * _bound(self.heading, h)
        least = np.linalg.norm(across, axis=1) - 0.5 * h * own
        return np.asarray(turning + own / np.maximum(least, _LEAST))

    def _middles(self, coefficients: Array) -> Array:
        return self._values(coefficients, 0.5 * (self.breakpoints[1:] + self.breakpoints[:-1]))

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


def _unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))
