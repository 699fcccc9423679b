"""The collision model of planners: queries in the native core where that is there and knows the shapes."""

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import coal
import numpy as np

from optiplan._core import core
from optiplan.arrays import Array, Index
from optiplan.cache import MostRecent, digest
from optiplan.collision.clusters import Cluster, clusters_of
from optiplan.collision.contacts import Contact, Contacts
from optiplan.collision.model import CollisionModel
from optiplan.collision.passing_neighbours import passing_neighbours
from optiplan.geometry.convex import hull_of_mesh, mesh_triangles, mesh_vertices
from optiplan.geometry.scene import Scene
from optiplan.robot.loaded_robots import once_for_each_robot
from optiplan.robot.native_tree import native_tree
from optiplan.robot.robot import Robot

if TYPE_CHECKING:
    from optiplan._core._core_base import Body, Shape, World

_links: "WeakKeyDictionary[Robot, list[Body | None]]" = WeakKeyDictionary()

_made: "MostRecent[Shape]" = MostRecent(512)
"""Hulls and meshes by content: the index of their vertices takes milliseconds to make."""

_SLACK = 1e-9
"""m, by which the box and the ball around a hull are larger than its vertices."""


def planning_model(
    robot: Robot, scene: Scene, known: CollisionModel | None = None, *, passing: bool = False
) -> CollisionModel:
    """A model for planners; the verifier's is `CollisionModel` itself, which never asks the core.

    Args:
        robot: the robot.
        scene: the scene.
        known: a model of the same robot in the same scene, whose bodies and pairs need not be found again.
        passing: whether the core is asked for `passing_neighbours` too, where no verifier looks at the motion.
    """
    if core is None:
        return CollisionModel(robot, scene)
    return NativeCollisionModel(robot, scene, known, passing=passing)


def not_in_core(model: CollisionModel) -> dict[str, list[str]]:
    """What a planner's record says where the core is there and coal answers in its place: `not_in_core`, the bodies."""
    unknown = model.unknown if isinstance(model, NativeCollisionModel) else ()
    return {"not_in_core": list(unknown)} if unknown else {}


class NativeCollisionModel(CollisionModel):
    """A `CollisionModel` whose queries the native core answers: same meaning, other rounding.

    Neighbours that pass each other wherever their joint stands (`passing_neighbours`) are among `pairs`, but
    `collides`, `near`, `contacts`, sweeps and searches do not ask them, unless it is made with `passing`.

    Attributes:
        world: the bodies and pairs in the core; None where a shape is of a kind that it does not know.
        unknown: names of the bodies with such shapes; with any, coal answers all queries.
    """

    def __init__(
        self, robot: Robot, scene: Scene, known: CollisionModel | None = None, *, passing: bool = False
    ) -> None:
        if known is None:
            super().__init__(robot, scene)
        else:
            self._take(known, scene)
        links, placed = _links_of(self), self.geometry.geometryObjects
        bodies = [*links, *(_body(self, k, _shapes_of(placed[k].geometry)) for k in range(len(links), len(placed)))]
        self.unknown = tuple(name for name, found in zip(self.names, bodies, strict=True) if found is None)
        never = frozenset() if passing or self.unknown else passing_neighbours(robot)
        self.world = None if self.unknown else _world(self, [found for found in bodies if found is not None], never)

    def collides(self, q: Array) -> bool:
        """See `CollisionModel.collides`."""
        return super().collides(q) if self.world is None else self.world.collides(_packed(self.full(q)))

    def clearance(self, q: Array) -> Contact | None:
        """See `CollisionModel.clearance`."""
        if self.world is None:
            return super().clearance(q)
        found = self.world.nearest(_packed(self.full(q[None])))
        if found is None:
            return None
        _, pairs, distances, vectors, _ = found
        return Contact(self.pairs[int(pairs[0])], float(distances[0]), *vectors[0])

    def contacts(self, q: Array, cutoff: float) -> list[Contact]:
        """See `CollisionModel.contacts`."""
        if self.world is None:
            return super().contacts(q, cutoff)
        _, pairs, distances, vectors, _ = self.world.near(_packed(self.full(q[None])), cutoff)
        found = zip(pairs.tolist(), distances.tolist(), vectors, strict=True)
        return [Contact(self.pairs[pair], distance, *triple) for pair, distance, triple in found]

    def near(self, Q: Array, cutoff: float) -> Contacts:
        """See `CollisionModel.near`."""
        if self.world is None:
            return super().near(Q, cutoff)
        rows, pairs, distances, vectors, _ = self.world.near(_packed(self.full(Q)), cutoff)
        return Contacts(rows, pairs, distances, vectors[:, :2], vectors[:, 2])

    def lower_bounds(self, Q: Array, enough: float = np.inf) -> Array:
        """See `CollisionModel.lower_bounds`."""
        return super().lower_bounds(Q, enough) if self.world is None else self.world.lower_bounds(_packed(self.full(Q)))

    def travel(self, Q: Array, D: Array) -> Array:
        """See `CollisionModel.travel`."""
        if self.world is None:
            return super().travel(Q, D)
        return self.world.travel(_packed(self.full(Q)), _packed(self.widened(D)))

    def gradients(self, Q: Array, contacts: Contacts) -> Array:
        """See `CollisionModel.gradients`."""
        if self.world is None:
            return super().gradients(Q, contacts)
        points, normals = np.ascontiguousarray(contacts.points), np.ascontiguousarray(contacts.normals)
        found = self.world.gradients(_packed(self.full(Q)), contacts.rows, contacts.pairs, points, normals)
        return found[:, : Q.shape[1]]


