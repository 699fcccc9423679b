"""Certificate: a proof that no two bodies touch at any time, or the time and place where it fails."""

from dataclasses import replace

import numpy as np

from optiplan.arrays import Array, Flags, Index
from optiplan.collision.floors import Floors
from optiplan.collision.model import CollisionModel
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.clearance_record import ClearanceRecord
from optiplan.verify.continuous.interval_queries import AskedClearance, DistanceQuery, Middles, Nearness
from optiplan.verify.continuous.intervals import MOST_AT_ONCE, IntervalBlocks, Intervals, blocks, spans
from optiplan.verify.continuous.motion_tools import too_large, tools_of
from optiplan.verify.continuous.proof import Moment, Proof, least_of_kinds
from optiplan.verify.planes.plane_search import FAR
from optiplan.verify.planes.search_state import SearchState
from optiplan.verify.report import VerifyPolicy
from optiplan.verify.tolerances import CLEARANCE_ROUNDING

_EASY = 5e-3  # m, margin by which bounding volumes must clear a pair at first
_HULLS = 5e-3  # m: where hulls are proved farther apart, meshes are not queried
_ROOM = 1.25  # factor on the clearance to prove, below which meshes are queried instead of hulls
_MOST_OF_HULLS = 2  # halvings of an interval for hulls of clusters; else the bodies in them are queried
_MOST_AGAIN = 4_000  # items examined to refine the clearance after the proof
_FIRST_TRAVEL = 0.2  # rad or m, summed over joints: travel within the first intervals
_MOST_HALVINGS = 12  # of a piece before the first query
_MOST_FIRST = 100_000_000  # pairs on the first intervals beyond one a piece, of 100 pairs at least, to bound memory
_NONE = np.empty(0, dtype=np.intp)
_CHUNK = 256  # blocks of intervals bounded by volumes at a time, to bound memory


def certify(
    model: CollisionModel,
    trajectory: Trajectory,
    policy: VerifyPolicy,
    record: ClearanceRecord | None = None,
    error: Array | None = None,
    floors: Floors | None = None,
) -> Proof:
    """Prove that all pairs stay apart for all t in [0, duration].

    With an `error` (n,), rad or m, that is proved of every configuration in the tube |q_j - q_j(t)| <= error_j. With
    `floors` the clearance asked of a pair is the larger of the policy's and its floor: on an interval, the most that
    the floor is at any configuration of it.

    On an interval with middle m and half width h, where a plane with normal w separates a pair by the gap g at m, the
    pair is clear if the larger of two lower bounds of its distance exceeds the clearance asked for by 1e-9 m:
        g - travel              how far the bodies can move in any direction;
        linear - curvature_loss the gap along w to first order in time, less what acceleration can take from it,
    see `motion_bounds.Motion`. Where that fails the interval is divided for this pair alone. Bounding volumes
    answer most pairs, `kept_clearance` those of neighbours, exact queries confirmed by separating planes the rest. Of
    the robot's own pairs and of those with obstacles most of the smallest distance of the kind is proved.

    A `record` is filled with what was proved of which pair and when; its least is the proof's `clearance`. The proof is
    the same without one.

    Holds at: all times of the closed interval [0, duration].
    """
    off = np.zeros(trajectory.n) if error is None else error
    asked = AskedClearance.of(tools_of(model).bodies.tree, policy, floors)
    search = _Search(model, trajectory, policy, off, asked)
    search.refuse_at_once()
    if search.proof.reason:
        return search.proof
    intervals = search.first_intervals()
    if search.proof.reason:
        return search.proof
    left = search.by_planes(intervals)
    if left is None:
        return search.in_full(intervals, record)
    search.work_off(left)
    if search.proof.reason:
        return search.proof
    search.measure_tightest()
    proof = replace(search.proof, proved=True)
    if record is None:
        return proof
    recorded = _Search(model, trajectory, policy, off, asked).in_full(intervals, record)
    if not recorded.proved:
        return recorded
    record.agree(proof.least, search.kinds)
    return proof


