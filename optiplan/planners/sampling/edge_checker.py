"""Exact collision checking of straight segments for sampling planners."""

from copy import copy
from dataclasses import replace
from functools import cached_property, lru_cache
from itertools import pairwise
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array, Flags
from optiplan.collision.clearance_test import PairMargins
from optiplan.collision.model import CollisionModel
from optiplan.collision.native_model import NativeCollisionModel
from optiplan.geometry.coal_queries import DISTANCE_ERROR
from optiplan.planners.common.gravity import Gravity
from optiplan.robot.robot import Limits

if TYPE_CHECKING:
    from optiplan._core._core_base import EdgeChecker

_FIRST = 0.1  # m; initial subdivision: no pair travels farther within half a part
_MARGIN = 4 * DISTANCE_ERROR  # m; added to the travel of a part
_LEAST = 1e-6  # m of travel; a part not proved free by then counts as blocked
_MOST = 1000  # queries, some 20 ms; a motion that takes more slides along an obstacle and counts as blocked
_HEAVY_STEP = 0.05  # rad or m, largest joint, between gravity checks, whose reserve covers the rest
_SPACING = 0.05  # m; travel of bodies between two configurations of a segment that is not proved, at most
_UNIT, _SHORT_LEVER = 1.5, 0.1  # m; unit of `by_moment_arms`, and least moment arm assumed there


class MotionCheck:
    """Prove straight segments between configurations free: the distance of every pair exceeds its travel.

    Within half a part of the motion, joint j moves by |d_j|. So the bodies of pair p move against each other by at most
    t_p = sum_j moment_arms[p, j] |d_j|. The part is free when every pair is farther apart than t_p in its middle
    (`PairMargins.near`, one query). Else it is cut in two, unless its middle collides. There is no fixed step. With
    `gravity`, configurations in which the motors cannot hold the arm count as blocked too.

    Source: Schwarzer, Saha and Latombe, "Adaptive dynamic collision checking for single and multiple articulated
    robots in complex environments", IEEE T-RO 21(3), 2005. Here each pair has a radius of its own.

    Attributes:
        model: of the robot in its scene.
        limits: of its joints; `moment_arms` hold within the position limits.
        units: (n,) rad or m, scale of a search's coordinates: the way of each joint in a second at full speed.
        native: the same check in the native core; None where the model has none. It checks a part that is cut again
            only for the pairs that are not proved free.
        searched: configuration (n,) of the joints that stand still, and which joints (n,) do not.
        least: s. The native core's searches first draw configurations on motions of this duration between rests, then
            on longer ones; infinite: everywhere.
    """

    def __init__(self, model: CollisionModel, limits: Limits, gravity: Gravity | None = None) -> None:
        self.model, self.limits, self._gravity = model, limits, gravity
        self.units = limits.velocity
        n = len(self.units)
        self.searched: tuple[Array, Flags] = np.zeros(n), np.ones(n, dtype=bool)
        self.least = inf
        self._moment_arms = model.bounds.moment_arms(limits.stroke)
        self.native = _native(model, self._moment_arms, gravity)

    @cached_property
    def _margins(self) -> PairMargins:
        return PairMargins(self.model)

    def blocked(self, q: Array) -> bool:
        """Return whether q (n,) collides or exceeds the torque limits."""
        if self.native is not None:
            return self.native.blocked(np.ascontiguousarray(q))
        return self.model.collides(q) or (self._gravity is not None and self._gravity.too_much(q))

    def free(self, a: Array, b: Array) -> bool:
        """Return whether the segment from a to b (n,) is proved free; `a` known not to be blocked.

        Holds at: every point of the segment; gravity at steps of 0.05 rad or m.
        """
        if self.native is not None:
            return self.native.free(np.ascontiguousarray(a), np.ascontiguousarray(b))
        d = b - a
        return not self.blocked(b) and not self._heavy(a, d) and self._apart(a, d)

    def polyline_free(self, waypoints: Array) -> bool:
        """Return whether every segment between waypoints (k, n) is free."""
        if self.native is not None:
            return self.native.polyline_free(np.ascontiguousarray(self.lift(waypoints)))
        return all(self.free(a, b) for a, b in pairwise(waypoints))

    def lift(self, q: Array) -> Array:
        """Return the robot's configuration (n,) for a configuration of this check."""
        return q

    def by_moment_arms(self) -> "MotionCheck":
        """Return a check in which one unit of a joint moves some point of the robot by up to `_UNIT`.

        A slow joint is far in time and near in space; collisions depend on space.
        """
        twin = copy(self)
        twin.units = _UNIT / np.maximum(self._moment_arms.max(axis=0, initial=0.0), _SHORT_LEVER)
        return twin

    def finer(self) -> "MotionCheck":
        """Return a check in which a unit of each joint, and so the longest step of a tree, is a quarter of that here.

        Narrow passages need short steps.
        """
        twin = copy(self)
        twin.units = 0.25 * self.units
        return twin

    def here_and_there(self) -> "MotionCheck":
        """Return a check of configurations every few centimetres, in a third of the time; or this one.

        What it calls free is a guess for the optimiser, and no motion. There is none without the core, with a tracking
        error or with clearances to keep.
        """
        model = self.model
        plain = isinstance(model, NativeCollisionModel) and model.error is None and model.floors is None
        if self.native is None or not plain:
            return self
        twin = copy(self)
        twin.native = _native(model, self._moment_arms, self._gravity, _SPACING)
        return twin

    def among(self, model: CollisionModel) -> "MotionCheck":
        """Return a check of the same motions, and of the same pairs of bodies, where obstacles have other shapes."""
        twin = copy(self)
        twin.__dict__.pop("_margins", None)
        twin.model, twin.native = model, _native(model, self._moment_arms, self._gravity)
        return twin

    def _heavy(self, a: Array, d: Array) -> bool:
        if self._gravity is None:
            return False
        parts = max(1, int(np.ceil(np.abs(d).max() / _HEAVY_STEP)))
        return any(self._gravity.too_much(a + d * (k / parts)) for k in range(1, parts))

    def _apart(self, a: Array, d: Array) -> bool:
        travel = self._moment_arms @ np.abs(d)  # (P,), along all of the motion
        farthest = float(travel.max(initial=0.0))
        parts = max(1, int(np.ceil(0.5 * farthest / _FIRST)))
        half, queries, middles = 0.5 / parts, 0, _middles(parts)
        while middles:
            queries += len(middles)
            if queries > _MOST or farthest * half < _LEAST < farthest:
                return False
            self._margins.set(travel * half + _MARGIN)
            near = []
            for middle in middles:
                q = a + middle * d
                if self._margins.near(q):
                    if self.model.collides(q):
                        return False
                    near.append(middle)
            half *= 0.5
            middles = tuple(middle + side for middle in near for side in (-half, half))
        return True


