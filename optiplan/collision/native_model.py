"""The collision model of planners: queries in the native core if it is built and supports the shapes."""

from dataclasses import replace
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import coal
import numpy as np

from optiplan._core import core
from optiplan.arrays import Array, Flags
from optiplan.cache import MostRecent, digest
from optiplan.collision.clusters import Cluster, clusters_of
from optiplan.collision.contacts import Contact, Contacts
from optiplan.collision.floors import Floors, floors_of, taken_by
from optiplan.collision.model import CollisionModel
from optiplan.collision.passing_neighbours import apart_neighbours, passing_neighbours
from optiplan.geometry.convex import hull_of_mesh, soup_of
from optiplan.geometry.meshes.mesh_parts import parts_of_mesh
from optiplan.geometry.scene import Scene
from optiplan.geometry.shape import Shape as Solid
from optiplan.geometry.shapes import build_geometry
from optiplan.robot.loaded_robots import once_for_each_robot
from optiplan.robot.native_tree import native_tree
from optiplan.robot.robot import Robot
from optiplan.robot.self_collision.pair_bounds import local_box

if TYPE_CHECKING:
    from optiplan._core._core_base import Body, Shape, World

_links: "WeakKeyDictionary[Robot, list[Body | None]]" = WeakKeyDictionary()

_made: "MostRecent[Shape]" = MostRecent(512)
"""Hulls and meshes by content: the index of their vertices takes milliseconds to make."""

_SPARE = 0.02
"""Share by which planners take joints to be farther off than the verifier does."""

_HAIR = 1e-6
"""m, above a floor that motions are planned: what the verifier and the core measure differs by rounding."""

_SLACK = 1e-9
"""m; the box and the ball around a hull are larger than it by this slack."""


def planning_model(
    robot: Robot,
    scene: Scene,
    known: CollisionModel | None = None,
    *,
    passing: bool = False,
    error: Array | None = None,
) -> CollisionModel:
    """Return a model for planners; the verifier uses `CollisionModel` itself, which never calls the core.

    Args:
        robot: the robot.
        scene: the scene.
        known: a model of the same robot in the same scene, whose bodies and pairs are reused.
        passing: whether the core also checks `apart_neighbours`: for motions that no verifier checks.
        error: see `NativeCollisionModel`; without the core it is not known.
    """
    if core is None:
        return CollisionModel(robot, scene)
    return NativeCollisionModel(robot, scene, known, passing=passing, error=error)


def not_in_core(model: CollisionModel) -> dict[str, list[str]]:
    """Return `not_in_core` for a planner's record: the bodies that the core does not support, if there are any."""
    unknown = model.unknown if isinstance(model, NativeCollisionModel) else ()
    return {"not_in_core": list(unknown)} if unknown else {}


