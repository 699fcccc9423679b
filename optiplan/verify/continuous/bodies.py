"""Bodies as arrays: poses at many configurations, support functions, and the joints that move them."""

from dataclasses import dataclass

import coal
import numpy as np

from optiplan.arrays import Array, Flags, Index
from optiplan.collision.model import CollisionModel
from optiplan.geometry.shape import Shape
from optiplan.geometry.shapes import shape_of_body
from optiplan.robot.batch_fk import BatchKinematics, carrying_joints

_MANY = 200
"""Vertices of a mesh above which it is worth finding those of its hull."""


@dataclass(frozen=True, eq=False)
class PlacedBody:
    """Poses of K bodies or pairs, world frame: X_WB of shape (K, 2, 4, 4), sides a and b."""

    bodies: Index
    poses: Array


class Bodies:
    """The bodies of a collision model.

    Attributes:
        shapes: coal geometry of each body.
        pairs: (P, 2) bodies a and b of each pair.
        moves: (P, 2, J) whether joint j moves that side of the pair against the other; a joint that carries both does
            not change their distance. Joints that follow others are joints of their own here.
        centre: (G, 3) in the body's frame, m; `radius` (G,): a ball about it holds the body.
        extent: (G,) bound on the coordinates in which a body is given, in the frame of its joint, m.
    """

    def __init__(self, model: CollisionModel) -> None:
        robot, bodies = model.model, list(model.geometry.geometryObjects)
        self.kinematics = BatchKinematics(robot)
        self.shapes = [body.geometry for body in bodies]
        self._solids = [shape_of_body(shape) for shape in self.shapes]
        self.vertices = [vertices_of(shape) for shape in self.shapes]
        self.joints = np.array([int(body.parentJoint) for body in bodies], dtype=np.intp)
        self.placements = np.array([body.placement.homogeneous for body in bodies]).reshape(-1, 4, 4)
        self.pairs: Index = np.array([(p.a, p.b) for p in model.pairs], dtype=np.intp).reshape(-1, 2)
        balls = [_ball(shape, vertices) for shape, vertices in zip(self.shapes, self.vertices, strict=True)]
        self.centre = np.array([centre for centre, _ in balls]).reshape(-1, 3)
        self.radius = np.array([radius for _, radius in balls])
        planes = [abs(shape.d) if isinstance(shape, coal.Halfspace) else 0.0 for shape in self.shapes]
        own = np.where(np.isinf(self.radius), planes, self.radius)
        offset = np.linalg.norm(self.placements[:, :3, 3], axis=1) + np.linalg.norm(self.centre, axis=1)
        self.extent = offset + own
        carried = carrying_joints(robot)[self.joints[self.pairs]]
        self.moves: Flags = carried & ~carried[:, ::-1]

    def unsupported(self) -> int | None:
        """Return a body of some pair for which no bound is known: a moving half-space, or an unsupported shape."""
        for body in np.unique(self.pairs):
            shape = self.shapes[body]
            moving_plane = isinstance(shape, coal.Halfspace) and self.joints[body] != 0
            if moving_plane or not (len(self.vertices[body]) or self._solids[body] is not None):
                return int(body)
        return None

    def kind(self, kind: type) -> Flags:
        """Return which side of each pair is of this class of coal: (P, 2)."""
        found = [isinstance(shape, kind) for shape in self.shapes]
        return np.array([(found[a], found[b]) for a, b in self.pairs], dtype=bool).reshape(-1, 2)

    def place(self, joint_poses: Array, rows: Index, pairs: Index) -> PlacedBody:
        """Poses of both bodies of pair pairs[k] where the joints are at joint_poses[rows[k]], (N, n + 1, 4, 4)."""
        bodies = self.pairs[pairs]
        return PlacedBody(bodies, joint_poses[rows[:, None], self.joints[bodies]] @ self.placements[bodies])

    def support(self, placed: PlacedBody, side: int, directions: Array) -> Array:
        """h(n) = max of n . x over the body of one side, in the world; directions n (K, 3), result (K,), m."""
        bodies, poses = placed.bodies[:, side], placed.poses[:, side]
        local = np.einsum("kji,kj->ki", poses[:, :3, :3], directions)
        result = np.einsum("ki,ki->k", poses[:, :3, 3], directions)
        for body in np.unique(bodies):
            chosen = bodies == body
            result[chosen] += support(self._solids[body], self.vertices[body], local[chosen])
        return np.asarray(result)


def support(shape: Shape | None, vertices: Array, n: Array) -> Array:
    """h(n) = max of n . x over the points x of a body in its own frame; n (K, 3) of any length, result (K,), m.

    Bodies without vertices are those of a `Shape`; where there is none, the support is infinite.
    """
    if len(vertices):
        return np.asarray((n @ vertices.T).max(axis=1))
    return np.full(len(n), np.inf) if shape is None else shape.support(n)


def vertices_of(shape: coal.CollisionGeometry) -> Array:
    """Vertices (k, 3), m, of polyhedra and of the hulls of meshes; none for other shapes."""
    if isinstance(shape, coal.ConvexBase):
        return np.array(shape.points())
    if isinstance(shape, coal.BVHModelBase):
        return _outer(np.array(shape.vertices()))
    return np.empty((0, 3))


def _ball(shape: coal.CollisionGeometry, vertices: Array) -> tuple[Array, float]:
    """Centre (3,) and radius, m, of a ball that holds the body."""
    if isinstance(shape, coal.Halfspace):
        return np.zeros(3), np.inf
    if len(vertices):
        centre = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
        return centre, float(np.linalg.norm(vertices - centre, axis=1).max())
    if isinstance(shape, coal.Sphere):
        return np.zeros(3), float(shape.radius)
    shape.computeLocalAABB()
    low, high = np.array(shape.aabb_local.min_), np.array(shape.aabb_local.max_)
    return 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))


def _outer(points: Array) -> Array:
    """Those of points (k, 3) that no support function needs to miss: the corners of their hull, where they are many.

    Qhull leaves out corners that stand less than some 1e-14 of the extent out of the hull of the others: nothing beside
    what the certificate subtracts for rounding.
    """
    if len(points) < _MANY:
        return points
    from scipy.spatial import ConvexHull, QhullError

    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:  # all in a plane
        return points
