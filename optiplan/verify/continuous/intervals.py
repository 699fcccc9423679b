"""Intervals of time with their open pairs, and bounds on the joint motion there."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import comb, perm

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.motion_bounds import Boxes


@dataclass(frozen=True, eq=False)
class Intervals:
    """Open items: pairs not yet proved clear on an interval. Intervals are dyadic parts of polynomial pieces.

    Item k covers [i / 2^level, (i + 1) / 2^level] of piece `piece`, i = `index`. All arrays are (K,).
    """

    piece: Index
    level: Index
    index: Index
    pair: Index

    @classmethod
    def whole(cls, pieces: int) -> "Intervals":
        """Return every piece once, pair 0."""
        zero = np.zeros(pieces, dtype=np.intp)
        return cls(np.arange(pieces), zero, zero, zero)

    @classmethod
    def join(cls, parts: Sequence["Intervals"]) -> "Intervals":
        """Concatenate items."""
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("piece", "level", "index", "pair")))

    def take(self, chosen: Index) -> "Intervals":
        """Return the items at these positions."""
        return Intervals(self.piece[chosen], self.level[chosen], self.index[chosen], self.pair[chosen])

    def split(self, halvings: Index) -> "Intervals":
        """Split every item k into 2^halvings[k] equal parts."""
        parts = 2**halvings
        parent = np.repeat(np.arange(len(parts)), parts)
        offset = np.arange(len(parent)) - np.repeat(np.cumsum(parts) - parts, parts)
        level, index = (self.level + halvings)[parent], (self.index * parts)[parent] + offset
        return Intervals(self.piece[parent], level, index, self.pair[parent])

    def grouped(self) -> tuple["Intervals", "Intervals", Index]:
        """Return the items ordered by interval, the unique intervals (pair 0), and the interval index of each item."""
        order = np.lexsort((self.index, self.level, self.piece))
        items = self.take(order)
        new = np.ones(len(order), dtype=bool)
        for key in (items.piece, items.level, items.index):
            new[1:] &= key[1:] == key[:-1]
        new[1:] = ~new[1:]
        return items, items.take(np.flatnonzero(new)), np.cumsum(new) - 1

    def widths(self, trajectory: Trajectory) -> Array:
        """Lengths, s."""
        return np.asarray(np.diff(trajectory.breakpoints)[self.piece] * 0.5**self.level)


def middles(trajectory: Trajectory, items: Intervals) -> Array:
    """Times of the middles, s."""
    return np.asarray(trajectory.breakpoints[items.piece] + (items.index + 0.5) * items.widths(trajectory))


def spans(trajectory: Trajectory, items: Intervals) -> tuple[Array, Array]:
    """Times at which the items begin and end, s."""
    width, start = items.widths(trajectory), trajectory.breakpoints[items.piece]
    return np.asarray(start + items.index * width), np.asarray(start + (items.index + 1) * width)


def step_sizes(trajectory: Trajectory, tolerance: float) -> Array:
    """Steps of position at the ends of each piece, at most the tolerance: (m, n), rad or m."""
    jump = np.zeros((len(trajectory.breakpoints), trajectory.n))
    jump[1:-1] = np.minimum(np.abs(trajectory.jumps(0)), tolerance)
    return np.maximum(jump[:-1], jump[1:])


def blocks(length: Array, most: float) -> tuple[Index, Index]:
    """Consecutive items in blocks whose lengths (K,) add up to about `most`: first item of each, one past its last."""
    block = np.floor((np.cumsum(length) - 0.5 * length) / most)
    first = np.flatnonzero(np.concatenate([[True], np.diff(block) > 0]))
    return first, np.append(first[1:], len(length))


def boxes(trajectory: Trajectory, items: Intervals, jump: Array) -> Boxes:
    """Bound the joints' motion on these intervals by Taylor's theorem, which for polynomials is exact.

    With b_k = q^(k)(middle) / k! and half width h:  |q(t) - q(middle)| <= sum_k>=1 |b_k| h^k,
    |q'(t)| <= sum_k>=1 k |b_k| h^(k-1),  |q''(t)| <= sum_k>=2 k (k-1) |b_k| h^(k-2).
    """
    c = trajectory.coefficients[items.piece]  # (K, degree + 1, n)
    width = items.widths(trajectory)[:, None]
    middle, half = (items.index + 0.5)[:, None] * width, 0.5 * width
    reach = jump[items.piece] + 1e-15
    speed, acceleration, v = np.zeros_like(reach), np.zeros_like(reach), np.zeros_like(reach)
    for k, b in taylor(c, middle):
        size = np.abs(b)
        if k > 0:
            reach += size * half**k
            speed += k * size * half ** (k - 1)
        if k > 1:
            acceleration += k * (k - 1) * size * half ** (k - 2)
        if k == 1:
            v = b
    return Boxes(half[:, 0], b, v, reach, speed, acceleration, jump[items.piece])


def taylor(c: Array, x: Array) -> Iterator[tuple[int, Array]]:
    """Powers k and Taylor coefficients p^(k)(x) / k!, (K, n), of polynomials c (K, degree + 1, n), highest k first.

    Args:
        c: ascending powers.
        x: (K, 1) where.
    """
    degree = c.shape[1] - 1
    for k in range(degree, -1, -1):
        b = comb(degree, k) * c[:, degree]
        for i in range(degree - 1, k - 1, -1):  # Horner's rule
            b = b * x + comb(i, k) * c[:, i]
        yield k, b


def derivative_bounds(c: Array, middle: Array, half: Array, orders: int) -> Array:
    """Bounds on |q^(r)| within `half` of `middle`, r = 0 to orders - 1: sum_k>=r k! / (k - r)! |b_k| half^(k - r).

    Args:
        c: (K, degree + 1, n) polynomials, ascending powers.
        middle: (K, 1) s.
        half: (K, 1) s.
        orders: how many derivatives.

    Returns:
        (orders, K, n).
    """
    bounds = np.zeros((orders, len(c), c.shape[2]))
    for k, b in taylor(c, middle):
        size = np.abs(b)
        for r in range(min(k + 1, orders)):
            bounds[r] += perm(k, r) * size * half ** (k - r)
    return bounds