@dataclass(eq=False)
class _Search(SearchState):
    """Branch and bound over intervals: `advance` processes many open items and returns those still open, divided."""

    def in_full(self, intervals: Intervals, record: ClearanceRecord | None) -> Proof:
        """Return the proof by volumes and queries, pair by pair; a `record` is filled."""
        self.record = record
        self.work_off(self.bounded_by_volumes(intervals))
        if self.proof.reason:
            return self.proof
        self.measure_tightest()
        rough = np.minimum(self.proof.least, self.coarse.least(self.kinds))
        proved = replace(self.proof, proved=True, least=rough)
        known = None if record is None else len(record)
        self.work_off(self.intervals_to_refine())
        if not self.proof.reason:
            return replace(self.proof, proved=True)
        if record is not None:
            record.cut(known)
            self.record_blocks(self.coarse.near)
        return proved

    def refuse_at_once(self) -> None:
        """Refuse at once what cannot be proved: huge numbers, bodies without bounds, bodies inside a mesh."""
        self.proof.reason = too_large(self.trajectory, self.bodies, self.model.names)
        if self.proof.reason:
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
            self.proof = Proof(False, "one body lies inside the other", contact=True)
            self.proof.meet(self.kinds[found.pair], where)

    def first_intervals(self) -> Intervals:
        """Return intervals on which joints move little; with a reason to stop where they would be too many."""
        intervals = Intervals.whole(len(self.trajectory.coefficients))
        most = len(intervals.piece) + _MOST_FIRST // max(len(self.bodies.tree.tops), 100)
        b = self.boxes(intervals)
        while True:
            halvings = np.ceil(np.log2(np.maximum((b.reach - b.jump).sum(axis=1) / _FIRST_TRAVEL, 1.0)))
            halvings = np.minimum(halvings, _MOST_HALVINGS - intervals.level)
            if not halvings.any():
                break
            if (2.0**halvings).sum() > most:
                return self.stop(intervals, f"clearance not proved: the joints travel too far for {most} intervals")
            intervals = intervals.split(halvings.astype(np.intp))
            b = self.boxes(intervals)
        self.proof.intervals = len(intervals.piece)
        return intervals

    def bounded_by_volumes(self, intervals: Intervals) -> Intervals:
        """Return the intervals with the pairs that bounding volumes leave open there.

        Neighbouring intervals are looked at together where they are short.
        """
        b = self.boxes(intervals)
        first, last = blocks((b.reach - b.jump).sum(axis=1), _FIRST_TRAVEL)
        low, high = np.minimum.reduceat(b.q - b.reach, first), np.maximum.reduceat(b.q + b.reach, first)
        tree, margins, asked = self.bodies.tree, [], self.asked.anywhere[self.bodies.tree.tops]
        for k in range(0, len(first), _CHUNK):
            Q, D = 0.5 * (low + high)[k : k + _CHUNK], 0.5 * (high - low)[k : k + _CHUNK] + 1e-15
            margins.append(tree.bounds.apart(Q, D, self.asked.most + FAR + CLEARANCE_ROUNDING) - CLEARANCE_ROUNDING)
        margin = np.concatenate(margins)
        clear, far = margin > asked + _EASY, margin > asked + FAR
        self.lower_clearance(margin[far], tree.tops[np.nonzero(far)[1]])
        self.coarse = IntervalBlocks(tree.tops, intervals, first, last, clear & ~far, margin)
        self.record_blocks(far)
        return self.coarse.members(~clear)

    def intervals_to_refine(self) -> Intervals:
        """Intervals on which bounding volumes prove less than is worth telling, unless they are too many."""
        coarse, nothing = self.coarse, np.zeros_like(self.coarse.near)
        targets = self.target(coarse.pairs)
        measured = np.array([met is not None for met in self.proof.met])[self.kinds[coarse.pairs]]
        chosen = coarse.near & (coarse.margin <= targets) & measured
        items = coarse.members(chosen)
        if len(items.pair) > _MOST_AGAIN:
            chosen, items = nothing, coarse.members(nothing)
        left = coarse.near & ~chosen
        self.lower_clearance(coarse.margin[left], coarse.pairs[np.nonzero(left)[1]])
        self.record_blocks(left)
        return items

    def work_off(self, items: Intervals) -> None:
        """Process these items and their parts until none is open or there is a reason to stop."""
        while len(items.pair) and not self.proof.reason:
            if len(items.pair) <= MOST_AT_ONCE:
                items = self.advance(items)
                continue
            head, tail = np.split(np.arange(len(items.pair)), [MOST_AT_ONCE])
            items = Intervals.join([self.advance(items.take(head)), items.take(tail)])

    def advance(self, items: Intervals) -> Intervals:
        """Query the exact distance of every item; stop at a contact, divide items not proved."""
        items, unique, rows = items.grouped()
        at = self.middles(unique)
        self.proof.intervals += len(unique.piece)
        items, rows = self.without_kept(items, rows, at)
        if not len(rows):
            return items
        query = self.query(items, rows, at)
        if self.proof.reason or not len(query.rows):
            return items.take(_NONE)
        items, near = query.items, self.bounded(query, at)
        if self.error.any() and self.leaves_no_room(query, near, at):
            return items.take(_NONE)
        target = np.maximum(self.target(items.pair), self.asked.over(items.pair, query.rows, at))
        clear = near.margin > target
        self.prove(items, clear, near.margin)
        still = np.flatnonzero(~clear)
        if not len(still):
            return items.take(still)
        halvings = near.halvings(still, target[still])
        opened = (items.pair[still] >= self.bodies.tree.count) & (halvings > _MOST_OF_HULLS)
        left = items.take(still[~opened]).split(halvings[~opened])
        if opened.any():
            parts, _ = self.expand_hulls(query.take(still[opened]), at)
            left = Intervals.join([left, parts])
        return self.limit(left)

    def query(self, items: Intervals, rows: Index, at: Middles) -> DistanceQuery:
        """Query distances in the middles of intervals; nothing of use is returned where bodies touch.

        Pairs of hulls that are too near to decide are expanded into the pairs of bodies that they hold.
        """
        answers: list[DistanceQuery] = []
        while True:
            placed = self.bodies.place(at.poses, rows, items.pair)
            wanted = np.maximum(self.target(items.pair), self.asked.anywhere[items.pair])
            enough = np.maximum(_HULLS, _ROOM * wanted) + self.tubes[items.pair]
            query = DistanceQuery(items, rows, placed, self.distances.query(items.pair, placed, enough))
            found, several = query.found, items.pair >= self.bodies.tree.count
            unsure = several & (found.bound <= enough)
            self.update_nearest(query, at, np.flatnonzero(~found.hulls))
            if found.hulls.any():  # what hulls answered is not measured
                self.update_nearest(query, at, np.flatnonzero(found.parts), measure=True)
                self.update_nearest(query, at, np.flatnonzero(found.hulls & ~found.parts & ~unsure), measure=True)
            self.proof.queries += len(found.bound)
            self.proof.gjk_only += int(found.gjk_only.sum())
            asked = self.asked.there(items.pair, rows, at)
            too_near = np.flatnonzero(~several & (found.best <= asked + CLEARANCE_ROUNDING))
            if len(too_near):
                self.stop_too_near(query, at, too_near, asked)
                return query
            if not unsure.any():
                return DistanceQuery.join([*answers, query])
            answers.append(query.take(np.flatnonzero(~unsure)))
            items, rows = self.without_kept(*self.expand_hulls(query.take(np.flatnonzero(unsure)), at), at)
            if not len(rows):
                return DistanceQuery.join(answers)

    def bounded(self, query: DistanceQuery, at: Middles) -> Nearness:
        """Lower bounds of the distances over the intervals.

        Along normals only of those that travel could bring nearer than the nearest pair measured: no more is proved of
        all pairs anyway. A record has them of all.
        """
        moving, found = query.motion_query(at), query.found
        travel = self.motion.travel(at.joints, moving)
        flat = found.bound - travel.total
        nearest = self.nearest_measured(query.items.pair) if self.record is None else np.full(len(flat), np.inf)
        close = np.flatnonzero(~(flat - CLEARANCE_ROUNDING > nearest))
        along = self.motion.along_normals(at.joints, moving, travel, found.normals, close)
        linear, gap = np.full((2, len(flat)), -np.inf)
        loss, step, any_way = np.zeros((3, len(flat)))
        linear[close], loss[close], gap[close] = along.linear, along.loss, along.gap
        step[close], any_way[close] = along.step, along.any_way
        return Nearness(found.bound, travel.total, linear, loss, gap, step, any_way)

    def leaves_no_room(self, query: DistanceQuery, near: Nearness, at: Middles) -> bool:
        """Stop where the tracking error takes what is between two bodies, which no shorter interval can prove."""
        own = np.flatnonzero(query.items.pair < self.bodies.tree.count)
        if not len(own):
            return False
        self.provable = np.minimum(self.provable, least_of_kinds(near.least[own], self.kinds[query.items.pair[own]]))
        left = near.least[own] - self.asked.there(query.items.pair[own], query.rows[own], at)
        if left.min() > 0.0:
            return False
        self.proof.met = (None, None)  # named is the pair that is too near for its tube, not the nearest
        k = own[np.argmin(left)]
        self.update_nearest(query, at, np.array([k]), measure=True)
        taken = 1e3 * (near.bound[k] - near.least[k])
        self.stop(query.items, f"the tracking error takes {taken:.3g} mm of the distance")
        return True

    def expand_hulls(self, query: DistanceQuery, at: Middles) -> tuple[Intervals, Index]:
        """Return the pairs of bodies of these pairs of hulls, without those that bounding volumes prove clear.

        With them: the rows of their intervals among the middles.
        """
        travel = self.motion.travel(at.joints, query.motion_query(at)).total
        parts = [self.bodies.tree.parts[pair] for pair in query.items.pair.tolist()]
        parent = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
        inner, rows = replace(query.items.take(parent), pair=np.concatenate(parts)), query.rows[parent]
        margin = (
            self.bodies.lower_bound(self.bodies.place(at.poses, rows, inner.pair)) - travel[parent] - CLEARANCE_ROUNDING
        )
        clear = margin > np.maximum(self.target(inner.pair), self.asked.anywhere[inner.pair] + _EASY)
        self.prove(inner, clear, margin)
        return inner.take(np.flatnonzero(~clear)), rows[~clear]

    def limit(self, items: Intervals) -> Intervals:
        """Give up where intervals become shorter than the policy's or the queries too many."""
        if len(items.pair) and items.widths(self.trajectory).min() < self.policy.min_interval:
            return self.stop(items, f"clearance not proved on intervals of {self.policy.min_interval:g} s")
        if self.proof.queries + len(items.pair) > self.policy.max_queries:
            return self.stop(items, f"clearance not proved within {self.policy.max_queries} distance queries")
        return items

    def stop_too_near(self, query: DistanceQuery, at: Middles, found: Index, asked: Array) -> None:
        """End the search at the pair that lacks most of what is asked of it, (K,) m; `found` are too near."""
        if self.asked.floors is None:
            self.stop(query.items, "bodies touch" if self.policy.clearance <= 0 else "bodies come too near", True)
            return
        k = found[np.argmin(query.found.best[found] - asked[found])]
        self.proof.met = (None, None)  # named is the pair that is too near for its floor, not the nearest
        self.update_nearest(query, at, np.array([k]))
        self.stop(query.items, f"bodies come nearer than the {1e3 * asked[k]:.3g} mm required of them", True)

    def record_blocks(self, chosen: Flags) -> None:
        """Record what bounding volumes proved of these pairs of the blocks, (B, T)."""
        if self.record is None:
            return
        coarse = self.coarse
        rows, pairs = np.nonzero(chosen)
        begin = spans(self.trajectory, coarse.intervals.take(coarse.first[rows]))[0]
        end = spans(self.trajectory, coarse.intervals.take(coarse.last[rows] - 1))[1]
        self.record_pairs(begin, end, coarse.pairs[pairs], coarse.margin[rows, pairs])