class PartialCheck(MotionCheck):
    """Collision checks for some of the joints, within a box, while the others stand still.

    Attributes:
        limits: of those joints, with the box for their position limits.
        still: (n,) where the other joints stand.
    """

    def __init__(
        self,
        whole: MotionCheck,
        still: Array,
        joints: Flags,
        box: tuple[Array, Array],
        least: float = inf,
    ) -> None:
        """Take box (n,), (n,) within the limits; `joints` (n,) says which are searched."""
        limits = whole.limits
        self.model, self.units = whole.model, whole.units[joints]
        searched = limits.of_joints(np.flatnonzero(joints).tolist())
        self.limits = replace(searched, lower=box[0][joints], upper=box[1][joints])
        self.still, self._whole, self._joints = still, whole, joints
        self.native, self.searched, self.least = whole.native, (still, joints), least

    def lift(self, q: Array) -> Array:
        """Return the robot's configuration (n,) with its searched joints at q (m,); of many (k, m): (k, n)."""
        full = np.broadcast_to(self.still, (*q.shape[:-1], len(self.still))).copy()
        full[..., self._joints] = q
        return full

    def blocked(self, q: Array) -> bool:
        """Return whether q (m,) collides or exceeds the torque limits."""
        return self._whole.blocked(self.lift(q))

    def free(self, a: Array, b: Array) -> bool:
        """Return whether the segment from a to b (m,) is proved free; see `MotionCheck.free`."""
        return self._whole.free(self.lift(a), self.lift(b))


def _native(
    model: CollisionModel, moment_arms: Array, gravity: Gravity | None, spacing: float = 0.0
) -> "EdgeChecker | None":
    if not isinstance(model, NativeCollisionModel) or model.world is None:
        return None
    torque = np.zeros(0) if gravity is None or gravity.allowed is None else gravity.allowed
    rules = np.array([_FIRST, _MARGIN, _LEAST, _MOST, _HEAVY_STEP, spacing])
    return core.EdgeChecker(model.world, np.ascontiguousarray(moment_arms), torque, rules)


@lru_cache(maxsize=1024)
def _middles(parts: int) -> tuple[float, ...]:
    """Return middles of equal parts of [0, 1], far apart first: collisions are found sooner in that order."""
    order, spans = [], [(0, parts - 1)]
    for low, high in spans:
        if low <= high:
            middle = (low + high) // 2
            order.append((middle + 0.5) / parts)
            spans += [(low, middle - 1), (middle + 1, high)]
    return tuple(order)
