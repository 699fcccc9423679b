"""The certificate: a proof that no two bodies touch at any time, or the time and place where it fails."""

from dataclasses import dataclass, field, replace
from math import comb

import numpy as np

from optiplan.arrays import Array
from optiplan.model.collision import CollisionModel
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import VerifyPolicy
from optiplan.verify.separation import Index, PairDistances

ROUNDING = 1e-9  # m, subtracted from every proved clearance
_FIRST_TRAVEL = 0.05  # rad or m, summed over joints: how coarse the first intervals may be
_CHUNK = 256  # intervals handled by bounding volumes at a time, to bound memory


@dataclass(frozen=True, eq=False)
class Items:
    """Open questions: is pair k clear on its interval? Intervals are dyadic parts of polynomial pieces.

    Item k covers [i / 2^level, (i + 1) / 2^level] of piece `piece`, i = `index`. All arrays are (K,).
    """

    piece: Index
    level: Index
    index: Index
    pair: Index

    def take(self, chosen: Index) -> "Items":
        """The items at these positions."""
        return Items(self.piece[chosen], self.level[chosen], self.index[chosen], self.pair[chosen])

    def split(self, halvings: Index) -> "Items":
        """Every item k in 2^halvings[k] equal parts."""
        parts = 2**halvings
        parent = np.repeat(np.arange(len(parts)), parts)
        offset = np.arange(len(parent)) - np.repeat(np.cumsum(parts) - parts, parts)
        level, index = (self.level + halvings)[parent], (self.index * parts)[parent] + offset
        return Items(self.piece[parent], level, index, self.pair[parent])


@dataclass(frozen=True)
class Moment:
    """A pair at a time: distance in m, names, nearest points (2, 3) in the world, configuration (n,)."""

    distance: float
    time: float
    pair: tuple[str, str]
    points: Array
    q: Array


@dataclass(frozen=True)
class Proof:
    """What the certificate established.

    Attributes:
        proved: every pair stays farther apart than the policy's clearance at all times.
        reason: why not, else empty.
        intervals: how many different intervals of time were looked at.
        queries: exact distance queries made.
        believed: how many of them no separating plane confirmed (non-convex meshes): coal's word less 1e-6 m.
        clearance: the smallest clearance proved of all intervals, m: no pair ever comes nearer.
        nearest: the smallest distance measured, an upper bound of the true minimum; None if no query was needed.
        contact: whether bodies do come too near at the time of `nearest`, rather than only nothing being proved.
    """

    proved: bool
    reason: str = ""
    intervals: int = 0
    queries: int = 0
    believed: int = 0
    clearance: float = np.inf
    nearest: Moment | None = None
    contact: bool = False


def certify(model: CollisionModel, trajectory: Trajectory, policy: VerifyPolicy) -> Proof:
    """Prove that all pairs stay apart for all t in [0, duration].

    On an interval with middle m a pair is clear if  distance(m) - travel > clearance + 1e-9 m, where travel bounds the
    change of its distance while every joint j stays within D_j of q_j(m), and by Taylor's theorem for polynomials
        |q_j(t) - q_j(m)| <= D_j = sum_k>=1 |q_j^(k)(m)| / k! h^k      for |t - m| <= h.
    Where that fails the interval is divided for this pair alone. Bounding volumes answer most pairs, exact queries
    confirmed by separating planes the rest.

    Holds at: all times of the closed interval [0, duration].
    """
    search = _Search(model, trajectory, policy)
    items = search.begin()
    while len(items.pair):
        items = search.advance(items)
        if search.proof.reason:
            return search.proof
    return replace(search.proof, proved=True)


