"""Distances of pairs of bodies, each confirmed by a plane between the two that needs no trust in the query."""

from dataclasses import dataclass

import coal
import numpy as np
import numpy.typing as npt
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.model.collision import CollisionModel
from optiplan.model.kinematics import BatchKinematics

Index = npt.NDArray[np.intp]
Flags = npt.NDArray[np.bool_]
TRUST = 1e-6  # m, and fraction of the distance: how far a distance that no plane confirms is believed


@dataclass(frozen=True, eq=False)
class Distances:
    """Answers to K queries.

    Attributes:
        measured: (K,) m, what coal measured; negative is depth of penetration.
        bound: (K,) m, a lower bound of the distance: from the plane, or where bodies are not convex from coal.
        believed: (K,) bool, whether `bound` rests on coal alone.
    """

    measured: Array
    bound: Array
    believed: Flags


class PairDistances:
    """Distance queries on the verifier's own copy of the work space; one object a thread.

    For a unit vector n from a to b, with support function h_X(n) = max over x in X of n . x,
        distance(a, b) >= -h_b(-n) - h_a(n),
    whatever n is; with coal's normal both sides are equal for convex bodies. The support functions of boxes, balls,
    cylinders and capsules are closed formulas, those of polyhedra and meshes maxima over vertices.
    """

    def __init__(self, model: CollisionModel) -> None:
        self._robot, self._geometry = model.robot.model, model.geometry
        self._data, self._placed = self._robot.createData(), pin.GeometryData(model.geometry)
        for request in self._placed.distanceRequests:
            request.gjk_initial_guess = coal.GJKInitialGuess.DefaultGuess
        bodies = list(model.geometry.geometryObjects)
        self._shapes = [body.geometry for body in bodies]
        self._vertices = [_vertices(shape) for shape in self._shapes]
        self._kinematics = BatchKinematics(self._robot)
        self._joints = np.array([int(body.parentJoint) for body in bodies], dtype=np.intp)
        self._placements = np.array([body.placement.homogeneous for body in bodies]).reshape(-1, 4, 4)
        self._pairs: Index = np.array([(p.a, p.b) for p in model.pairs], dtype=np.intp).reshape(-1, 2)
        self._convex: Flags = np.logical_and(*self._kind(coal.ShapeBase).T)
        self._plane_side: Flags = self._kind(coal.Halfspace)

    def _kind(self, kind: type) -> Flags:
        """Which side of each pair is of this kind: (P, 2)."""
        of_kind = [isinstance(shape, kind) for shape in self._shapes]
        return np.array([(of_kind[a], of_kind[b]) for a, b in self._pairs], dtype=bool).reshape(-1, 2)

    def query(self, Q: Array, rows: Index, pairs: Index) -> Distances:
        """Distance k of pair `pairs[k]` at configuration Q[rows[k]]; `rows` ascending, Q (N, n)."""
        measured, normals = self._measure(Q, rows, pairs)
        X_WG = self._kinematics.poses(Q)
        bodies = self._pairs[pairs]
        poses = X_WG[rows[:, None], self._joints[bodies]] @ self._placements[bodies]  # (K, 2, 4, 4)
        for side, sign in ((0, 1.0), (1, -1.0)):
            for k in np.flatnonzero(self._plane_side[pairs, side]):  # the half-space itself is the plane
                normals[k] = sign * poses[k, side, :3, :3] @ np.array(self._shapes[bodies[k, side]].n)
        bound = -self._support(bodies[:, 0], poses[:, 0], normals) - self._support(bodies[:, 1], poses[:, 1], -normals)
        bound = np.nan_to_num(bound, nan=-np.inf)
        measured = np.where(self._plane_side[pairs].any(axis=1), bound, measured)
        coal_says = measured - np.maximum(TRUST, TRUST * measured)
        believed = ~self._convex[pairs] & (coal_says > bound)
        return Distances(measured, np.where(believed, coal_says, bound), believed)

    def witness(self, q: Array, pair: int) -> tuple[float, Array]:
        """Distance, m, and the nearest points (2, 3) on a and b in the world at q (n,)."""
        pin.updateGeometryPlacements(self._robot, self._data, self._geometry, self._placed, q)
        pin.computeDistance(self._geometry, self._placed, pair)
        result = self._placed.distanceResults[pair]
        return float(result.min_distance), np.array([result.getNearestPoint1(), result.getNearestPoint2()])

    def _measure(self, Q: Array, rows: Index, pairs: Index) -> tuple[Array, Array]:
        """What coal says: distances (K,) and unit normals from a to b (K, 3), NaN where it gives none."""
        measured, normals = np.empty(len(rows)), np.empty((len(rows), 3))
        placed, results, geometry, last = self._placed, self._placed.distanceResults, self._geometry, -1
        for k, (row, pair) in enumerate(zip(rows.tolist(), pairs.tolist(), strict=True)):
            if row != last:
                pin.updateGeometryPlacements(self._robot, self._data, geometry, placed, Q[row])
                last = row
            pin.computeDistance(geometry, placed, pair)
            result = results[pair]
            measured[k] = result.min_distance
            if self._convex[pair]:
                normals[k] = result.normal
            else:  # coal leaves the normal of two meshes unset
                normals[k] = result.getNearestPoint2() - result.getNearestPoint1()
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        with np.errstate(invalid="ignore", divide="ignore"):
            return measured, normals / length

    def _support(self, bodies: Index, poses: Array, directions: Array) -> Array:
        """h(n) in the world of body bodies[k] at poses[k] (K, 4, 4) in direction directions[k] (K, 3): (K,), m."""
        local = np.einsum("kji,kj->ki", poses[:, :3, :3], directions)
        result = np.einsum("ki,ki->k", poses[:, :3, 3], directions)
        for body in np.unique(bodies):
            chosen = bodies == body
            result[chosen] += support(self._shapes[body], self._vertices[body], local[chosen])
        return np.asarray(result)


def support(shape: coal.CollisionGeometry, vertices: Array, n: Array) -> Array:
    """h(n) = max over points x of the body of n . x in its own frame; n (K, 3) of unit length, result (K,), m.

    A half-space is bounded only in the direction of its own normal; elsewhere, and for shapes unknown here, it is inf.
    """
    if len(vertices):
        return np.asarray((n @ vertices.T).max(axis=1))
    match shape:
        case coal.Box():
            return np.asarray(np.abs(n) @ np.array(shape.halfSide))
        case coal.Sphere():
            return np.full(len(n), shape.radius)
        case coal.Capsule():
            return np.asarray(shape.radius + shape.halfLength * np.abs(n[:, 2]))
        case coal.Cylinder():
            return np.asarray(shape.radius * np.hypot(n[:, 0], n[:, 1]) + shape.halfLength * np.abs(n[:, 2]))
        case coal.Halfspace():
            along = n @ np.array(shape.n) > 1.0 - 1e-12
            return np.where(along, shape.d, np.inf)
    return np.full(len(n), np.inf)


def _vertices(shape: coal.CollisionGeometry) -> Array:
    """Vertices (k, 3), m, of polyhedra and meshes; none for round shapes."""
    if isinstance(shape, coal.ConvexBase):
        return np.array([shape.point(i) for i in range(shape.num_points)])
    if isinstance(shape, coal.BVHModelBase):
        return np.array(shape.vertices())
    return np.empty((0, 3))
