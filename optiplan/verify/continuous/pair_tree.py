"""Pairs of bodies, and above them pairs of hulls that answer for many of them at once."""

from copy import copy
from functools import cached_property

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Flags, Index
from optiplan.collision.clusters import Cluster, clusters_of
from optiplan.collision.geometry_model import geometry_of
from optiplan.collision.model import CollisionModel
from optiplan.records import dataclass
from optiplan.robot.loaded_robots import once_for_each_robot
from optiplan.robot.robot import Robot
from optiplan.robot.self_collision.pair_bounds import LocalBox, PairBounds, local_box

_FEW = 4
"""Pairs below which asking a hull first saves nothing."""


@dataclass(frozen=True, eq=False)
class ClusterHull:
    """The hull of a cluster as a body of coal, in the frame of its joint, and its bounding volumes."""

    cluster: Cluster
    shape: coal.ConvexBase
    box: LocalBox

    @classmethod
    def of(cls, cluster: Cluster) -> "ClusterHull":
        """Build the body."""
        shape = cluster.hull.build()
        return cls(cluster, shape, local_box(shape))


@once_for_each_robot
def _levels(robot: Robot) -> tuple[tuple[ClusterHull, ...], ...]:
    """Hulls of a robot's clusters, of few bodies first."""
    found = clusters_of(robot)
    return tuple(tuple(map(ClusterHull.of, level)) for level in (found.by_link, found.by_joint))


def hulls_of(robot: Robot) -> tuple[ClusterHull, ...]:
    """The hulls of all clusters of a robot, those of few bodies first."""
    return tuple(hull for level in _levels(robot) for hull in level)


class PairTree:
    """The P pairs of a model, and above them pairs of which one body, or both, is the hull of a cluster.

    A hull holds its bodies, so what keeps away from the hull keeps away from them. Bodies are the G of the model, then
    the hulls.

    Attributes:
        hulls: the bodies behind those of the model.
        pairs: (P + H, 2) bodies of each pair; `count`: P.
        parts: the pairs that each of the H stands for, by its index: of the model, or of hulls of fewer bodies.
        tops: (T,) the pairs that no other one stands for.
    """

    def __init__(self, model: CollisionModel) -> None:
        levels = _levels(model.robot)
        self.hulls = hulls_of(model.robot)
        self.pairs: Index = model.bounds.pairs
        self.count = len(self.pairs)
        self.parts: dict[int, Index] = {}
        self.tops: Index = np.arange(self.count)
        planes = np.array([isinstance(body.geometry, coal.Halfspace) for body in model.geometry.geometryObjects], bool)
        self._plane: Flags = np.append(planes, np.zeros(len(self.hulls), dtype=bool))
        above: Index = np.arange(len(self._plane))
        first = len(planes)
        for level in levels:
            for hull in level:
                members = list(hull.cluster.bodies)
                above[above[members]] = above[members] = first  # hulls of fewer bodies, too
                first += 1
            self._gather(above)
        self._own, self._bodies = model.bounds, model.geometry

    def with_obstacles_of(self, model: CollisionModel) -> "PairTree":
        """Return the same of a model in which obstacles stand elsewhere."""
        twin = copy(self)
        twin.__dict__.pop("bounds", None)
        twin._own, twin._bodies = model.bounds, model.geometry
        return twin

    def _gather(self, above: Index) -> None:
        """Put pairs of hulls, which `above` names of each body, above those of `tops` of which they hold several."""
        pairs = self.pairs[self.tops]
        held = above[pairs]
        # A half-space is told from any body by a formula.
        apart = (held != pairs).any(axis=1) & (held[:, 0] != held[:, 1]) & ~self._plane[pairs].any(axis=1)
        key = np.where(apart, held[:, 0] * len(above) + held[:, 1], -1)
        order = np.argsort(key, kind="stable")
        ordered = key[order]
        first = np.flatnonzero(np.diff(ordered, prepend=-2))  # of each run of the same hulls
        last = np.append(first[1:], len(order))
        worth = np.flatnonzero((ordered[first] >= 0) & self._worth(self.tops[order], first, last - first))
        if not len(worth):
            return
        found = [order[first[run] : last[run]] for run in worth.tolist()]
        fresh = len(self.pairs) + np.arange(len(found))
        self.parts |= {int(index): self.tops[run] for index, run in zip(fresh, found, strict=True)}
        self.pairs = np.vstack([self.pairs, held[order[first[worth]]]])
        self.tops = np.concatenate([np.delete(self.tops, np.concatenate(found)), fresh])

    def _worth(self, pairs: Index, first: Index, count: Index) -> Flags:
        """Whether asking a hull for runs of `pairs` saves queries: they are several, or there are hulls among them.

        Runs begin at `first` and are `count` long, (R,) each; so is the result.
        """
        hulls = np.maximum.reduceat(pairs, first) >= self.count if len(pairs) else np.zeros(0, dtype=bool)
        return np.asarray((count >= _FEW) | ((count > 1) & hulls))

    def members(self, pair: int) -> Index:
        """The pairs of the model that a pair stands for; itself where it is one of them."""
        if pair < self.count:
            return np.array([pair], dtype=np.intp)
        return np.concatenate([self.members(part) for part in self.parts[pair].tolist()])

    def most_of_members(self, values: Array) -> Array:
        """Return values (P,) of the pairs, and of those of hulls the largest of their members, (P + H,)."""
        hulls = [values[self.members(pair)].max(initial=0.0) for pair in range(self.count, len(self.pairs))]
        return np.concatenate([values, hulls])

    @cached_property
    def bounds(self) -> PairBounds:
        """Bounding volumes of `tops`; made for the first proof that asks for them: planes prove most motions."""
        if not self.parts:
            return self._own
        own, first = self._own, len(self._bodies.geometryObjects)
        used, which = np.unique(self.pairs[self.tops], return_inverse=True)
        bodies, boxes = [], []
        for k in used.tolist():
            if k < first:
                bodies.append(self._bodies.geometryObjects[k])
                boxes.append(LocalBox(own.centre[k], own.half[k], float(own.radius[k])))
            else:
                hull = self.hulls[k - first]
                bodies.append(pin.GeometryObject(f"hull {k}", hull.cluster.joint, 0, pin.SE3.Identity(), hull.shape))
                boxes.append(hull.box)
        return PairBounds(own.kinematics, geometry_of(bodies), which.reshape(-1, 2), boxes)
