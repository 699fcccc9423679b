"""Bodies as arrays: poses at many configurations, support functions, and the joints that move them."""

from collections.abc import Sequence
from copy import copy
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple
from weakref import WeakKeyDictionary

import coal
import numpy as np

from optiplan import cache
from optiplan.arrays import Array, Flags, Index
from optiplan.collision.model import CollisionModel
from optiplan.geometry.convex import soup_of
from optiplan.geometry.meshes.mesh_parts import parts_of_mesh
from optiplan.geometry.shape import Shape
from optiplan.geometry.shapes import Box, Capsule, Cylinder, Sphere, shape_of_body
from optiplan.records import dataclass
from optiplan.robot.loaded_robots import once_for_each, once_for_each_robot
from optiplan.robot.robot import Robot
from optiplan.robot.self_collision.pair_bounds import LocalBox, ball_to_box, local_box
from optiplan.verify.continuous.pair_tree import ClusterHull, PairTree, hulls_of


@dataclass(frozen=True, eq=False)
class BodyShape:
    """What is known of one body, in its own frame.

    Attributes:
        shape: coal geometry.
        solid: the shape that it is; None for polyhedra and meshes.
        vertices: (k, 3) of polyhedra and meshes, m; none of others.
        centre: (3,) m; a ball of `radius`, m, about it holds the body.
    """

    shape: coal.CollisionGeometry
    solid: Shape | None
    vertices: Array
    centre: Array
    radius: float

    @classmethod
    def of(cls, shape: coal.CollisionGeometry, box: LocalBox | None = None) -> "BodyShape":
        """Look at a body of coal, whose `local_box` may be known."""
        vertices = support_vertices(shape)
        if isinstance(shape, coal.BVHModelBase):
            centre = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
            return cls(shape, None, vertices, centre, float(np.linalg.norm(vertices - centre, axis=1).max()))
        box = box or local_box(shape)
        return cls(shape, shape_of_body(shape), vertices, box.centre, box.radius)

    @cached_property
    def round(self) -> tuple[float, ...] | None:
        """A (3,), r, s of h(n) = a . |n| + r ||(n_x, n_y)|| + s ||n||, m, as in `Shape.support`; None of others."""
        return _round(self.solid)


@once_for_each_robot
def _shapes_of_links(robot: Robot) -> tuple[BodyShape, ...]:
    bodies = robot.geometry.geometryObjects
    return tuple(BodyShape.of(body.geometry, box) for body, box in zip(bodies, robot.link_boxes, strict=True))


_parts_of_links: WeakKeyDictionary[Robot, dict[int, tuple[BodyShape, ...]]] = WeakKeyDictionary()


def parts_of_link(robot: Robot, body: int) -> tuple[BodyShape, ...]:
    """Hulls that together hold a body of the robot that is a mesh, in its frame; looked at once for each robot."""
    known = _parts_of_links.setdefault(robot.unmounted, {})
    if body not in known:
        parts = parts_of_mesh(soup_of(robot.geometry.geometryObjects[body].geometry))
        known[body] = tuple(BodyShape.of(part.build()) for part in parts)
    return known[body]


def _shapes_of(model: CollisionModel) -> list[BodyShape]:
    """All bodies of the model; those of the robot are looked at once."""
    links = _shapes_of_links(model.robot)
    others = list(model.geometry.geometryObjects)[len(links) :]
    return [*links, *(BodyShape.of(body.geometry) for body in others)]


@once_for_each
def _shape_of_hull(hull: ClusterHull) -> BodyShape:
    return BodyShape.of(hull.shape, hull.box)


def bodies_of_links(robot: Robot) -> list[BodyShape]:
    """The bodies of a robot, the hulls of their clusters, and the parts of those that are meshes."""
    links = _shapes_of_links(robot)
    meshes = [k for k, known in enumerate(links) if isinstance(known.shape, coal.BVHModelBase)]
    return [*links, *map(_shape_of_hull, hulls_of(robot)), *(part for k in meshes for part in parts_of_link(robot, k))]


_MANY = 200
"""Vertices of a mesh above which it is worth finding those of its hull."""

_CORNERS_VERSION = b"1"
"""Change it when `_outer` returns something else, so that cached corners are found again."""