@dataclass(eq=False)
class _Search:
    """Breadth-first over intervals: `advance` answers all open items at once and returns those still open, divided."""

    model: CollisionModel
    trajectory: Trajectory
    policy: VerifyPolicy
    proof: Proof = field(default_factory=lambda: Proof(False))

    def __post_init__(self) -> None:
        self.distances = PairDistances(self.model)
        self.lengths = np.diff(self.trajectory.breakpoints)
        jump = np.zeros((len(self.lengths) + 1, self.trajectory.n))
        jump[1:-1] = np.minimum(np.abs(self.trajectory.jumps(0)), self.policy.jump_tolerance)
        self.jump = np.maximum(jump[:-1], jump[1:])  # a tolerated step at a breakpoint widens both pieces beside it

    def begin(self) -> Items:
        """Intervals short enough for bounding volumes to tell something, with the pairs these leave open."""
        piece = np.arange(len(self.lengths))
        zero = np.zeros_like(piece)
        _, D = self.boxes(Items(piece, zero, zero, zero))
        halvings = np.clip(np.ceil(np.log2(np.maximum(D.sum(axis=1) / _FIRST_TRAVEL, 1.0))), 0, 12).astype(np.intp)
        intervals = Items(piece, zero, zero, zero).split(halvings)
        self.proof = replace(self.proof, intervals=len(intervals.piece))
        opened = []
        for first in range(0, len(intervals.piece), _CHUNK):
            chunk = intervals.take(np.arange(first, min(first + _CHUNK, len(intervals.piece))))
            Q, D = self.boxes(chunk)
            margin = self.model.lower_bounds(Q) - self.model.travel(Q, D) - ROUNDING
            clear = margin > self.policy.clearance
            self.keep(margin[clear])
            rows, pairs = np.nonzero(~clear)
            opened.append(replace(chunk.take(rows), pair=pairs))
        return Items(*(np.concatenate([getattr(o, a) for o in opened]) for a in ("piece", "level", "index", "pair")))

    def advance(self, items: Items) -> Items:
        """Ask the exact distance of every item; stop at a contact, divide what is not proved."""
        policy = self.policy
        self.proof = replace(self.proof, queries=self.proof.queries + len(items.pair))
        intervals, rows = np.unique(np.stack([items.piece, items.level, items.index]), axis=1, return_inverse=True)
        order = np.argsort(rows, kind="stable")
        items, rows = items.take(order), rows[order]
        unique = Items(intervals[0], intervals[1], intervals[2], intervals[0])
        Q, D = self.boxes(unique)
        found = self.distances.query(Q, rows, items.pair)
        travel = self.model.bounds.travel_of(Q, D, rows, items.pair)
        margin = found.bound - travel - ROUNDING
        clear = margin > policy.clearance
        self.keep(margin[clear])
        count = self.proof.intervals + intervals.shape[1]
        self.proof = replace(self.proof, intervals=count, believed=self.proof.believed + int(found.believed.sum()))
        middle = self.times(unique)[rows]
        best = np.maximum(found.bound, found.measured)
        self.see(best, middle, Q[rows], items.pair)
        if (best <= policy.clearance + ROUNDING).any():
            return self.stop(items, "bodies come too near" if policy.clearance > 0 else "bodies touch", contact=True)
        still = np.flatnonzero(~clear)
        gap = np.maximum(found.bound[still] - policy.clearance - ROUNDING, 1e-300)
        ratio = np.minimum(1.1 * travel[still] / gap, 16.0)
        divided = items.take(still).split(np.clip(np.ceil(np.log2(ratio)), 1, 4).astype(np.intp))
        return self.limit(divided)

    def limit(self, items: Items) -> Items:
        """Give up where intervals become shorter than the policy's or the queries too many."""
        if len(items.pair) and (self.lengths[items.piece] * 0.5**items.level).min() < self.policy.min_interval:
            return self.stop(items, f"clearance not proved on intervals of {self.policy.min_interval:g} s")
        if self.proof.queries + len(items.pair) > self.policy.max_queries:
            return self.stop(items, f"clearance not proved within {self.policy.max_queries} distance queries")
        return items

    def stop(self, items: Items, reason: str, contact: bool = False) -> Items:
        """End the search with a reason."""
        self.proof = replace(self.proof, reason=reason, contact=contact)
        return items.take(np.empty(0, dtype=np.intp))

    def keep(self, margins: Array) -> None:
        """Remember the smallest clearance proved."""
        if len(margins):
            self.proof = replace(self.proof, clearance=min(self.proof.clearance, float(margins.min())))

    def see(self, distance: Array, times: Array, Q: Array, pairs: Index) -> None:
        """Remember the smallest distance measured, with its witness."""
        k = int(np.argmin(distance))
        if self.proof.nearest is None or distance[k] < self.proof.nearest.distance:
            _, points = self.distances.witness(Q[k], int(pairs[k]))
            pair = self.model.pairs[int(pairs[k])]
            nearest = Moment(float(distance[k]), float(times[k]), (pair.name_a, pair.name_b), points, Q[k].copy())
            self.proof = replace(self.proof, nearest=nearest)

    def times(self, items: Items) -> Array:
        """Middles of the intervals, s."""
        start, length = self.trajectory.breakpoints[items.piece], self.lengths[items.piece]
        return np.asarray(start + length * (items.index + 0.5) * 0.5**items.level)

    def boxes(self, items: Items) -> tuple[Array, Array]:
        """Configurations at the middles and the box each joint stays in about them: Q and D, (K, n)."""
        c = self.trajectory.coefficients[items.piece]  # (K, degree + 1, n)
        width = 0.5**items.level * self.lengths[items.piece]
        middle, half = (items.index + 0.5) * width, 0.5 * width
        degree = c.shape[1] - 1
        D = self.jump[items.piece] + 1e-15
        for k in range(degree, -1, -1):
            shifted = comb(degree, k) * c[:, degree]  # q^(k)(m) / k!, by Horner's rule
            for i in range(degree - 1, k - 1, -1):
                shifted = shifted * middle[:, None] + comb(i, k) * c[:, i]
            if k > 0:
                D += np.abs(shifted) * half[:, None] ** k
        return shifted, D
