"""The state of a search for a proof: what it works with, what was met and what is proved so far."""

from dataclasses import field

import numpy as np

from optiplan.arrays import Array, Flags, Index, distinct
from optiplan.collision.model import CollisionModel
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.clearance_record import ClearanceRecord
from optiplan.verify.continuous.interval_queries import AskedClearance, DistanceQuery, Middles
from optiplan.verify.continuous.intervals import MOST_AT_ONCE, Intervals, boxes, middles, spans, step_sizes
from optiplan.verify.continuous.motion_bounds import Boxes
from optiplan.verify.continuous.motion_tools import tools_of
from optiplan.verify.continuous.proof import SCENE, SELF, Moment, Proof, least_of_kinds
from optiplan.verify.planes.plane_search import PROVED_SHARE, Gap, plane_search
from optiplan.verify.report import VerifyPolicy
from optiplan.verify.tolerances import CLEARANCE_ROUNDING


@dataclass(eq=False)
class SearchState:
    """What a search for a proof works with, and its books."""

    model: CollisionModel
    trajectory: Trajectory
    policy: VerifyPolicy
    error: Array
    asked: AskedClearance
    record: ClearanceRecord | None = None
    proof: Proof = field(default_factory=lambda: Proof(False))

    def __post_init__(self) -> None:
        tools = tools_of(self.model)
        self.bodies, self.distances, self.motion = tools.bodies, tools.distances, tools.motion
        self.kinds, self.kept = tools.kinds, tools.kept
        self.is_kept = np.zeros(len(self.kinds), dtype=bool)
        self.is_kept[list(self.kept)] = True
        self.tightest: tuple[float, int, Array, float] | None = None  # clearance, pair, q and time
        self.jump = step_sizes(self.trajectory, self.policy.jump_tolerance) + self.error
        self.tubes = self.tube_bounds()
        self.provable = np.full(2, np.inf)  # the most that can be proved of either kind, as far as was queried

    def tube_bounds(self) -> Array:
        """Bound, m, on what joints that are off the motion by `error` take of the distance of each pair, (P + H,).

        Of hulls it is that of the farthest of their bodies.
        """
        if not self.error.any():
            return np.zeros(len(self.bodies.tree.pairs))
        stroke = np.abs(self.trajectory.extrema(0)).max(axis=0) + self.error
        return self.bodies.tree.most_of_members(self.model.bounds.moment_arms(stroke) @ self.error)

    def boxes(self, items: Intervals) -> Boxes:
        """Return bounds of the joints' motion on these intervals."""
        return boxes(self.trajectory, items, self.jump)

    def middles(self, intervals: Intervals) -> Middles:
        """Return where the joints are in the middles of these intervals, and bounds of their motion there."""
        times = middles(self.trajectory, intervals)
        return Middles(times, self.boxes(intervals), self.bodies.kinematics, self.motion)

    def by_planes(self, intervals: Intervals) -> Intervals | None:
        """Prove in the core what planes can; the items left, None where it takes no part or bodies touch."""
        tools = tools_of(self.model)
        planes = plane_search(self.model, tools)
        if planes is None or self.error.any() or self.asked.floors is not None:
            return None
        tops = self.bodies.tree.tops
        kept = tops[self.is_kept[tops]]
        some = self.left_of_kept(intervals, kept)
        asked = planes.begin(self.trajectory, self.jump, intervals, tops[~self.is_kept[tops]], some)
        met = None if asked is None else asked.nearest(self.policy.clearance)
        if asked is None or met is None:
            return None
        self.measure(met)
        cap = np.array([np.inf if self.tightest is None else self.tightest[0], np.inf])
        found = asked.prove(self.policy, cap, self.proof.measured(np.inf))
        if found is None:
            return None
        self.proof.least = np.minimum(self.proof.least, found.least)
        self.proof.intervals += found.intervals
        self.proof.queries += found.queries
        self.measure([gap for gap in found.nearest if gap[2] >= 0])
        return found.left

    def left_of_kept(self, intervals: Intervals, kept: Index) -> tuple[Index, Index]:
        """Return on which intervals (K,) which of these pairs (K,) are not proved by what is kept of them."""
        rows, pairs = [np.empty(0, dtype=np.intp)], [kept[:0]]
        for first in range(0, len(intervals.piece) if len(kept) else 0, MOST_AT_ONCE):
            own = intervals.take(np.arange(first, min(first + MOST_AT_ONCE, len(intervals.piece))))
            each = np.repeat(np.arange(len(own.piece)), len(kept))
            left, each = self.without_kept(own.each_with(kept), each, self.middles(own))
            rows.append(first + each)
            pairs.append(left.pair)
        return np.concatenate(rows), np.concatenate(pairs)

    def prove(self, items: Intervals, clear: Flags, margin: Array) -> None:
        """Remember the clearance `margin` (K,), m, proved of the items that are clear."""
        self.lower_clearance(margin[clear], items.pair[clear])
        if self.record is not None:
            proved = items.take(np.flatnonzero(clear))
            begin, end = spans(self.trajectory, proved)
            self.record_pairs(begin, end, proved.pair, margin[clear])

    def record_pairs(self, begin: Array, end: Array, pairs: Index, clearance: Array) -> None:
        """Record what was proved from `begin` to `end` (K,), s, of the pairs that these (K,) stand for."""
        if self.record is None or not len(pairs):
            return
        members = [self.bodies.tree.members(pair) for pair in pairs.tolist()]
        each = np.repeat(np.arange(len(pairs)), [len(found) for found in members])
        self.record.add(begin[each], end[each], np.concatenate(members), clearance[each])

    def without_kept(self, items: Intervals, rows: Index, at: Middles) -> tuple[Intervals, Index]:
        """Return the items of which what is kept does not prove the clearance asked for."""
        clear: Flags = np.zeros(len(rows), dtype=bool)
        found = self.is_kept[items.pair]
        for pair in distinct(items.pair[found]).tolist():
            own = np.flatnonzero(items.pair == pair)
            least = self.kept[pair].least(at.q[rows[own]], at.reach[rows[own]])
            proved = least > self.asked.over(items.pair[own], rows[own], at) + CLEARANCE_ROUNDING
            clear[own[proved]] = True
            if not proved.any():
                continue
            self.proof.kept |= {pair}
            self.prove(items.take(own), proved, least)
            k = int(np.where(proved, least, np.inf).argmin())
            if self.tightest is None or least[k] < self.tightest[0]:
                row = rows[own[k]]
                self.tightest = float(least[k]), pair, at.q[row].copy(), float(at.times[row])
        left = np.flatnonzero(~clear)
        return items.take(left), rows[left]

    def measure_tightest(self) -> None:
        """Measure the pair with the least of the kept clearances, where it has it."""
        if self.tightest is None:
            return
        _, pair, q, time = self.tightest
        found = self.distances.witness(self.bodies.kinematics.poses(q[None])[0], pair)
        self.proof.queries += 1
        names = self.model.pairs[pair].name_a, self.model.pairs[pair].name_b
        self.proof.meet(self.kinds[pair], Moment(found.distance, time, names, found.points, q))

    def measure(self, gaps: list[Gap]) -> None:
        """Measure pairs where planes found them nearest."""
        if not gaps:
            return
        Q = self.trajectory(np.array([time for _, time, _ in gaps]))
        for (gap, time, pair), q, poses in zip(gaps, Q, self.bodies.kinematics.poses(Q), strict=True):
            if gap >= self.proof.measured(np.inf)[self.kinds[pair]]:
                continue
            self.proof.queries += 1
            found = self.distances.witness(poses, pair)
            names = self.model.pairs[found.pair].name_a, self.model.pairs[found.pair].name_b
            self.proof.meet(self.kinds[pair], Moment(found.distance, time, names, found.points, q))

    def nearest_measured(self, pairs: Index) -> Array:
        """Return the smallest distance measured of the kind of each pair, (K,) m; inf where none is."""
        return np.asarray(self.proof.measured(np.inf)[self.kinds[pairs]])

    def target(self, pairs: Index) -> Array:
        """Return the clearance to tell of, (K,) m: the policy's, and most of the smallest distance of the pairs' kind.

        Of the robot's own pairs no more is proved than what is kept of the tightest of them: their least is reported.
        """
        asked = self.policy.clearance
        least = self.proof.measured(asked)
        if self.error.any():
            least = np.minimum(least, np.where(np.isfinite(self.provable), self.provable, asked))
        target = asked + PROVED_SHARE * np.maximum(least - asked, 0.0)
        if self.tightest is not None:
            target[SELF] = min(target[SELF], self.tightest[0])
        return np.asarray(target[self.kinds[pairs]])

    def stop(self, items: Intervals, reason: str, contact: bool = False) -> Intervals:
        """End the search with a reason."""
        self.proof.reason, self.proof.contact = reason, contact
        return items.take(np.empty(0, dtype=np.intp))

    def lower_clearance(self, margins: Array, pairs: Index) -> None:
        """Remember the smallest clearance proved of each kind, of these pairs."""
        if len(margins):
            self.proof.least = np.minimum(self.proof.least, least_of_kinds(margins, self.kinds[pairs]))

    def update_nearest(self, query: DistanceQuery, at: Middles, among: Index, measure: bool = False) -> None:
        """Remember the smallest distances of these, with witnesses; with `measure` those given are lower bounds."""
        for kind in (SELF, SCENE):
            self.update_nearest_of_kind(query, at, among[self.kinds[query.items.pair[among]] == kind], measure)

    def update_nearest_of_kind(self, query: DistanceQuery, at: Middles, among: Index, measure: bool) -> None:
        """Remember the smallest distance of these, which are of one kind."""
        distance = query.found.best[among]
        if not len(among) or distance.min() >= self.nearest_measured(query.items.pair[among[:1]])[0]:
            return
        k = int(among[np.argmin(distance)])
        row = query.rows[k]
        found = self.distances.witness(at.poses[row], int(query.items.pair[k]))
        least = found.distance if measure else float(query.found.best[k])
        pair = self.model.pairs[found.pair]
        names = pair.name_a, pair.name_b
        met = Moment(least, float(at.times[row]), names, found.points, at.q[row].copy())
        self.proof.meet(self.kinds[found.pair], met)
