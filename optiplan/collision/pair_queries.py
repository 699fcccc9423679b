"""Distances of pairs of bodies by coal, and their bounds by hulls in the place of meshes."""

from functools import cached_property

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Index, distinct
from optiplan.geometry.coal_queries import DISTANCE_ERROR, exact_collision_request, exact_distance_request, make_exact
from optiplan.geometry.convex import hull_of_mesh

MANY = 2000
"""Pairs above which no query covers all pairs at once: a solver of pinocchio takes 7 kB and 7 µs a pair."""

HULL_DISTANCE_ENOUGH = 0.01
"""m; of bodies whose hulls are farther apart, the hulls' distance, a lower bound, is enough.

Twice the clearance that planners aim at, so that planners keep away from the mesh and not from its hull.
"""

_HULL_MARGIN = 2 * DISTANCE_ERROR
"""m; subtracted from a distance of hulls, so that it is a lower bound."""


class PairQueries:
    """Queries of the pairs of a geometry model; one object a thread.

    Coal itself answers queries of single pairs. pinocchio's solvers of all pairs are made at the first query of all:
    loading a problem queries some fifty of the 1,500 pairs of an arm with a gripper.

    Args:
        model: the joints that carry the bodies.
        geometry: bodies and pairs.
    """

    def __init__(self, model: pin.Model, geometry: pin.GeometryModel) -> None:
        self._model, self._geometry = model, geometry
        bodies = geometry.geometryObjects
        self._shapes = [body.geometry for body in bodies]
        self._placements = [pin.SE3(body.placement) for body in bodies]
        self._joints_of = [body.parentJoint for body in bodies]
        self._joints: list[pin.SE3] = []
        self._distance_request, self._collision_request = exact_distance_request(), exact_collision_request()
        self._transforms: dict[int, coal.Transform3s] = {}
        self.many = len(geometry.collisionPairs) > MANY

    def place(self, joints: pin.Data) -> None:
        """Move the bodies to where the joints are in `joints`."""
        self._joints = [pin.SE3(pose) for pose in joints.oMi]
        self._transforms.clear()

    def poses(self) -> Array:
        """Return the poses X_WB (B, 4, 4) of all bodies where `place` put them."""
        X_WJ = np.array([pose.homogeneous for pose in self._joints])
        return np.asarray(X_WJ[self._joints_of] @ self._X_JB)

    def distance(self, pair: int) -> coal.DistanceResult:
        """Return the nearest points of a pair where `place` put the bodies."""
        found = self._geometry.collisionPairs[pair]
        a, b, result = found.first, found.second, coal.DistanceResult()
        X_WA, X_WB = self._transform(a), self._transform(b)
        coal.distance(self._shapes[a], X_WA, self._shapes[b], X_WB, self._distance_request, result)
        return result

    def touches(self, pair: int) -> bool:
        """Return whether a pair touches where `place` put the bodies."""
        found = self._geometry.collisionPairs[pair]
        a, b, result = found.first, found.second, coal.CollisionResult()
        X_WA, X_WB = self._transform(a), self._transform(b)
        return bool(coal.collide(self._shapes[a], X_WA, self._shapes[b], X_WB, self._collision_request, result))

    def any_touch(self, joints: pin.Data, q: Array) -> bool:
        """Return whether any pair touches at q (n,), by the broad phase; moves `joints`. Only without `many` pairs."""
        return bool(pin.computeCollisions(self._model, joints, self._broad_phase, q, True))

    def nearest(self, joints: pin.Data, q: Array) -> tuple[int, coal.DistanceResult]:
        """Return the nearest pair at q (n,), and its nearest points; moves `joints`. Only without `many` pairs."""
        pair = int(pin.computeDistances(self._model, joints, self._geometry, self._solvers, q))
        return pair, self._solvers.distanceResults[pair]

    @cached_property
    def _X_JB(self) -> Array:
        return np.array([pose.homogeneous for pose in self._placements]).reshape(-1, 4, 4)

    @cached_property
    def _solvers(self) -> pin.GeometryData:
        data = self._geometry.createData()
        make_exact(data)
        return data

    @cached_property
    def _broad_phase(self) -> pin.BroadPhaseManager_DynamicAABBTreeCollisionManager:
        return pin.BroadPhaseManager_DynamicAABBTreeCollisionManager(self._model, self._geometry, self._solvers)

    def _transform(self, body: int) -> coal.Transform3s:
        if body not in self._transforms:
            pose = self._joints[self._joints_of[body]] * self._placements[body]
            self._transforms[body] = coal.Transform3s(pose.rotation, pose.translation)
        return self._transforms[body]


class Outline:
    """The bodies with hulls in the place of meshes: their distances are lower bounds of the true ones.

    Attributes:
        geometry: the bodies, in the order of the original ones.
        pairs: indices of the pairs with a mesh that is not bounded by a half-space.
    """

    def __init__(self, model: pin.Model, geometry: pin.GeometryModel, pairs: Index) -> None:
        """Take the bodies and pairs (P, 2) of `geometry`, which is not copied if no pair has a mesh."""
        self._model = model
        meshes, planes = (
            np.array([isinstance(body.geometry, kind) for body in geometry.geometryObjects], dtype=bool)
            for kind in (coal.BVHModelBase, coal.Halfspace)
        )
        asked = np.flatnonzero(meshes[pairs].any(axis=1) & ~planes[pairs].any(axis=1))
        self.pairs = frozenset(asked.tolist())
        self.geometry = geometry.copy() if len(asked) else geometry
        bodies = distinct(pairs[asked])
        for body in bodies[meshes[bodies]].tolist():
            item = self.geometry.geometryObjects[body]
            item.geometry = hull_of_mesh(item.geometry)

    def with_own_queries(self) -> "Outline":
        """Return the same hulls with a separate work space."""
        twin = Outline.__new__(Outline)
        twin._model, twin.geometry, twin.pairs = self._model, self.geometry, self.pairs
        return twin

    @cached_property
    def _queries(self) -> PairQueries:
        return PairQueries(self._model, self.geometry)

    def place(self, data: pin.Data) -> None:
        """Move the bodies to the joints in `data`."""
        if self.pairs:
            self._queries.place(data)

    def collides(self, data: pin.Data, q: Array) -> bool:
        """Return whether any pair, with hulls for meshes, touches at q (n,); moves the joints in `data`."""
        return self._queries.any_touch(data, q)

    def distance(self, pair: int) -> float:
        """Return a lower bound, m, of the distance of a pair where `place` put the bodies; negative if hulls meet."""
        return float(self.query(pair).min_distance) - _HULL_MARGIN

    def query(self, pair: int) -> coal.DistanceResult:
        """Return the nearest points of a pair of hulls where `place` put the bodies."""
        return self._queries.distance(pair)
