"""Collision queries of a robot in a scene: contacts, clearance, its gradient, and bounds that need no query."""

from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.model import gjk as _primed  # noqa: F401  # before the first query of the process
from optiplan.model.bounds import Index, PairBounds
from optiplan.model.outline import Outline, exact_queries
from optiplan.model.robot import Robot
from optiplan.model.scene import Scene
from optiplan.model.shapes import build_geometry

_FAR = 0.05
"""m; where the hulls of a pair are farther apart, their distance does."""


@dataclass(frozen=True, slots=True)
class Pair:
    """Two bodies whose distance matters: indices into `CollisionModel.geometry`, and their names."""

    index: int
    a: int
    b: int
    name_a: str
    name_b: str


@dataclass(frozen=True, eq=False)
class Contact:
    """The nearest points of a pair, world frame.

    Attributes:
        distance: m; negative is the depth of penetration.
        point_a: (3,) on body a; `point_b`: on body b; m.
        normal: (3,) unit vector from a to b, so that distance = normal . (point_b - point_a).
    """

    pair: Pair
    distance: float
    point_a: Array
    point_b: Array
    normal: Array


@dataclass(frozen=True, eq=False)
class Contacts:
    """K near pairs at N configurations, as arrays.

    Attributes:
        rows: (K,) which configuration.
        pairs: (K,) index of the pair.
        distance: (K,) m, negative when penetrating.
        points: (K, 2, 3) nearest points on bodies a and b, m, world.
        normals: (K, 3) unit vectors from a to b, world.
    """

    rows: Index
    pairs: Index
    distance: Array
    points: Array
    normals: Array


