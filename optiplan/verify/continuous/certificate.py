"""Certificate: a proof that no two bodies touch at any time, or the time and place where it fails."""

from dataclasses import dataclass, field, replace
from weakref import WeakKeyDictionary

import numpy as np

from optiplan.arrays import Array, Flags, Index
from optiplan.collision.model import CollisionModel, SameBodies
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.bodies import Bodies
from optiplan.verify.continuous.clearance_record import ClearanceRecord
from optiplan.verify.continuous.interval_queries import ROUNDING, Asked, Middles, Nearness
from optiplan.verify.continuous.intervals import Intervals, blocks, boxes, middles, spans, step_sizes
from optiplan.verify.continuous.motion_bounds import Boxes, Motion
from optiplan.verify.continuous.separating_planes import PairDistances
from optiplan.verify.report import VerifyPolicy

_EASY = 5e-3  # m, margin by which bounding volumes must clear a pair at first
_TOLD = 0.8  # share of the smallest distance measured that is proved as clearance
_FAR = 0.1  # m: a larger clearance is not refined
_HULLS = 5e-3  # m: where hulls are proved farther apart, meshes are not queried
_ROOM = 1.25  # factor on the clearance to prove, below which meshes are queried instead of hulls
_MOST_OF_HULLS = 2  # halvings of an interval for hulls of clusters; else the bodies in them are asked
_MOST_AGAIN = 4_000  # items examined to refine the clearance after the proof
_FIRST_TRAVEL = 0.2  # rad or m, summed over joints: travel within the first intervals
_LARGEST = 1e5  # rad or m; with larger numbers rounding would eat up ROUNDING
_MOST_HALVINGS = 12  # of a piece before the first query
_MOST_ITEMS = 20_000  # items processed at once, to bound memory
_NONE = np.empty(0, dtype=np.intp)
_CHUNK = 256  # blocks of intervals bounded by volumes at a time, to bound memory

_Tools = tuple[Bodies, PairDistances, Motion]
_tools: WeakKeyDictionary[CollisionModel, _Tools] = WeakKeyDictionary()
"""What is the same for every motion in a work space."""

_last: WeakKeyDictionary[SameBodies, _Tools] = WeakKeyDictionary()
"""That of the last work space of the same bodies, of which obstacles may have stood elsewhere."""


def _tools_of(model: CollisionModel) -> _Tools:
    if model not in _tools:
        known = _last.get(model.same_bodies)
        if known is None:
            bodies = Bodies(model)
            found = bodies, PairDistances(model, bodies), Motion(bodies)
        else:
            bodies = known[0].with_obstacles_of(model)
            found = bodies, known[1].with_obstacles_of(model, bodies), known[2].with_obstacles_of(bodies)
        _tools[model] = _last[model.same_bodies] = found
    return _tools[model]


@dataclass(frozen=True)
class Moment:
    """A pair at a time: distance in m, names, nearest points (2, 3) in the world, configuration (n,)."""

    distance: float
    time: float
    pair: tuple[str, str]
    points: Array
    q: Array


@dataclass
class Proof:
    """Result of the certificate, and its books on the way.

    Attributes:
        proved: every pair stays farther apart than the policy's clearance at all times.
        reason: why not, else empty.
        intervals: number of different intervals of time examined.
        queries: exact distance queries made.
        gjk_only: how many of them no separating plane confirmed (non-convex meshes): coal's distance less 1e-6 m.
        clearance: the smallest clearance proved of all intervals, m: no pair ever comes nearer.
        nearest: the smallest distance measured, an upper bound of the true minimum; None if no query was needed.
        contact: whether bodies do come too near at the time of `nearest`, rather than only nothing being proved.
    """

    proved: bool
    reason: str = ""
    intervals: int = 0
    queries: int = 0
    gjk_only: int = 0
    clearance: float = np.inf
    nearest: Moment | None = None
    contact: bool = False


def certify(
    model: CollisionModel, trajectory: Trajectory, policy: VerifyPolicy, record: ClearanceRecord | None = None
) -> Proof:
    """Prove that all pairs stay apart for all t in [0, duration].

    On an interval with middle m and half width h, where a plane with normal w separates a pair by the gap g at m, the
    pair is clear if the larger of two lower bounds of its distance exceeds the clearance asked for by 1e-9 m:
        g - travel              how far the bodies can move in any direction;
        linear - curvature_loss the gap along w to first order in time, less what acceleration can take from it,
    see `motion_bounds.Motion`. Where that fails the interval is divided for this pair alone. Bounding volumes
    answer most pairs, exact queries confirmed by separating planes the rest.

    A `record` is filled with what was proved of which pair and when; its least is the proof's `clearance`.

    Holds at: all times of the closed interval [0, duration].
    """
    search = _Search(model, trajectory, policy, record)
    search.look_first()
    if search.proof.reason:
        return search.proof
    search.work_off(search.begin())
    if search.proof.reason:
        return search.proof
    rough = min(search.proof.clearance, search.coarse.clearance)
    proved = replace(search.proof, proved=True, clearance=rough)
    known = None if record is None else len(record)
    search.work_off(search.again())
    if not search.proof.reason:
        return replace(search.proof, proved=True)
    if record is not None:
        record.cut(known)
        search.tell(search.coarse.near)
    return proved


