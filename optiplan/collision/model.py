"""Collision queries of a robot in a scene: contacts, clearance, its gradient, and bounds that need no query."""

from functools import cached_property

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Flags, Index
from optiplan.collision.bodies_and_pairs import bodies_of, only_moved, overlapping, pairs_of, with_asked_checked
from optiplan.collision.contacts import Contact, Contacts, Pair, unit_normals
from optiplan.collision.containment import Containment
from optiplan.collision.geometry_model import geometry_of
from optiplan.collision.moving_obstacles import displacements, with_obstacle_joints
from optiplan.collision.pair_queries import HULL_DISTANCE_ENOUGH, Outline, PairQueries
from optiplan.geometry.coal_queries import DISTANCE_ERROR
from optiplan.geometry.convex import is_flat
from optiplan.geometry.scene import Scene
from optiplan.geometry.shapes import build_geometry
from optiplan.robot.batched.kinematics import BatchKinematics
from optiplan.robot.robot import Robot
from optiplan.robot.self_collision.pair_bounds import PairBounds, local_box


class SameBodies:
    """Key shared by models of the same bodies and pairs, wherever obstacles stand."""


class CollisionModel:
    """A robot in a scene, with its own work space: use one object a thread.

    Bodies are the robot's links, then attachments, then obstacles. The robot determines the checked pairs of links; the
    safety of the scene adds those of `with_asked_checked`. A link that no planned joint moves may stand on an obstacle,
    but not in it. Such a pair is measured once: if the two overlap by more than `bodies_and_pairs.STANDING_OVERLAP`, it
    is among `pairs`, and no configuration is free.

    Attributes:
        geometry: the bodies; `names[i]` is the link, attachment or obstacle of body i.
        pairs: the pairs that must stay apart.
        outline: the same bodies with hulls in the place of meshes.
        same_bodies: a key that a model shares with the model `with_obstacles_moved`.
        motions: of the moving obstacles.
        model: the robot's, with joints for every moving obstacle (`moving_obstacles`). In a
            configuration (n,) of the robot alone, obstacles are at their initial positions.
    """

    error: Array | None = None
    """How far joints may be off; None where queries are about the very configuration: see `NativeCollisionModel`."""

    def __init__(self, robot: Robot, scene: Scene) -> None:
        self.robot = robot = with_asked_checked(scene.safety, robot)
        self.scene, self.same_bodies = scene, SameBodies()
        self.motions = tuple(body.motion for body in scene.obstacles if body.motion is not None)
        self.model, self._carriers = with_obstacle_joints(robot.model, scene.dynamic_obstacles)
        self._moved = displacements(self.motions, np.zeros(1))[0]
        bodies = bodies_of(robot, scene, self._carriers)
        self.names = tuple(name for name, _ in bodies)
        self.geometry = geometry_of([body for _, body in bodies])
        others = list(self.geometry.geometryObjects)[len(robot.link_boxes) :]
        self._boxes = [*robot.link_boxes, *(local_box(body.geometry) for body in others)]
        self.pairs = self._list_pairs()
        for pair in self.pairs:
            self.geometry.addCollisionPair(pin.CollisionPair(pair.a, pair.b))
        self.kinematics = BatchKinematics(self.model) if self.motions else robot.kinematics
        self.bounds = PairBounds(self.kinematics, self.geometry, [(p.a, p.b) for p in self.pairs], self._boxes)
        self._data = self.model.createData()
        self.outline = Outline(self.model, self.geometry, self.bounds.pairs)

    def _take(self, known: "CollisionModel", scene: Scene) -> None:
        """Take over bodies and pairs of another model of the same content, with a separate work space."""
        cached = {name for name, value in vars(CollisionModel).items() if isinstance(value, cached_property)}
        vars(self).update({name: value for name, value in vars(known).items() if name not in cached})
        self.scene, self._data, self.outline = scene, self.model.createData(), self.outline.with_own_queries()

    def with_obstacles_moved(self, scene: Scene) -> "CollisionModel | None":
        """Return a model, with a separate work space, of the same bodies in a scene where obstacles stand elsewhere.

        Its results equal those of a new model to the last bit; pairs, bounding volumes and solvers are taken over. None
        if the bodies or the pairs differ, or if a body is attached or moves.
        """
        if not only_moved(self.scene, scene):
            return None
        geometry, first = self.geometry.copy(), len(self.names) - len(scene.obstacles)
        for k, obstacle in enumerate(scene.obstacles, first):
            geometry.geometryObjects[k].placement = obstacle.X_WO
        if overlapping(geometry, self._standing, self._boxes) != self._sunk:
            return None
        model = self._of(scene, geometry, self.bounds.with_placements(geometry))
        if "containment" in vars(self):
            model.containment = self.containment
        return model

    def with_obstacles_reshaped(self, scene: Scene) -> "CollisionModel":
        """Return a model, with a separate work space, of the same bodies where obstacles have the shapes of `scene`.

        All else is as in this model's scene, and its pairs are checked. Half-spaces stay what they are.
        """
        geometry, boxes = self.geometry.copy(), list(self._boxes)
        for k, obstacle in enumerate(scene.obstacles, len(self.names) - len(scene.obstacles)):
            geometry.geometryObjects[k].geometry = build_geometry(obstacle.shape)
            boxes[k] = local_box(geometry.geometryObjects[k].geometry)
        model = self._of(scene, geometry, self.bounds.with_boxes(boxes))
        model.same_bodies, model._boxes = SameBodies(), boxes
        return model

    def _of(self, scene: Scene, geometry: pin.GeometryModel, bounds: PairBounds) -> "CollisionModel":
        """Return a model with a separate work space and all else of this one."""
        model = CollisionModel.__new__(CollisionModel)
        model._take(self, scene)
        model.geometry, model.bounds = geometry, bounds
        model.outline = Outline(model.model, geometry, bounds.pairs)
        return model

    @cached_property
    def _queries(self) -> PairQueries:
        return PairQueries(self.model, self.geometry)

    @cached_property
    def flat_pairs(self) -> list[int]:
        """Indices of the pairs with a plane mesh, which the broad phase misses."""
        bodies = {body for pair in self.pairs for body in (pair.a, pair.b)}
        flat = {body for body in bodies if is_flat(self.geometry.geometryObjects[body].geometry)}
        return [k for k, pair in enumerate(self.pairs) if flat & {pair.a, pair.b}]

    @property
    def standing_pairs(self) -> Index:
        """Return the pairs (K, 2) of a link that no planned joint moves and an obstacle, which are not queried."""
        return self._standing

    def at_times(self, Q: Array, t: Array) -> Array:
        """Return configurations Q (N, n) with the obstacles at times t (N,), s: (N, n + K)."""
        return np.hstack([Q, displacements(self.motions, t)])

    def obstacle_rates(self, t: Array) -> Array:
        """Return the velocities (N, 3 m), m/s, of the joints of moving obstacles at times t (N,), s."""
        return displacements(self.motions, t, 1)

    def full(self, Q: Array) -> Array:
        """Return configurations (…, n) with the obstacles at their initial positions; (…, n + 3 m) ones unchanged."""
        if Q.shape[-1] == self.model.nq:
            return Q
        return np.concatenate([Q, np.broadcast_to(self._moved, (*Q.shape[:-1], len(self._moved)))], axis=-1)

    def widened(self, D: Array) -> Array:
        """Return half widths D (N, n) with half width 0 for the obstacles, (N, n + K)."""
        return np.hstack([D, np.zeros((len(D), self.model.nq - D.shape[1]))])

    def beyond_limits(self, q: Array) -> str | None:
        """Return in words which joint may leave its limits of position near q (n,); None where none may."""
        return None

    def collides(self, q: Array) -> bool:
        """Return whether any pair touches at q (n,); meshes are queried if their hulls touch.

        The broad phase misses plane meshes. With a plane mesh, or with too many pairs, all pairs whose
        bounding volumes meet are queried instead.
        """
        if self.flat_pairs or self._queries.many:
            return self.touches(q)
        if self.outline.pairs and not self.outline.collides(self._data, self.full(q)):
            return False
        return self._queries.any_touch(self._data, self.full(q))

    def collides_at(self, Q: Array) -> Flags:
        """Return `collides` of configurations (k, n), (k,)."""
        return np.array([self.collides(q) for q in Q], dtype=bool)

    def touches(self, q: Array) -> bool:
        """Return `collides`, pair by pair where bounding volumes and hulls meet, without solvers of the other pairs."""
        return any(self._queries.touches(pair) for pair in self._place_near(q, DISTANCE_ERROR))

    def touching(self, q: Array, cutoff: float) -> list[Contact]:
        """Return every pair nearer than `cutoff`, m, at q (n,); if there is none but bodies touch, the nearest pair.

        Contact and distance are two queries of coal, which differ by rounding.
        """
        near = self._place_near(q, max(cutoff, DISTANCE_ERROR))
        found = [contact for contact in map(self.pair_distance, near) if contact.distance < cutoff]
        if not found and any(map(self._queries.touches, near)):
            nearest = self.clearance(q)
            found += [] if nearest is None else [nearest]
        return found

    def contained(self, q: Array) -> tuple[str, str] | None:
        """Return the names of a body and of the mesh that contains it, at q (n,) without contact; None without one.

        Distances do not show this. A motion without contact needs the check at one end only.
        """
        if not self.containment.possible:
            return None
        self.place(q)
        found = self.containment.find(self._queries.poses())
        return None if found is None else (self.names[found.inner], self.names[found.mesh])

    @cached_property
    def containment(self) -> Containment:
        """The test for bodies inside meshes, for all pairs."""
        return Containment([body.geometry for body in self.geometry.geometryObjects], self.bounds.pairs)

    def place(self, q: Array) -> None:
        """Move all bodies to q (n,), for `pair_distance`."""
        pin.forwardKinematics(self.model, self._data, self.full(q))
        self._queries.place(self._data)
        self.outline.place(self._data)

    def pair_distance(self, pair: int) -> Contact:
        """Return the nearest points of one pair where `place` put the bodies."""
        return self._read(pair, self._queries.distance(pair))

    def pair_gap(self, pair: int) -> float:
        """Return a lower bound, m, of the distance of one pair where `place` put the bodies.

        It is the distance itself, unless a body is a mesh and the hulls are farther apart than `HULL_DISTANCE_ENOUGH`.
        """
        if pair in self.outline.pairs:
            gap = self.outline.distance(pair)
            if gap > HULL_DISTANCE_ENOUGH:
                return gap
        return float(self._queries.distance(pair).min_distance)

    def distance(self, q: Array, pair: int) -> Contact:
        """Return the nearest points of one pair at q (n,)."""
        self.place(q)
        return self.pair_distance(pair)

    def clearance(self, q: Array) -> Contact | None:
        """Return the nearest pair of all at q (n,); None if there is no pair."""
        if not self.pairs:
            return None
        if self.outline.pairs or self._queries.many:
            return self.nearest_of(q, np.arange(len(self.pairs)))
        return self._read(*self._queries.nearest(self._data, self.full(q)))

    def nearest_of(self, q: Array, which: Index) -> Contact:
        """Return the nearest of chosen pairs (K,), K > 0, at q (n,), m.

        They are asked in the order of lower bounds, until one exceeds the least distance.
        """
        self.place(q)
        bounds = self.lower_bounds(q[None])[0]
        for pair in self.outline.pairs:
            bounds[pair] = max(bounds[pair], self.outline.distance(pair))
        best: Contact | None = None
        for pair in which[np.argsort(bounds[which], kind="stable")].tolist():
            if best is not None and bounds[pair] >= best.distance:
                break
            found = self.pair_distance(pair)
            best = found if best is None or found.distance < best.distance else best
        assert best is not None
        return best

    def contacts(self, q: Array, cutoff: float) -> list[Contact]:
        """Return every pair nearer than `cutoff`, m, at q (n,)."""
        found = map(self.pair_distance, self._place_near(q, cutoff))
        return [contact for contact in found if contact.distance < cutoff]

    def _place_near(self, q: Array, cutoff: float) -> list[int]:
        """Move the bodies to q (n,); return the pairs that volumes and hulls do not prove beyond `cutoff`, m."""
        self.place(q)
        possible = np.flatnonzero(self.lower_bounds(q[None], cutoff)[0] <= cutoff).tolist()
        meshes = self.outline.pairs
        return [pair for pair in possible if pair not in meshes or self.outline.distance(pair) <= cutoff]

    def near(self, Q: Array, cutoff: float) -> Contacts:
        """Return every pair nearer than `cutoff`, m, at each of many configurations Q (N, n), as arrays.

        For a pair with a mesh, distance and points are those of the hulls in two cases: the hulls are farther apart
        than `HULL_DISTANCE_ENOUGH`, or the bodies touch. Triangles give neither depth nor the way out.
        """
        candidates = self.lower_bounds(Q, cutoff) < cutoff
        rows, pairs, results = list[int](), list[int](), list[coal.DistanceResult]()
        for row in np.flatnonzero(candidates.any(axis=1)).tolist():
            self.place(Q[row])
            for pair in np.flatnonzero(candidates[row]).tolist():
                result = self._nearest_points(pair)
                if result.min_distance < cutoff:
                    rows.append(row)
                    pairs.append(pair)
                    results.append(result)
        distances, vectors = np.array([result.min_distance for result in results]), _vectors(results)
        normals = unit_normals(distances, vectors)
        return Contacts(np.array(rows, np.intp), np.array(pairs, np.intp), distances, vectors[:, :2], normals)

    def distances_at(self, placed: pin.Data, which: Index) -> Array:
        """Return the distances (K,), m, of chosen pairs with joints as in `placed`; meshes as in `near`."""
        self._queries.place(placed)
        self.outline.place(placed)
        self._answers = results = [self._nearest_points(pair) for pair in which.tolist()]
        return np.array([result.min_distance for result in results])

    def _nearest_points(self, pair: int) -> coal.DistanceResult:
        result = self.outline.query(pair) if pair in self.outline.pairs else None
        if result is None or result.min_distance <= HULL_DISTANCE_ENOUGH:
            own = self._queries.distance(pair)
            if result is None or own.min_distance > 0.0:
                return own
        return result

    def witnesses(self) -> Array:
        """Return nearest points on bodies a and b, m, and unit normals from a to b, world, of the last `distances_at`.

        Returns:
            (K, 3, 3): rows 0 and 1 are the points, row 2 the normal.
        """
        results = self._answers
        vectors = _vectors(results)
        if self.outline.pairs:  # between meshes coal leaves the normal unset
            vectors[:, 2] = unit_normals(np.array([result.min_distance for result in results]), vectors)
        return vectors

    def lower_bounds(self, Q: Array, enough: float = np.inf) -> Array:
        """Return lower bounds (N, P), m, of the distance of every pair at Q (N, n), from bounding volumes alone.

        Bounds above `enough`, m, may be those of balls, which are cheaper.
        """
        return self.bounds.distances(self.full(Q), enough)

    def travel(self, Q: Array, D: Array) -> Array:
        """Return a bound (N, P), m, of the change of every pair's distance while |q_j - Q_j| <= D_j; Q and D (N, n)."""
        return self.bounds.travel(self.full(Q), self.widened(D))

    def gradients(self, Q: Array, contacts: Contacts) -> Array:
        """Return the gradient (K, n) of the distances of contacts at Q (N, n), m/rad or m/m.

        For normal n and witness points a, b fixed to their bodies, d(distance)/dq = n . (J_b - J_a), with J the linear
        Jacobian of the point. By the envelope theorem, the motion of the witness points on the surfaces adds nothing.
        Between parallel faces the distance has a kink.
        """
        at = self.full(Q)[contacts.rows]
        found = self.bounds.witness_gradients(at, contacts.pairs, contacts.points, contacts.normals)
        return found[:, : Q.shape[1]]

    def _read(self, pair: int, result: coal.DistanceResult) -> Contact:
        a, b = np.array(result.getNearestPoint1()), np.array(result.getNearestPoint2())
        distance = float(result.min_distance)
        normal = unit_normals(np.array([distance]), np.array([[a, b, result.normal]]))[0]
        return Contact(self.pairs[pair], distance, a, b, normal)

    def _list_pairs(self) -> tuple[Pair, ...]:
        parents = [int(body.parentJoint) for body in self.geometry.geometryObjects]
        kept, self._standing = pairs_of(self.robot, self.scene, self.names, parents)
        self._sunk = overlapping(self.geometry, self._standing, self._boxes)
        return tuple(Pair(k, a, b, self.names[a], self.names[b]) for k, (a, b) in enumerate([*kept, *self._sunk]))


def _vectors(results: list[coal.DistanceResult]) -> Array:
    """Return the nearest points on bodies a and b, m, and coal's normal of each result, world: (K, 3, 3)."""
    rows = [(result.getNearestPoint1(), result.getNearestPoint2(), result.normal) for result in results]
    return np.array(rows).reshape(-1, 3, 3)
