"""Pairs asked for their distance in the middle of an interval of time, and what follows for all of it."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from optiplan.arrays import Array, Flags, Index
from optiplan.collision.floors import Floors
from optiplan.records import dataclass
from optiplan.robot.batched.kinematics import BatchKinematics
from optiplan.verify.continuous.bodies import PlacedBody
from optiplan.verify.continuous.intervals import Intervals
from optiplan.verify.continuous.motion_bounds import Boxes, Motion, MotionQuery
from optiplan.verify.continuous.pair_tree import PairTree
from optiplan.verify.continuous.separating_planes import Distances
from optiplan.verify.report import VerifyPolicy
from optiplan.verify.tolerances import CLEARANCE_ROUNDING


@dataclass(frozen=True, eq=False)
class Middles:
    """N intervals: `times` (N,), s, of their middles, and `boxes`, bounds of the planned joints' motion there.

    `kinematics` and `motion` are those of the work space. What is made of them is made where it is asked for.
    """

    times: Array
    boxes: Boxes
    kinematics: BatchKinematics
    motion: Motion

    @property
    def q(self) -> Array:
        """Configurations (N, n) in the middles."""
        return self.boxes.q

    @property
    def reach(self) -> Array:
        """How far planned joints get from there, (N, n)."""
        return self.boxes.reach

    @cached_property
    def poses(self) -> Array:
        """Poses of the joints in the middles, (N, J + 1, 4, 4)."""
        return self.kinematics.poses(self.q)

    @cached_property
    def axes(self) -> tuple[Array, Array]:
        """Directions of the joints' axes there, and points on them, each (N, J, 3)."""
        return self.kinematics.axes(self.poses)

    @cached_property
    def joints(self) -> Boxes:
        """Bounds of all joints' motion."""
        return self.motion.of_all_joints(self.boxes)


@dataclass(frozen=True, eq=False)
class DistanceQuery:
    """K items, on which of N intervals each is (K,), where its bodies are in the middle, and their distance there."""

    items: Intervals
    rows: Index
    placed: PlacedBody
    found: Distances

    @classmethod
    def join(cls, parts: "Sequence[DistanceQuery]") -> "DistanceQuery":
        """Concatenate."""
        if len(parts) == 1:
            return parts[0]
        return cls(
            Intervals.join([part.items for part in parts]),
            np.concatenate([part.rows for part in parts]),
            PlacedBody.join([part.placed for part in parts]),
            Distances.join([part.found for part in parts]),
        )

    def take(self, chosen: Index) -> "DistanceQuery":
        """Those at these positions."""
        return DistanceQuery(
            self.items.take(chosen), self.rows[chosen], self.placed.take(chosen), self.found.take(chosen)
        )

    def motion_query(self, at: Middles) -> MotionQuery:
        """What bounds of motion are required of."""
        return MotionQuery(self.rows, self.items.pair, self.placed, *at.axes)


@dataclass(frozen=True, eq=False)
class Nearness:
    """Of K pairs on their intervals, all (K,), m: the gap at the middle, and how much nearer they may come.

    `travel` as of `Travel.total`, the others as of `GapMotion`; -inf and 0 where nobody asked.
    """

    bound: Array
    travel: Array
    linear: Array
    loss: Array
    gap: Array
    step: Array
    any_way: Array

    @cached_property
    def least(self) -> Array:
        """What can be proved of the middles, m, of which joints off their motion take `step` or `any_way`."""
        return np.asarray(np.maximum(self.gap - self.step, self.bound - self.any_way) - CLEARANCE_ROUNDING)

    @cached_property
    def margin(self) -> Array:
        """The clearance proved on the intervals, m."""
        return np.asarray(np.maximum(self.bound - self.travel, self.linear - self.loss) - CLEARANCE_ROUNDING)

    def halvings(self, still: Index, target: Array) -> Index:
        """How often to halve `still` (K,): the least of 1 to 4 times after which scaled bounds reach `target`."""
        parts = 2.0 ** np.arange(1, 4)[:, None]
        bound, step = self.bound[still], self.step[still]
        linear, any_way = np.maximum(self.linear[still], -1e9), self.any_way[still]
        plane = bound + (linear - bound) / parts - (self.loss[still] - step) / parts**2 - step
        near = bound - any_way - (self.travel[still] - any_way) / parts
        enough: Flags = np.maximum(near, plane) > 1.1 * target + CLEARANCE_ROUNDING
        return np.asarray(4 - enough.sum(axis=0), dtype=np.intp)


@dataclass(frozen=True, eq=False)
class AskedClearance:
    """The clearance required of the pairs of a tree: the policy's, or the floor of a pair where that is larger.

    Attributes:
        anywhere: (P + H,) m, wherever the joints are; of hulls the most of the pairs that they stand for.
        least: m, the policy's.
        floors: of the P pairs; None: all have the policy's.
    """

    anywhere: Array
    least: float
    floors: Floors | None

    @classmethod
    def of(cls, tree: PairTree, policy: VerifyPolicy, floors: Floors | None) -> "AskedClearance":
        """Return what is required of the pairs of a tree."""
        if floors is None:
            return cls(np.full(len(tree.pairs), policy.clearance), policy.clearance, None)
        anywhere = np.maximum(tree.most_of_members(floors.asked), policy.clearance)
        return cls(anywhere, policy.clearance, floors)

    @property
    def most(self) -> float:
        """The most that is required of any pair, m."""
        return float(self.anywhere.max(initial=self.least))

    def over(self, pairs: Index, rows: Index, at: Middles) -> Array:
        """Return the most that is required of pairs (K,) anywhere on intervals `rows` (K,), m."""
        return self._of(pairs, rows, at, at.reach)

    def there(self, pairs: Index, rows: Index, at: Middles) -> Array:
        """Return what is required of pairs (K,) in the middles of intervals `rows` (K,), m."""
        return self._of(pairs, rows, at, np.zeros_like(at.reach))

    def _of(self, pairs: Index, rows: Index, at: Middles, reach: Array) -> Array:
        found = self.anywhere[pairs]
        if self.floors is None or not self.floors.at_ends:
            return found
        own = np.flatnonzero(pairs < len(self.floors.asked))
        floors = self.floors.over(pairs[own], at.q[rows[own]], reach[rows[own]])
        found[own] = np.maximum(floors, self.least)
        return found