def _packed(values: Array) -> Array:
    """As the core reads arrays."""
    return np.ascontiguousarray(values, dtype=np.float64)


def _links_of(model: CollisionModel) -> "list[Body | None]":
    """The robot's own bodies in the core, made once for each robot."""
    robot = model.robot
    if robot not in _links:
        _links[robot] = [_body(model, k, shapes) for k, shapes in enumerate(_link_shapes(robot))]
    return _links[robot]


@once_for_each_robot
def _link_shapes(robot: Robot) -> "list[list[Shape]]":
    """What `_shapes_of` says of each body of a robot, wherever that stands."""
    return [_shapes_of(body.geometry) for body in robot.geometry.geometryObjects]


def _shapes_of(solid: coal.CollisionGeometry) -> "list[Shape]":
    """A shape in the core, a mesh as its hull and its triangles; none where the core does not know it."""
    kinds = [hull_of_mesh(solid), solid] if isinstance(solid, coal.BVHModelBase) else [solid]
    shapes = [shape for shape in map(native_shape, kinds) if shape is not None]
    return shapes if len(shapes) == len(kinds) else []


def _body(model: CollisionModel, body: int, shapes: "list[Shape]") -> "Body | None":
    """A body of these shapes in the core; None where it has none."""
    if not shapes:
        return None
    found, bounds = model.geometry.geometryObjects[body], model.bounds
    box = np.concatenate([bounds.centre[body], bounds.half[body]])
    return core.Body.of(int(found.parentJoint), found.placement.homogeneous, shapes, box, float(bounds.radius[body]))


def _world(model: CollisionModel, bodies: "list[Body]", never: frozenset[tuple[int, int]]) -> "World":
    pairs = model.bounds.pairs.astype(np.int64)
    left_out = [pair.index for pair in model.pairs if (pair.a, pair.b) in never]
    return core.World.of(native_tree(model.model), bodies, pairs, _clusters(model.robot), left_out)


@once_for_each_robot
def _clusters(robot: Robot) -> "list[tuple[Body, list[int]]]":
    """Hulls of many bodies of the robot as bodies of the core, with the bodies they hold."""
    return [(_hull(cluster), list(cluster.bodies)) for cluster in clusters_of(robot).by_joint]


def _hull(cluster: Cluster) -> "Body":
    corners = cluster.hull.vertices
    low, high = corners.min(axis=0), corners.max(axis=0)
    centre, half = 0.5 * (low + high), 0.5 * (high - low) + _SLACK
    radius = float(np.linalg.norm(corners - centre, axis=1).max()) + _SLACK
    shape = core.Shape.convex_hull(np.ascontiguousarray(corners))
    return core.Body.of(cluster.joint, np.eye(4), [shape], np.concatenate([centre, half]), radius)


def native_shape(body: coal.CollisionGeometry) -> "Shape | None":
    """The same shape for the core; None of a kind that it does not know."""
    match body:
        case coal.Sphere():
            return core.Shape.sphere(body.radius)
        case coal.Capsule():
            return core.Shape.capsule(body.radius, body.halfLength)
        case coal.Cylinder():
            return core.Shape.cylinder(body.radius, body.halfLength)
        case coal.Box():
            return core.Shape.box(np.array(body.halfSide))
        case coal.Halfspace():
            return core.Shape.half_space(np.array(body.n), body.d)
        case coal.ConvexBase():
            return _hull_shape(np.array(body.points()))
        case coal.BVHModelBase():
            return _mesh_shape(mesh_vertices(body), mesh_triangles(body))
    return None


def _hull_shape(points: Array) -> "Shape":
    return _made.get(digest([points.tobytes()]), lambda: core.Shape.convex_hull(points))


def _mesh_shape(vertices: Array, triangles: Index) -> "Shape":
    corners = np.ascontiguousarray(triangles, dtype=np.int64)
    return _made.get(digest([vertices.tobytes(), corners.tobytes()]), lambda: core.Shape.triangles(vertices, corners))