@dataclass(frozen=True, eq=False)
class _Coarse:
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

    @property
    def clearance(self) -> float:
        """Return the smallest clearance proved of those near, m."""
        return float(self.margin[self.near].min(initial=np.inf))

    def members(self, chosen: Flags) -> Intervals:
        """All intervals of the blocks chosen (B, T), with their pairs."""
        rows, pairs = np.nonzero(chosen)
        many = (self.last - self.first)[rows]
        within = np.arange(many.sum()) - np.repeat(np.cumsum(many) - many, many)
        items = self.intervals.take(np.repeat(self.first[rows], many) + within)
        return replace(items, pair=np.repeat(self.pairs[pairs], many))


@dataclass(eq=False)
class _Search:
    """Branch and bound over intervals: `advance` processes many open items and returns those still open, divided."""

    model: CollisionModel
    trajectory: Trajectory
    policy: VerifyPolicy
    record: ClearanceRecord | None = None
    proof: Proof = field(default_factory=lambda: Proof(False))

    def __post_init__(self) -> None:
        self.bodies, self.distances, self.motion = _tools_of(self.model)
        self.jump = step_sizes(self.trajectory, self.policy.jump_tolerance)

    def boxes(self, items: Intervals) -> Boxes:
        """Return bounds of the joints' motion on these intervals."""
        return boxes(self.trajectory, items, self.jump)

    def middles(self, intervals: Intervals) -> Middles:
        """Return where the joints are in the middles of these intervals, and bounds of their motion there."""
        b, kinematics = self.boxes(intervals), self.bodies.kinematics
        poses, times = kinematics.poses(b.q), middles(self.trajectory, intervals)
        return Middles(times, b.q, poses, *kinematics.axes(poses), self.motion.of_all_joints(b))

    def look_first(self) -> None:
        """Refuse at once what cannot be proved: huge numbers, bodies without bounds, bodies inside a mesh."""
        absurd = self.absurd()
        if absurd:
            self.proof.reason = f"{absurd} beyond {_LARGEST:g} leaves no digits for a proof"
            return
        if self.bodies.unsupported is not None:
            name = self.model.names[self.bodies.unsupported]
            self.proof.reason = f"'{name}' has a shape of which no motion can be bounded"
            return
        q = self.trajectory.start
        poses = self.bodies.kinematics.poses(q[None])[0][self.bodies.joints] @ self.bodies.placements
        found = self.model.containment.find(poses)
        if found is not None:
            pair = self.model.pairs[found.pair]
            where = Moment(0.0, 0.0, (pair.name_a, pair.name_b), np.array([found.point, found.point]), q)
            self.proof = Proof(False, "one body lies inside the other", nearest=where, contact=True)

    def absurd(self) -> str:
        """Return what is too large for a proof in floating point, or nothing: terms |c_k| h^k of positions, bodies."""
        c = self.trajectory.coefficients
        powers = self.trajectory.widths[:, None, None] ** np.arange(c.shape[1])[:, None]
        if not (np.abs(c) * powers).max() <= _LARGEST:
            return "a trajectory with terms"
        far = np.flatnonzero(~(self.bodies.extent <= _LARGEST))
        return f"'{self.model.names[far[0]]}', a body" if len(far) else ""

    def begin(self) -> Intervals:
        """Intervals on which joints move little, with the pairs that bounding volumes leave open there.

        Neighbouring intervals are looked at together where they are shorter than that.
        """
        intervals = Intervals.whole(len(self.trajectory.coefficients))
        b = self.boxes(intervals)
        while True:
            halvings = np.ceil(np.log2(np.maximum(b.reach.sum(axis=1) / _FIRST_TRAVEL, 1.0)))
            halvings = np.minimum(halvings, _MOST_HALVINGS - intervals.level)
            if not halvings.any():
                break
            intervals = intervals.split(halvings.astype(np.intp))
            b = self.boxes(intervals)
        self.proof.intervals = len(intervals.piece)
        first, last = blocks(b.reach.sum(axis=1), _FIRST_TRAVEL)
        low, high = np.minimum.reduceat(b.q - b.reach, first), np.maximum.reduceat(b.q + b.reach, first)
        tree, margins = self.bodies.tree, []
        for k in range(0, len(first), _CHUNK):
            Q, D = 0.5 * (low + high)[k : k + _CHUNK], 0.5 * (high - low)[k : k + _CHUNK] + 1e-15
            margins.append(tree.bounds.apart(Q, D, self.policy.clearance + _FAR + ROUNDING) - ROUNDING)
        margin = np.concatenate(margins)
        clear, far = margin > self.policy.clearance + _EASY, margin > self.policy.clearance + _FAR
        self.keep(margin[far])
        self.coarse = _Coarse(tree.tops, intervals, first, last, clear & ~far, margin)
        self.tell(far)
        return self.coarse.members(~clear)

    def again(self) -> Intervals:
        """Intervals on which bounding volumes prove less than is worth telling, unless they are too many."""
        coarse, nothing = self.coarse, np.zeros_like(self.coarse.near)
        chosen = coarse.near & (coarse.margin <= self.target()) if self.proof.nearest is not None else nothing
        items = coarse.members(chosen)
        if len(items.pair) > _MOST_AGAIN:
            chosen, items = nothing, coarse.members(nothing)
        self.keep(coarse.margin[coarse.near & ~chosen])
        self.tell(coarse.near & ~chosen)
        return items

    def work_off(self, items: Intervals) -> None:
        """Process these items and their parts until none is open or there is a reason to stop."""
        while len(items.pair) and not self.proof.reason:
            if len(items.pair) <= _MOST_ITEMS:
                items = self.advance(items)
                continue
            head, tail = np.split(np.arange(len(items.pair)), [_MOST_ITEMS])
            items = Intervals.join([self.advance(items.take(head)), items.take(tail)])

    def advance(self, items: Intervals) -> Intervals:
        """Query the exact distance of every item; stop at a contact, divide items not proved."""
        items, unique, rows = items.grouped()
        at = self.middles(unique)
        self.proof.intervals += len(unique.piece)
        asked = self.ask(items, rows, at)
        if self.proof.reason:
            return items.take(_NONE)
        items, near = asked.items, self.bounded(asked, at)
        target = self.target()
        clear = near.margin > target
        self.prove(items, clear, near.margin)
        still = np.flatnonzero(~clear)
        if not len(still):
            return items.take(still)
        halvings = near.halvings(still, target)
        opened = (items.pair[still] >= self.bodies.tree.count) & (halvings > _MOST_OF_HULLS)
        left = items.take(still[~opened]).split(halvings[~opened])
        if opened.any():
            parts, _ = self.open(asked.take(still[opened]), at)
            left = Intervals.join([left, parts])
        return self.limit(left)

    def ask(self, items: Intervals, rows: Index, at: Middles) -> Asked:
        """Query distances in the middles of intervals; nothing of use is returned where bodies touch.

        Pairs of hulls that are too near to tell are opened, and what they stand for is asked.
        """
        answers: list[Asked] = []
        while True:
            placed, enough = self.bodies.place(at.poses, rows, items.pair), max(_HULLS, _ROOM * self.target())
            asked = Asked(items, rows, placed, self.distances.query(items.pair, placed, enough))
            found, several = asked.found, items.pair >= self.bodies.tree.count
            unsure = several & (found.bound <= enough)
            self.see(asked, at, np.flatnonzero(~found.hulls))
            if found.hulls.any():  # what hulls answered is not measured
                self.see(asked, at, np.flatnonzero(found.parts), measure=True)
                self.see(asked, at, np.flatnonzero(found.hulls & ~found.parts & ~unsure), measure=True)
            self.proof.queries += len(found.bound)
            self.proof.gjk_only += int(found.gjk_only.sum())
            if (found.best[~several] <= self.policy.clearance + ROUNDING).any():
                self.stop(items, "bodies touch" if self.policy.clearance <= 0 else "bodies come too near", contact=True)
                return asked
            if not unsure.any():
                return Asked.join([*answers, asked])
            answers.append(asked.take(np.flatnonzero(~unsure)))
            items, rows = self.open(asked.take(np.flatnonzero(unsure)), at)
            if not len(rows):
                return Asked.join(answers)

    def bounded(self, asked: Asked, at: Middles) -> Nearness:
        """Lower bounds of the distances over the intervals.

        Along normals only of those that travel could bring nearer than the nearest pair measured: no more is proved of
        all pairs anyway. A record has them of all.
        """
        query, found = asked.query(at), asked.found
        travel = self.motion.travel(at.joints, query)
        flat = found.bound - travel.total
        nearest = np.inf if self.proof.nearest is None or self.record is not None else self.proof.nearest.distance
        close = np.flatnonzero(~(flat - ROUNDING > nearest))
        along = self.motion.along_normals(at.joints, query, travel, found.normals, close)
        linear, loss = np.full(len(flat), -np.inf), np.zeros(len(flat))
        linear[close], loss[close] = along.linear, along.curvature_loss
        return Nearness(found.bound, travel.total, linear, loss)

    def open(self, asked: Asked, at: Middles) -> tuple[Intervals, Index]:
        """The pairs that pairs of hulls stand for, but those that bounding volumes prove clear, and their intervals."""
        travel = self.motion.travel(at.joints, asked.query(at)).total
        parts = [self.bodies.tree.parts[pair] for pair in asked.items.pair.tolist()]
        parent = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
        inner, rows = replace(asked.items.take(parent), pair=np.concatenate(parts)), asked.rows[parent]
        margin = self.bodies.lower_bound(self.bodies.place(at.poses, rows, inner.pair)) - travel[parent] - ROUNDING
        clear = margin > max(self.target(), self.policy.clearance + _EASY)
        self.prove(inner, clear, margin)
        return inner.take(np.flatnonzero(~clear)), rows[~clear]

    def prove(self, items: Intervals, clear: Flags, margin: Array) -> None:
        """Remember the clearance `margin` (K,), m, proved of the items that are clear."""
        self.keep(margin[clear])
        if self.record is not None:
            proved = items.take(np.flatnonzero(clear))
            begin, end = spans(self.trajectory, proved)
            self.note(begin, end, proved.pair, margin[clear])

    def note(self, begin: Array, end: Array, pairs: Index, clearance: Array) -> None:
        """Record what was proved from `begin` to `end` (K,), s, of the pairs that these (K,) stand for."""
        if self.record is None or not len(pairs):
            return
        members = [self.bodies.tree.members(pair) for pair in pairs.tolist()]
        each = np.repeat(np.arange(len(pairs)), [len(found) for found in members])
        self.record.add(begin[each], end[each], np.concatenate(members), clearance[each])

    def target(self) -> float:
        """Return the clearance to prove, m: that asked for, and most of the smallest distance, which is reported."""
        nearest = self.proof.nearest
        clearance = self.policy.clearance
        return clearance if nearest is None else clearance + _TOLD * max(nearest.distance - clearance, 0.0)

    def limit(self, items: Intervals) -> Intervals:
        """Give up where intervals become shorter than the policy's or the queries too many."""
        if len(items.pair) and items.widths(self.trajectory).min() < self.policy.min_interval:
            return self.stop(items, f"clearance not proved on intervals of {self.policy.min_interval:g} s")
        if self.proof.queries + len(items.pair) > self.policy.max_queries:
            return self.stop(items, f"clearance not proved within {self.policy.max_queries} distance queries")
        return items

    def stop(self, items: Intervals, reason: str, contact: bool = False) -> Intervals:
        """End the search with a reason."""
        self.proof.reason, self.proof.contact = reason, contact
        return items.take(_NONE)

    def keep(self, margins: Array) -> None:
        """Remember the smallest clearance proved."""
        if len(margins):
            self.proof.clearance = min(self.proof.clearance, float(margins.min()))

    def tell(self, chosen: Flags) -> None:
        """Record what bounding volumes proved of these pairs of the blocks, (B, T)."""
        if self.record is None:
            return
        coarse = self.coarse
        rows, pairs = np.nonzero(chosen)
        begin = spans(self.trajectory, coarse.intervals.take(coarse.first[rows]))[0]
        end = spans(self.trajectory, coarse.intervals.take(coarse.last[rows] - 1))[1]
        self.note(begin, end, coarse.pairs[pairs], coarse.margin[rows, pairs])

    def see(self, asked: Asked, at: Middles, among: Index, measure: bool = False) -> None:
        """Remember the smallest distance of these, with its witness; with `measure` those given are lower bounds."""
        known = np.inf if self.proof.nearest is None else self.proof.nearest.distance
        distance = asked.found.best[among]
        if distance.min(initial=np.inf) >= known:
            return
        k = int(among[np.argmin(distance)])
        row = asked.rows[k]
        found = self.distances.witness(at.poses[row], int(asked.items.pair[k]))
        least = found.distance if measure else float(asked.found.best[k])
        if least < known:
            pair = self.model.pairs[found.pair]
            names = pair.name_a, pair.name_b
            self.proof.nearest = Moment(least, float(at.times[row]), names, found.points, at.q[row].copy())