class CollisionModel:
    """A robot in a scene, with its own work space: use one object a thread.

    Bodies are the robot's links, then attachments, then obstacles. Two bodies that no planned joint moves against each
    other are checked only when one of them is attached, because attaching is the user's statement and the rest is the
    world as it stands.

    Attributes:
        geometry: the bodies; `names[i]` is the link, attachment or obstacle of body i.
        pairs: the pairs that must stay apart.
    """

    def __init__(self, robot: Robot, scene: Scene) -> None:
        self.robot, self.scene = robot, scene
        self.geometry = pin.GeometryModel()
        self.names: tuple[str, ...] = ()
        self._add_bodies()
        self.pairs = self._list_pairs()
        for pair in self.pairs:
            self.geometry.addCollisionPair(pin.CollisionPair(pair.a, pair.b))
        self.bounds = PairBounds(robot.model, self.geometry, [(p.a, p.b) for p in self.pairs])
        self._data, self._geometry_data = robot.model.createData(), self.geometry.createData()
        exact_queries(self._geometry_data)
        self._outline = Outline(robot.model, self.geometry)
        self._broad_phase = pin.BroadPhaseManager_DynamicAABBTreeCollisionManager(
            robot.model, self.geometry, self._geometry_data
        )

    def collides(self, q: Array) -> bool:
        """Whether any pair touches at q (n,)."""
        return bool(pin.computeCollisions(self.robot.model, self._data, self._broad_phase, q, True))

    def place(self, q: Array) -> None:
        """Move all bodies to q (n,), for `pair_distance`."""
        pin.updateGeometryPlacements(self.robot.model, self._data, self.geometry, self._geometry_data, q)
        self._outline.place(self._data)

    def pair_distance(self, pair: int) -> Contact:
        """Nearest points of one pair where `place` put the bodies."""
        pin.computeDistance(self.geometry, self._geometry_data, pair)
        return self._read(pair)

    def pair_gap(self, pair: int) -> float:
        """A lower bound, m, of the distance of one pair where `place` put the bodies; the distance itself below 5 cm.

        Several times faster than the nearest points; where a body is a mesh, the hulls are asked first.
        """
        if pair in self._outline.pairs:
            gap = self._outline.distance(pair)
            if gap > _FAR:
                return gap
        pin.computeDistance(self.geometry, self._geometry_data, pair)
        return float(self._geometry_data.distanceResults[pair].min_distance)

    def distance(self, q: Array, pair: int) -> Contact:
        """Nearest points of one pair at q (n,)."""
        self.place(q)
        return self.pair_distance(pair)

    def clearance(self, q: Array) -> Contact | None:
        """The nearest pair of all at q (n,); None when there is no pair."""
        if not self.pairs:
            return None
        nearest = pin.computeDistances(self.robot.model, self._data, self.geometry, self._geometry_data, q)
        return self._read(int(nearest))

    def contacts(self, q: Array, cutoff: float) -> list[Contact]:
        """Every pair nearer than `cutoff` (m) at q (n,)."""
        near = np.flatnonzero(self.lower_bounds(q[None])[0] < cutoff)
        self.place(q)
        found = [self.pair_distance(int(pair)) for pair in near]
        return [contact for contact in found if contact.distance < cutoff]

    def near(self, Q: Array, cutoff: float) -> Contacts:
        """Every pair nearer than `cutoff` (m) at each of many configurations Q (N, n), as arrays."""
        candidates = self.lower_bounds(Q) < cutoff
        geometry, data, results = self.geometry, self._geometry_data, self._geometry_data.distanceResults
        outline, meshes = self._outline, self._outline.pairs
        found: list[tuple[int, int, float]] = []
        vectors: list[Array] = []
        for row in np.flatnonzero(candidates.any(axis=1)).tolist():
            self.place(Q[row])
            for pair in np.flatnonzero(candidates[row]).tolist():
                if pair in meshes and outline.distance(pair) >= cutoff:
                    continue
                pin.computeDistance(geometry, data, pair)
                result = results[pair]
                distance = result.min_distance
                if distance < cutoff:
                    found.append((row, pair, distance))
                    # Copies: these are views of memory that the pair's next query overwrites.
                    vectors.append(np.array([result.getNearestPoint1(), result.getNearestPoint2(), result.normal]))
        rows, pairs = (np.array([entry[k] for entry in found], dtype=np.intp) for k in (0, 1))
        distances = np.array([entry[2] for entry in found])
        points = np.array(vectors).reshape(-1, 3, 3)
        return Contacts(rows, pairs, distances, points[:, :2], _normals(distances, points))

    def lower_bounds(self, Q: Array) -> Array:
        """Lower bounds, m, of the distance of every pair at Q (N, n), from bounding volumes alone: (N, P)."""
        return self.bounds.distances(Q)

    def travel(self, Q: Array, D: Array) -> Array:
        """Bound, m, on the change of every pair's distance while |q_j - Q_j| <= D_j: Q and D (N, n), result (N, P)."""
        return self.bounds.travel(Q, D)

    def gradients(self, Q: Array, contacts: Contacts) -> Array:
        """Gradient (K, n) of the distances of contacts at Q (N, n) with respect to the configuration, m/rad or m/m.

        For normal n and witness points a, b fixed to their bodies, d(distance)/dq = n . (J_b - J_a), with J the linear
        Jacobian of the point; by the envelope theorem the motion of the witness points on the surfaces adds nothing
        (away from parallel faces, where the distance has a kink).
        """
        return self.bounds.witness_gradients(Q[contacts.rows], contacts.pairs, contacts.points, contacts.normals)

    def _read(self, pair: int) -> Contact:
        result = self._geometry_data.distanceResults[pair]
        a, b = np.array(result.getNearestPoint1()), np.array(result.getNearestPoint2())
        distance = float(result.min_distance)
        normal = _normals(np.array([distance]), np.array([[a, b, result.normal]]))[0]
        return Contact(self.pairs[pair], distance, a, b, normal)

    def _add_bodies(self) -> None:
        robot, names = self.robot, []
        for index, body in enumerate(robot.geometry.geometryObjects):
            self.geometry.addGeometryObject(body.copy())
            names.append(robot.link_of(index))
        for held in self.scene.attached:
            frame = robot.model.frames[robot.model.getFrameId(held.link)]
            X_JO = frame.placement * held.X_LO
            self._add(held.name, frame.parentJoint, X_JO, build_geometry(held.shape))
            names.append(held.name)
        for obstacle in self.scene.obstacles:
            self._add(obstacle.name, 0, obstacle.X_WO, build_geometry(obstacle.shape))
            names.append(obstacle.name)
        self.names = tuple(names)

    def _add(self, name: str, joint: int, placement: pin.SE3, geometry: coal.CollisionGeometry) -> None:
        unique = f"{name}#{self.geometry.ngeoms}"
        self.geometry.addGeometryObject(pin.GeometryObject(unique, joint, 0, placement, geometry))

    def _list_pairs(self) -> tuple[Pair, ...]:
        links = len(self.robot.geometry.geometryObjects)
        held = range(links, links + len(self.scene.attached))
        moving = range(links + len(self.scene.attached))
        obstacles = range(moving.stop, len(self.names))
        found = [(int(p.first), int(p.second)) for p in self.robot.geometry.collisionPairs]
        touch = {index: item.touch | {item.link} for index, item in zip(held, self.scene.attached, strict=True)}
        found += [(a, b) for b in held for a in range(links) if self.names[a] not in touch[b]]
        found += [(a, b) for b in held for a in held if a < b]
        parents = [int(body.parentJoint) for body in self.geometry.geometryObjects]
        found += [(a, b) for a in moving if parents[a] != 0 or a in held for b in obstacles]
        allowed = self.scene.allowed
        return tuple(
            Pair(index, a, b, self.names[a], self.names[b])
            for index, (a, b) in enumerate(
                (a, b) for a, b in found if frozenset((self.names[a], self.names[b])) not in allowed
            )
        )


def _normals(distances: Array, vectors: Array) -> Array:
    """Unit normals (K, 3) from a to b; vectors (K, 3, 3) hold witness points a and b and coal's normal.

    coal leaves the normal of two triangle meshes unset; where bodies are apart, the points give it.
    """
    gap = vectors[:, 1] - vectors[:, 0]
    length = np.linalg.norm(gap, axis=1, keepdims=True)
    apart = (distances > 1e-6)[:, None] & (length > 0.0)
    return np.where(apart, gap / np.where(apart, length, 1.0), vectors[:, 2])