class PlacedBody(NamedTuple):
    """Poses of K bodies or pairs, world frame: X_WB of shape (K, 2, 4, 4), sides a and b."""

    bodies: Index
    poses: Array

    @classmethod
    def join(cls, parts: "Sequence[PlacedBody]") -> "PlacedBody":
        """Concatenate."""
        return cls(np.concatenate([part.bodies for part in parts]), np.concatenate([part.poses for part in parts]))

    def take(self, chosen: Index) -> "PlacedBody":
        """The bodies at these positions."""
        return PlacedBody(self.bodies[chosen], self.poses[chosen])


class Bodies:
    """The bodies of a collision model, then the hulls of clusters of them.

    Attributes:
        tree: the pairs, and pairs of hulls that stand for several; P counts all of them.
        known: what is known of each body; `shapes`: its coal geometry.
        pairs: (P, 2) bodies a and b of each pair.
        moves: (P, 2, J) whether joint j moves that side of the pair against the other; a joint that carries both does
            not change their distance. Joints that follow others are joints of their own here.
        centre: (G, 3) in the body's frame, m; `radius` (G,): a ball about it holds the body.
        half: (G, 3) half edges of a box about that centre, along the body's own axes, that holds it, m.
        extent: (G,) bound on the coordinates in which a body is given, in the frame of its joint, m.
    """

    def __init__(self, model: CollisionModel) -> None:
        bounds, self.tree = model.bounds, PairTree(model)
        hulls = self.tree.hulls
        self.kinematics = model.kinematics
        self.known = [*_shapes_of(model), *map(_shape_of_hull, hulls)]
        self.shapes = [known.shape for known in self.known]
        self.joints = np.append(bounds.joint, np.array([hull.cluster.joint for hull in hulls], dtype=np.intp))
        self.half = np.vstack([bounds.half, *(hull.box[1] for hull in hulls)])
        self.pairs = self.tree.pairs
        self.centre = np.array([known.centre for known in self.known]).reshape(-1, 3)
        self.radius = np.array([known.radius for known in self.known])
        self._round = np.array([known.round or (0.0,) * 5 for known in self.known]).reshape(-1, 5)
        self._others = np.array([known.round is None for known in self.known], bool)
        planes = [abs(shape.d) if isinstance(shape, coal.Halfspace) else 0.0 for shape in self.shapes]
        self._reach = np.where(np.isinf(self.radius), planes, self.radius) + np.linalg.norm(self.centre, axis=1)
        self._put(model)
        carried = self.kinematics.carries[self.joints[self.pairs]]
        self.moves: Flags = carried & ~carried[:, ::-1]

    def _put(self, model: CollisionModel) -> None:
        own = model.bounds.placement
        self.placements = np.vstack([own, np.tile(np.eye(4), (len(self.tree.hulls), 1, 1))])
        self.extent = np.linalg.norm(self.placements[:, :3, 3], axis=1) + self._reach

    def with_obstacles_of(self, model: CollisionModel) -> "Bodies":
        """Return the same of a model in which obstacles stand elsewhere."""
        twin = copy(self)
        twin.tree = self.tree.with_obstacles_of(model)
        twin._put(model)
        return twin

    @cached_property
    def unsupported(self) -> int | None:
        """A body of some pair for which no bound is known: a moving half-space, or an unsupported shape."""
        asked = np.zeros(len(self.known), dtype=bool)
        asked[self.pairs] = True
        for body in np.flatnonzero(asked).tolist():
            known = self.known[body]
            moving_plane = isinstance(known.shape, coal.Halfspace) and self.joints[body] != 0
            if moving_plane or not (len(known.vertices) or known.solid is not None):
                return int(body)
        return None

    def kind(self, kind: type) -> Flags:
        """Return which side of each pair is of this class of coal: (P, 2)."""
        found = np.array([isinstance(shape, kind) for shape in self.shapes], dtype=bool)
        return found[self.pairs]

    def place(self, joint_poses: Array, rows: Index, pairs: Index) -> PlacedBody:
        """Poses of both bodies of pair pairs[k] where the joints are at joint_poses[rows[k]], (N, n + 1, 4, 4)."""
        bodies = self.pairs[pairs]
        return PlacedBody(bodies, joint_poses[rows[:, None], self.joints[bodies]] @ self.placements[bodies])

    def lower_bound(self, placed: PlacedBody) -> Array:
        """Lower bounds (K,), m, of the distance of K pairs without half-spaces, from boxes and the balls about them."""
        rotation, bodies = placed.poses[..., :3, :3], placed.bodies
        centre = (rotation @ self.centre[bodies][..., None])[..., 0] + placed.poses[..., :3, 3]
        apart, result = centre[:, 1] - centre[:, 0], np.full(len(bodies), -np.inf)
        for box, ball in ((0, 1), (1, 0)):
            half, radius = self.half[bodies[:, box]], self.radius[bodies[:, ball]]
            result = np.maximum(result, ball_to_box(rotation[:, box], apart, half, radius))
        return result

    def centres(self, bodies: Index, poses: Array) -> Array:
        """Centres, world, m, of the balls about M bodies at poses (M, 4, 4): (M, 3)."""
        return np.asarray((poses[:, :3, :3] @ self.centre[bodies][..., None])[..., 0] + poses[:, :3, 3])

    def support(self, bodies: Index, poses: Array, directions: Array) -> Array:
        """h(n) = max of n . x over the points x of each of M bodies (M,) in the world, m: (M,).

        Args:
            bodies: (M,).
            poses: X_WB of each, (M, 4, 4).
            directions: n (M, 3), world, of any length.
        """
        local = (directions[:, None] @ poses[:, :3, :3])[:, 0]  # n^T R = (R^T n)^T, in the body's frame
        size, x, y, z = self._round[bodies], *local.T
        flat = x * x + y * y
        result = np.einsum("mi,mi->m", poses[:, :3, 3], directions)
        result += np.einsum("mi,mi->m", size[:, :3], np.abs(local))
        result += size[:, 3] * np.sqrt(flat) + size[:, 4] * np.sqrt(flat + z * z)
        others = np.flatnonzero(self._others[bodies])
        for body, chosen in _groups(bodies[others]):
            own, known = others[chosen], self.known[body]
            result[own] += support(known.solid, known.vertices, local[own])
        return np.asarray(result)