class NativeCollisionModel(CollisionModel):
    """A `CollisionModel` with queries in the native core: the same meaning, different rounding.

    `pairs` includes neighbours that never touch (`apart_neighbours`). Without `passing`, the functions `collides`,
    `near`, `contacts`, sweeps and searches skip them; where the scene has a `Safety`, only those with a mesh
    (`passing_neighbours`) or built nearer, and the core's distances are what is left above the floors.

    Attributes:
        world: the bodies and pairs in the core; None if the core does not support a shape.
        unknown: names of the bodies with such shapes; if there are any, coal answers all queries.
        error: (n,) rad or m, how far joints may be off a configuration: the core's distances are less by what that
            takes of them, and what touches or leaves a limit somewhere in this tube collides. None: they are where they
            are put.
        floors: that the scene asks for; None: bodies do not touch.
    """

    def __init__(
        self,
        robot: Robot,
        scene: Scene,
        known: CollisionModel | None = None,
        *,
        passing: bool = False,
        error: Array | None = None,
        floors: Floors | None = None,
    ) -> None:
        if known is None:
            super().__init__(robot, scene)
        else:
            self._take(known, scene)
        links, placed = _links_of(self), self.geometry.geometryObjects
        bodies = [*links, *(_body(self, k, _shapes_of(placed[k].geometry)) for k in range(len(links), len(placed)))]
        self.unknown = tuple(name for name, found in zip(self.names, bodies, strict=True) if found is None)
        self.error = error if error is not None and error.any() else None
        self.floors = None if self.unknown else floors or floors_of(self, scene.safety, self.error)
        never = frozenset() if passing or self.unknown else self._left_out()
        self.world = None if self.unknown else _world(self, [found for found in bodies if found is not None], never)

    def _left_out(self) -> frozenset[tuple[int, int]]:
        """Neighbours that never touch; where there are floors, those that keep theirs wherever their joint stands.

        These are built nearer, and their floor is a share of their least distance. Others may come nearer than it.
        """
        apart = apart_neighbours(self.robot)
        if self.floors is None:
            return apart
        nearer = {one.pair for one in self.floors.near if one.end < 0}
        built = frozenset((pair.a, pair.b) for pair in self.pairs if pair.index in nearer)
        return passing_neighbours(self.robot) | (apart & built)

    def about_ends(self, *ends: Array) -> "NativeCollisionModel":
        """Return the model about these ends (n,) of a motion, see `Safety.ends`; itself where no pair is nearer."""
        if self.floors is None:
            return self
        floors = self.floors.with_ends(self, ends)
        if not (floors.at_ends or self.floors.at_ends):
            return self
        return NativeCollisionModel(self.robot, self.scene.ending_at(*ends), self, error=self.error, floors=floors)

    def collides(self, q: Array) -> bool:
        """See `CollisionModel.collides`."""
        if self.error is not None and self._beyond(q, self.error).any():
            return True
        return super().collides(q) if self.world is None else self.world.collides(_packed(self.full(q)))

    def collides_at(self, Q: Array) -> Flags:
        """See `CollisionModel.collides_at`."""
        if self.world is None or self.error is not None or self.floors is not None:
            return super().collides_at(Q)
        return self.world.touching(_packed(self.full(Q))).astype(bool)

    def beyond_limits(self, q: Array) -> str | None:
        """See `CollisionModel.beyond_limits`; of the joints that may be off by the tracking error, the first one."""
        if self.error is None or not (beyond := self._beyond(q, self.error)).any():
            return None
        j, limits = int(np.argmax(beyond)), self.robot.limits
        stated = f"the limits {limits.lower[j]:.6g} and {limits.upper[j]:.6g} {self.robot.unit('position', j)}"
        return f"'{self.robot.joint_names[j]}' at {q[j]:.6g} is nearer to {stated} than its tracking error"

    def _beyond(self, q: Array, error: Array) -> Flags:
        """Return which joints (n,) leave their limits of position where they are off q by up to `error` (n,)."""
        return self.robot.limits.outside(q[: self.robot.n], error)

    def clearance(self, q: Array) -> Contact | None:
        """See `CollisionModel.clearance`."""
        if self.world is None:
            return super().clearance(q)
        found = self.world.nearest(_packed(self.full(q[None])))
        if found is None:
            return None
        _, pairs, distances, vectors, _ = found
        return self._told(q, Contact(self.pairs[int(pairs[0])], float(distances[0]), *vectors[0]))

    def distance(self, q: Array, pair: int) -> Contact:
        """See `CollisionModel.distance`; it is that of the bodies themselves."""
        return self._told(q, super().distance(q, pair))

    def _told(self, q: Array, contact: Contact) -> Contact:
        """Return a contact at q (n,) that tells how far the bodies themselves are apart, where they have floors."""
        return (
            contact if self.floors is None else replace(contact, apart=super().distance(q, contact.pair.index).distance)
        )

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
    return np.ascontiguousarray(values, dtype=np.float64)


def _links_of(model: CollisionModel) -> "list[Body | None]":
    """Return the robot's own bodies in the core, made once for each robot."""
    robot = model.robot
    if robot not in _links:
        _links[robot] = [_body(model, k, shapes) for k, shapes in enumerate(_link_shapes(robot))]
    return _links[robot]


def make_links(robot: Robot) -> None:
    """Give the core the robot's own bodies and their clusters, where it has them not yet."""
    if core is not None:
        _link_shapes(robot)
        _clusters(robot)


@once_for_each_robot
def _link_shapes(robot: Robot) -> "list[list[Shape]]":
    return [_shapes_of(body.geometry) for body in robot.geometry.geometryObjects]


