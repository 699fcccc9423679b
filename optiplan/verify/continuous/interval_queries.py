"""Pairs asked for their distance in the middle of an interval of time, and what follows for all of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optiplan.arrays import Array, Flags, Index
from optiplan.verify.continuous.bodies import PlacedBody
from optiplan.verify.continuous.intervals import Intervals
from optiplan.verify.continuous.motion_bounds import Boxes, MotionQuery
from optiplan.verify.continuous.separating_planes import Distances
from optiplan.verify.tolerances import CLEARANCE_ROUNDING


@dataclass(frozen=True, eq=False)
class Middles:
    """N intervals: times (N,), s, configurations q (N, n) and poses of the joints (N, J + 1, 4, 4) in their middles.

    Axes of the joints there, `direction` and `point` (N, J, 3), and `joints`, bounds of all joints' motion; `reach`
    (N, n) that of planned joints.
    """

    times: Array
    q: Array
    reach: Array
    poses: Array
    direction: Array
    point: Array
    joints: Boxes


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
        """What bounds of motion are asked of."""
        return MotionQuery(self.rows, self.items.pair, self.placed, at.direction, at.point)


@dataclass(frozen=True, eq=False)
class Nearness:
    """Of K pairs on their intervals, all (K,), m: the gap at the middle, and how much nearer they may come.

    `travel` as of `Travel.total`, `linear`, `loss` and `step` as of `GapMotion`; -inf and 0 where nobody asked.
    """

    bound: Array
    travel: Array
    linear: Array
    loss: Array
    step: Array

    @cached_property
    def least(self) -> Array:
        """What can be proved of the middles, m: the gap there, less `step`."""
        return np.asarray(self.bound - self.step - CLEARANCE_ROUNDING)

    @cached_property
    def margin(self) -> Array:
        """The clearance proved on the intervals, m."""
        return np.asarray(np.maximum(self.bound - self.travel, self.linear - self.loss) - CLEARANCE_ROUNDING)

    def halvings(self, still: Index, target: Array) -> Index:
        """How often to halve `still` (K,): the least of 1 to 4 times after which scaled bounds reach `target`."""
        parts = 2.0 ** np.arange(1, 4)[:, None]
        bound, linear = (self.bound - self.step)[still], np.maximum(self.linear - self.step, -1e9)[still]
        loss, travel = (self.loss - self.step)[still], (self.travel - self.step)[still]
        plane = bound + (linear - bound) / parts - loss / parts**2
        enough: Flags = np.maximum(bound - travel / parts, plane) > 1.1 * target + CLEARANCE_ROUNDING
        return np.asarray(4 - enough.sum(axis=0), dtype=np.intp)
