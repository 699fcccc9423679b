"""Distances of pairs of bodies by coal: of single pairs, which need no solver, and of all pairs at once."""

from functools import cached_property

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.mesh_hulls import exact_queries, exact_requests

MANY = 2000
"""Pairs from which on none of the answers about all at once is given: pinocchio takes 7 kB and 7 µs for a solver."""


class PairQueries:
    """Queries of the pairs of a geometry model; one object a thread.

    A single pair is asked of coal itself. pinocchio's solvers of all pairs are made at the first question about all of
    them: loading a problem asks some fifty of the 1,500 pairs of an arm with a gripper.

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
        self._distance_request, self._collision_request = exact_requests()
        self._transforms: dict[int, coal.Transform3s] = {}
        self.many = len(geometry.collisionPairs) > MANY

    def place(self, joints: pin.Data) -> None:
        """Move the bodies to where the joints are in `joints`."""
        self._joints = [pin.SE3(pose) for pose in joints.oMi]
        self._transforms.clear()

    def poses(self) -> Array:
        """Poses X_WB (B, 4, 4) of all bodies where `place` put them."""
        X_WJ = np.array([pose.homogeneous for pose in self._joints])
        return np.asarray(X_WJ[self._joints_of] @ self._X_JB)

    def distance(self, pair: int) -> coal.DistanceResult:
        """Nearest points of a pair where `place` put the bodies."""
        found = self._geometry.collisionPairs[pair]
        a, b, result = found.first, found.second, coal.DistanceResult()
        X_WA, X_WB = self._transform(a), self._transform(b)
        coal.distance(self._shapes[a], X_WA, self._shapes[b], X_WB, self._distance_request, result)
        return result

    def touches(self, pair: int) -> bool:
        """Whether a pair touches where `place` put the bodies."""
        found = self._geometry.collisionPairs[pair]
        a, b, result = found.first, found.second, coal.CollisionResult()
        X_WA, X_WB = self._transform(a), self._transform(b)
        return bool(coal.collide(self._shapes[a], X_WA, self._shapes[b], X_WB, self._collision_request, result))

    def any_touch(self, joints: pin.Data, q: Array) -> bool:
        """Whether any pair touches at q (n,), found by the broad phase; moves `joints`. Only of few pairs."""
        return bool(pin.computeCollisions(self._model, joints, self._broad_phase, q, True))

    def nearest(self, joints: pin.Data, q: Array) -> tuple[int, coal.DistanceResult]:
        """Return the nearest pair at q (n,), and its nearest points; moves `joints`. Only of few pairs."""
        pair = int(pin.computeDistances(self._model, joints, self._geometry, self._solvers, q))
        return pair, self._solvers.distanceResults[pair]

    @cached_property
    def _X_JB(self) -> Array:
        return np.array([pose.homogeneous for pose in self._placements]).reshape(-1, 4, 4)

    @cached_property
    def _solvers(self) -> pin.GeometryData:
        data = self._geometry.createData()
        exact_queries(data)
        return data

    @cached_property
    def _broad_phase(self) -> pin.BroadPhaseManager_DynamicAABBTreeCollisionManager:
        return pin.BroadPhaseManager_DynamicAABBTreeCollisionManager(self._model, self._geometry, self._solvers)

    def _transform(self, body: int) -> coal.Transform3s:
        if body not in self._transforms:
            pose = self._joints[self._joints_of[body]] * self._placements[body]
            self._transforms[body] = coal.Transform3s(pose.rotation, pose.translation)
        return self._transforms[body]