def _shapes_of(solid: coal.CollisionGeometry) -> "list[Shape]":
    """Return a shape in the core, a mesh as its hull, those of its parts and its triangles; nothing if unsupported."""
    if isinstance(solid, coal.BVHModelBase):
        mesh = soup_of(solid)
        hulls = [np.array(hull_of_mesh(solid).points()), *(part.vertices for part in parts_of_mesh(mesh))]
        key = digest([mesh.vertices.tobytes(), mesh.triangles.tobytes()])
        return [*map(native_hull, hulls), _made.get(key, lambda: core.Shape.triangles(mesh.vertices, mesh.triangles))]
    shape = native_shape(solid)
    return [] if shape is None else [shape]


def _body(model: CollisionModel, body: int, shapes: "list[Shape]") -> "Body | None":
    if not shapes:
        return None
    found, bounds = model.geometry.geometryObjects[body], model.bounds
    box = np.concatenate([bounds.centre[body], bounds.half[body]])
    return core.Body.of(int(found.parentJoint), found.placement.homogeneous, shapes, box, float(bounds.radius[body]))


def standing_body(shape: Solid) -> "Body | None":
    """Return a shape at the world's origin as a body of the core; None for an unsupported shape."""
    solid = build_geometry(shape)
    shapes, box = _shapes_of(solid), local_box(solid)
    if not shapes:
        return None
    return core.Body.of(0, np.eye(4), shapes, np.concatenate([box.centre, box.half]), float(box.radius))


def _world(model: NativeCollisionModel, bodies: "list[Body]", never: frozenset[tuple[int, int]]) -> "World":
    pairs = model.bounds.pairs.astype(np.int64)
    left_out = [pair.index for pair in model.pairs if (pair.a, pair.b) in never]
    error, floors = _tube_error(model), _core_floors(model)
    return core.World.of(native_tree(model.model), bodies, pairs, _clusters(model.robot), left_out, *error, *floors)


def _core_floors(model: NativeCollisionModel) -> tuple[list[float], list[tuple[int, float, float, list[float]]]]:
    """Return the floors of all pairs, m, and of those at ends the pair, base, rise and configuration; nothing of none.

    Joints that do not move a pair are nan in its configuration. Motions are planned a hair above the floors.
    """
    floors = model.floors
    if floors is None:
        return [], []
    ends = []
    for one in floors.at_ends:
        counted = np.where(floors.moved[one.pair], floors.ends[one.end], np.nan)
        ends.append((one.pair, one.base + _HAIR, (one.asked - one.base) / floors.within, counted.tolist()))
    return np.where(floors.asked > 0.0, floors.asked + _HAIR, 0.0).tolist(), ends


def _tube_error(model: CollisionModel) -> tuple[list[float], list[float]]:
    """Return how far each joint may be off, and the most that it takes of each pair's distance, m; nothing of none.

    Of neighbours that are apart wherever their joint stands it takes nothing.
    """
    if model.error is None:
        return [], []
    error = model.error * (1.0 + _SPARE)
    most, apart = taken_by(model, error), apart_neighbours(model.robot)
    most[[pair.index for pair in model.pairs if (pair.a, pair.b) in apart]] = 0.0
    return [*error.tolist(), *(0.0 for _ in range(model.model.nq - len(error)))], most.tolist()


@once_for_each_robot
def _clusters(robot: Robot) -> "list[tuple[Body, list[int]]]":
    """Return the clusters of the robot as bodies of the core, with the bodies that they contain."""
    return [(_hull(cluster), list(cluster.bodies)) for cluster in clusters_of(robot).by_joint]


def _hull(cluster: Cluster) -> "Body":
    corners = cluster.hull.vertices
    low, high = corners.min(axis=0), corners.max(axis=0)
    centre, half = 0.5 * (low + high), 0.5 * (high - low) + _SLACK
    radius = float(np.linalg.norm(corners - centre, axis=1).max()) + _SLACK
    shape = core.Shape.convex_hull(np.ascontiguousarray(corners))
    return core.Body.of(cluster.joint, np.eye(4), [shape], np.concatenate([centre, half]), radius)


def native_shape(body: coal.CollisionGeometry) -> "Shape | None":
    """Return a shape for the core, of a body that is no mesh; None if the core does not support it."""
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
            return native_hull(np.array(body.points()))
    return None


def native_hull(points: Array) -> "Shape":
    """Return the hull of points (k, 3), m, in the core: one for each content, which keeps the index of its vertices."""
    return _made.get(digest([points.tobytes()]), lambda: core.Shape.convex_hull(points))