def _groups(bodies: Index) -> list[tuple[int, Index]]:
    """Each of the bodies (M,) and where it stands among them."""
    if not len(bodies):
        return []
    order = bodies.argsort(kind="stable")
    found = bodies[order]
    first = [0, *((found[1:] != found[:-1]).nonzero()[0] + 1).tolist(), len(order)]
    return [(int(found[k]), order[k:end]) for k, end in pairwise(first)]


def support(shape: Shape | None, vertices: Array, n: Array) -> Array:
    """h(n) = max of n . x over the points x of a body in its own frame; n (K, 3) of any length, result (K,), m.

    Bodies without vertices are those of a `Shape`; where there is none, the support is infinite.
    """
    if len(vertices):
        return np.asarray((n @ vertices.T).max(axis=1))
    return np.full(len(n), np.inf) if shape is None else shape.support(n)


def _round(solid: Shape | None) -> tuple[float, ...] | None:
    match solid:
        case Box():
            x, y, z = solid.size
            return 0.5 * x, 0.5 * y, 0.5 * z, 0.0, 0.0
        case Sphere():
            return 0.0, 0.0, 0.0, 0.0, solid.radius
        case Cylinder():
            return 0.0, 0.0, 0.5 * solid.length, solid.radius, 0.0
        case Capsule():
            return 0.0, 0.0, 0.5 * solid.length, 0.0, solid.radius
    return None


def support_vertices(shape: coal.CollisionGeometry) -> Array:
    """Vertices (k, 3), m, of polyhedra and of the hulls of meshes; none for other shapes."""
    if isinstance(shape, coal.ConvexBase):
        return np.array(shape.points())
    if isinstance(shape, coal.BVHModelBase):
        return _outer(np.array(shape.vertices()))
    return np.empty((0, 3))


def _outer(points: Array) -> Array:
    """Those of points (k, 3) that no support function needs to miss: the corners of their hull, where they are many.

    Which these are is kept on disk by the points.

    Qhull leaves out corners that stand less than some 1e-14 of the extent out of the hull of the others: nothing beside
    what the certificate subtracts for rounding.
    """
    if len(points) < _MANY:
        return points

    def make() -> bytes:
        from scipy.spatial import ConvexHull, QhullError

        try:
            return np.asarray(ConvexHull(points).vertices, np.int64).tobytes()
        except QhullError:  # all in a plane
            return np.arange(len(points)).tobytes()

    kept = cache.kept(f"corners/{cache.digest([_CORNERS_VERSION, points.tobytes()])}", make)
    return points[np.frombuffer(kept, np.int64)]
