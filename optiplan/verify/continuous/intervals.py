"""Intervals of time with their open pairs, and bounds on the joint motion there."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from math import perm

import numpy as np

from optiplan.arrays import Array, Flags, Index, parts_of
from optiplan.records import dataclass
from optiplan.trajectory.polynomial import taylor
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.motion_bounds import Boxes
from optiplan.verify.continuous.proof import least_of_kinds

MOST_AT_ONCE = 20_000
"""Intervals, or open items, that are processed at once, to bound memory."""


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
        parent, offset = parts_of(parts)
        level, index = (self.level + halvings)[parent], (self.index * parts)[parent] + offset
        return Intervals(self.piece[parent], level, index, self.pair[parent])

    def each_with(self, pairs: Index) -> "Intervals":
        """Return every item with each of these pairs (T,) in the place of its own."""
        count = len(pairs)
        piece, level, index = (np.repeat(part, count) for part in (self.piece, self.level, self.index))
        return Intervals(piece, level, index, np.tile(pairs, len(self.piece)))

    def grouped(self) -> tuple["Intervals", "Intervals", Index]:
        """Return the items ordered by interval, the unique intervals (pair 0), and the interval index of each item."""
        order = np.lexsort((self.index, self.level, self.piece))
        items = self.take(order)
        new = np.ones(len(order), dtype=bool)
        for key in (items.piece, items.level, items.index):
            new[1:] &= key[1:] == key[:-1]
        new[1:] = ~new[1:]
        return items, items.take(np.flatnonzero(new)), new.cumsum() - 1

    def widths(self, trajectory: Trajectory) -> Array:
        """Lengths, s."""
        return np.asarray(trajectory.widths[self.piece] * 0.5**self.level)


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


@dataclass(frozen=True, eq=False)
class IntervalBlocks:
    """B blocks of neighbouring intervals, first[b] to last[b] - 1, and what bounding volumes prove of T pairs there.

    Attributes:
        pairs: (T,) indices of the pairs.
        near: (B, T) proved clear, but by less than is worth telling.
        margin: (B, T) the clearance proved, m.
    """

    pairs: Index
    intervals: Intervals
    first: Index
    last: Index
    near: Flags
    margin: Array

    def least(self, kinds: Index) -> Array:
        """Return the smallest clearance proved of those near of each kind, (2,) m."""
        near = np.where(self.near, self.margin, np.inf).min(axis=0, initial=np.inf)
        return least_of_kinds(near, kinds[self.pairs])

    def members(self, chosen: Flags) -> Intervals:
        """All intervals of the blocks chosen (B, T), with their pairs."""
        rows, pairs = np.nonzero(chosen)
        block, within = parts_of((self.last - self.first)[rows])
        items = self.intervals.take(self.first[rows][block] + within)
        return replace(items, pair=self.pairs[pairs][block])


def boxes(trajectory: Trajectory, items: Intervals, jump: Array) -> Boxes:
    """Bound the joints' motion on these intervals by Taylor's theorem, which for polynomials is exact.

    With b_k = q^(k)(middle) / k! and half width h:  |q(t) - q(middle)| <= sum_k>=1 |b_k| h^k,
    |q'(t)| <= sum_k>=1 k |b_k| h^(k-1),  |q''(t)| <= sum_k>=2 k (k-1) |b_k| h^(k-2).
    """
    width = items.widths(trajectory)[:, None]
    middle, half = (items.index + 0.5)[:, None] * width, 0.5 * width
    b = taylor(trajectory.coefficients[items.piece], middle)
    size = np.abs(b)
    size[0] = 0.0
    reach, speed, acceleration = _sums(size, half, 3)
    jump = jump[items.piece]
    reach += jump + 1e-15
    return Boxes(half[:, 0], b[0], b[1] if len(b) > 1 else np.zeros_like(b[0]), reach, speed, acceleration, jump)


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
    return _sums(np.abs(taylor(c, middle)), half, orders)


def _sums(size: Array, half: Array, orders: int) -> Array:
    """sum_k>=r k! / (k - r)! size_k half^(k - r), (orders, K, n), by Horner's rule; size (degree + 1, K, n)."""
    sums = np.zeros((orders, *size.shape[1:]))
    factors = _falling(len(size), orders)
    for k in range(len(size) - 1, -1, -1):
        few = sums[: k + 1]
        few *= half
        few += factors[k, : len(few)] * size[k]
    return sums


@cache
def _falling(size: int, orders: int) -> Array:
    """Falling factorials k! / (k - r)! of k < size and r < orders, (size, orders, 1, 1); 0 where r > k."""
    return np.array([[float(perm(k, r)) for r in range(orders)] for k in range(size)])[..., None, None]
