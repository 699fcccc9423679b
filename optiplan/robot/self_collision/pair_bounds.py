"""Bounds and gradients of pair distances without coal queries, for many configurations at once."""

from collections.abc import Sequence
from copy import copy
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Flags, Index, distinct
from optiplan.cache import MostRecent, digest
from optiplan.geometry.meshes.box_surfaces import box_corners
from optiplan.robot.batched.kinematics import BatchKinematics
from optiplan.robot.loaded_robots import once_for_each


class LocalBox(NamedTuple):
    """Bounding volumes of a body in its own frame, m; infinite for a half-space.

    Attributes:
        centre: (3,) of the box and of the ball.
        half: (3,) half edges of the box.
        radius: of the ball.
    """

    centre: Array
    half: Array
    radius: float


class MeetingPairs(NamedTuple):
    """K pairs whose bounding volumes are near each other.

    Attributes:
        rows: (K,) of the configurations.
        pairs: (K,) index of the pair.
        placed: (K, 2, 4, 4) poses of both bodies in the world.
    """

    rows: Index
    pairs: Index
    placed: Array


class PairBounds:
    """Bounding volumes of all bodies and the joints that move each pair apart, as arrays.

    A body is enclosed by an axis-aligned box in its own frame and by the ball about that box's centre.

    Attributes:
        joint: (G,) joint that carries each body; `placement` (G, 4, 4): pose of the body in that joint's frame.
        centre, half: (G, 3) centre and half edges of each body's box, m, in its own frame; `radius` (G,) of its ball.
        pairs: (P, 2) bodies of each pair.
        moves: (P, 2, J) which joints, followers too, move that side of the pair against the other.
        plane_pairs: indices of the pairs with a half-space.
        depends: (P, n), whether a planned joint, or one that follows it, moves a pair's bodies against each other.
    """

    def __init__(
        self,
        kinematics: BatchKinematics,
        geometry: pin.GeometryModel,
        pairs: Sequence[tuple[int, int]] | Index,
        boxes: Sequence[LocalBox] | None = None,
    ) -> None:
        """Take the bodies of `geometry`, and their bounding volumes where they are known."""
        self.kinematics = kinematics
        bodies = list(geometry.geometryObjects)
        self.joint = np.array([int(body.parentJoint) for body in bodies], dtype=np.intp)
        self.placement = _placements(bodies)
        self._take_boxes([local_box(body.geometry) for body in bodies] if boxes is None else boxes)
        self.pairs: Index = np.array(pairs, dtype=np.intp).reshape(-1, 2)
        moves = kinematics.carries[self.joint[self.pairs]]  # (P, 2, J)
        # A joint that carries both bodies of a pair does not change their distance.
        self.moves = moves & ~moves[:, ::-1]
        self.depends: Flags = self.kinematics.joint_dependence(np.asarray(self.moves.any(axis=1)))
        # What several pairs have in common, a body moved against what a certain joint carries, is looked at once.
        own, other = self.pairs.ravel(), self.joint[self.pairs[:, ::-1]].ravel()
        moves = self.moves.reshape(len(own), moves.shape[2])
        key = np.where(moves.any(axis=1), own * len(kinematics.carries) + other, -1)
        _, first, which = np.unique(key, return_index=True, return_inverse=True)
        self._mover, self._mover_joints = own[first], moves[first]  # (U,), (U, J)
        self._mover_of: Index = which.reshape(-1, 2)
        planes = [isinstance(body.geometry, coal.Halfspace) for body in bodies]
        self.plane_pairs: Index = np.flatnonzero(np.array(planes, dtype=bool)[self.pairs].any(axis=1))
        self._plane_of = {g: (np.array(bodies[g].geometry.n), bodies[g].geometry.d) for g, p in enumerate(planes) if p}

    def _take_boxes(self, boxes: Sequence[LocalBox]) -> None:
        self.centre = np.array([box.centre for box in boxes]).reshape(-1, 3)
        self.half = np.array([box.half for box in boxes]).reshape(-1, 3)
        self.radius = np.array([box.radius for box in boxes])
        edges = np.where(np.isfinite(self.half), self.half, 0.0)
        self._corners = np.ones((len(boxes), 4, 8))
        self._corners[:, :3] = (self.centre[:, None] + box_corners(edges)).swapaxes(1, 2)

    def with_boxes(self, boxes: Sequence[LocalBox]) -> "PairBounds":
        """Return the same of bodies in other boxes, (G) of them, none of which becomes a half-space or was one."""
        twin = copy(self)
        twin._take_boxes(boxes)
        return twin

    def with_placements(self, geometry: pin.GeometryModel) -> "PairBounds":
        """Return the same of bodies that are placed as in `geometry`, where all else is as it was."""
        twin = copy(self)
        twin.placement = _placements(list(geometry.geometryObjects))
        return twin

    def distances(self, Q: Array, enough: float = np.inf) -> Array:
        """Lower bound, m, of every pair's distance at Q (N, n): (N, P).

        It is the larger of the distances from the ball of one body to the box of the other, both ways. If the distance
        of both balls exceeds `enough`, m, it is the bound.
        """
        return self._distances(self.kinematics.poses(Q), np.full((len(Q), len(self.pairs)), enough))

    def apart(self, Q: Array, D: Array, enough: float) -> Array:
        """Lower bound, m, of every pair's distance while |q_j - Q_j| <= D_j; Q, D (N, n), result (N, P).

        That of `distances` less `travel`, or less than that where balls alone prove more than `enough`, m.
        """
        poses = self.kinematics.poses(Q)
        travel = self._own_travel(poses, D)[:, self._mover_of].sum(axis=2)
        return np.asarray(self._distances(poses, travel + enough) - travel)

    def _distances(self, joint_poses: Array, enough: Array) -> Array:
        """As `distances`, but only of the balls where these are farther apart than `enough`, (N, P)."""
        poses = joint_poses[:, self.joint] @ self.placement  # X_WG of every body, (N, G, 4, 4)
        rotation, origin = poses[..., :3, :3], poses[..., :3, 3]
        centre = origin + (rotation @ self.centre[:, :, None])[..., 0]
        a, b = self.pairs.T
        apart = centre[:, b] - centre[:, a]
        result = np.sqrt(np.einsum("npi,npi->np", apart, apart)) - (self.radius[a] + self.radius[b])
        rows, pairs = np.nonzero(result <= enough)
        apart, found = apart[rows, pairs], np.full(len(rows), -np.inf)
        for box, ball, way in ((b[pairs], a[pairs], -apart), (a[pairs], b[pairs], apart)):
            found = np.maximum(found, ball_to_box(rotation[rows, box], way, self.half[box], self.radius[ball]))
        result[rows, pairs] = found
        for pair in self.plane_pairs:
            plane, body = a[pair], b[pair]
            if int(plane) not in self._plane_of:
                plane, body = body, plane
            normal, offset = self._plane_of[int(plane)]
            world_normal = rotation[:, plane] @ normal
            height = np.einsum("ni,ni->n", world_normal, centre[:, body] - origin[:, plane]) - offset
            result[:, pair] = height - self.radius[body]
        return np.asarray(result)

    def travel(self, Q: Array, D: Array) -> Array:
        """Bound, m, on the change of every pair's distance while |q_j - Q_j| <= D_j; Q, D (N, n), result (N, P)."""
        return np.asarray(self._own_travel(self.kinematics.poses(Q), D)[:, self._mover_of].sum(axis=2))

    def travel_of(self, Q: Array, D: Array, rows: Index, pairs: Index) -> Array:
        """Return the travel bound (K,) of chosen pairs: entry k is pair `pairs[k]` at configuration `Q[rows[k]]`.

        Joints are moved one after another, from the tip to the base. A joint j that turns by at most D_j moves every
        point of the body by at most D_j times the point's distance from the axis. That distance is at most R_j, taken
        at Q, plus the travel t that the joints nearer to the tip have caused already: t <- t + D_j (R_j + t). A
        prismatic joint adds D_j. Both bodies of a pair move against the joint that carries both.
        """
        own = self._own_travel(self.kinematics.poses(Q), D)
        return np.asarray(own[rows[:, None], self._mover_of[pairs]].sum(axis=1))

    def _own_travel(self, poses: Array, D: Array) -> Array:
        """How far each body is moved at most by those joints that move it in a pair, (N, U), m; see `travel_of`."""
        step = self.kinematics.joint_reach(D)[:, :, None] * self._mover_joints.T  # (N, J, U)
        reach, own = self._axis_distances(poses), np.zeros((len(D), len(self._mover)))
        for j in reversed(range(step.shape[1])):
            own += step[:, j] * ((reach[:, j] + own) if self.kinematics.revolute[j] else 1.0)
        return own

    def place(self, Q: Array, pairs: Index) -> tuple[Array, Array]:
        """Poses in the world for K pairs, each at a configuration of its own, Q (K, n).

        Returns:
            Those of all joints, (K, n + 1, 4, 4), and of bodies a and b, (K, 2, 4, 4).
        """
        poses = self.kinematics.poses(Q)
        bodies = self.pairs[pairs]
        return poses, poses[np.arange(len(Q))[:, None], self.joint[bodies]] @ self.placement[bodies]

    def distances_of(self, placed: Array, pairs: Index) -> Array:
        """The bound of `distances` for K pairs without half-spaces, placed (K, 2, 4, 4); result (K,), m."""
        rotation, bodies = placed[..., :3, :3], self.pairs[pairs]
        centre = placed[..., :3, 3] + np.einsum("ksij,ksj->ksi", rotation, self.centre[bodies])
        result = np.full(len(pairs), -np.inf)
        for box, ball in ((0, 1), (1, 0)):
            apart = centre[:, ball] - centre[:, box]
            half, radius = self.half[bodies[:, box]], self.radius[bodies[:, ball]]
            result = np.maximum(result, ball_to_box(rotation[:, box], apart, half, radius))
        return result

    def steps_of(self, poses: Array, placed: Array, D: Array, pairs: Index) -> Array:
        """Bound each planned joint's share, followers included, in the change of a pair's distance; (K, n), m.

        It holds while |q_j - Q_j| <= D_j.

        As in `travel_of`, for K pairs at poses of their own and with the ball about each body in place of its corners.
        A revolute joint moves a point by the chord 2 sin(min(D_j, pi) / 2) times its distance from the axis.

        Args:
            poses: of the joints, (K, n + 1, 4, 4), world.
            placed: of the bodies, (K, 2, 4, 4), world.
            D: half widths, (K, n), rad or m.
            pairs: (K,).
        """
        direction, point = self.kinematics.axes(poses)
        revolute, D = self.kinematics.revolute > 0.5, self.kinematics.joint_reach(D)  # (J,), (K, J)
        stroke = np.where(revolute, 2.0 * np.sin(0.5 * np.minimum(D, np.pi)), D)
        total = np.zeros_like(D)
        for side in (0, 1):
            bodies = self.pairs[pairs, side]
            centre = np.einsum("kij,kj->ki", placed[:, side, :3, :3], self.centre[bodies]) + placed[:, side, :3, 3]
            arm = np.linalg.norm(np.cross(direction, centre[:, None] - point), axis=2) + self.radius[bodies, None]
            step = stroke * self.moves[pairs, side]
            own = np.zeros(len(pairs))
            for j in reversed(range(D.shape[1])):
                moved = step[:, j] * ((arm[:, j] + own) if revolute[j] else 1.0)
                total[:, j] += moved
                own = own + moved
        return np.asarray(total @ (np.abs(self.kinematics.coupling) > 0.0))  # each joint has one leader

    def meeting(self, Q: Array, gap: float) -> MeetingPairs:
        """Find the pairs whose bounding volumes are nearer than `gap`, m, at Q (N, n): by balls, then by boxes."""
        poses = self.kinematics.poses(Q)[:, self.joint] @ self.placement
        centre = np.einsum("ngij,gj->ngi", poses[..., :3, :3], self.centre) + poses[..., :3, 3]
        a, b = self.pairs.T
        apart = centre[:, b] - centre[:, a]
        rows, pairs = np.nonzero(np.einsum("npi,npi->np", apart, apart) <= (self.radius[a] + self.radius[b] + gap) ** 2)
        placed = poses[rows[:, None], self.pairs[pairs]]
        meet = self.distances_of(placed, pairs) <= gap
        return MeetingPairs(rows[meet], pairs[meet], placed[meet])

    def reach_of(self, q: Array, pairs: Index) -> Array:
        """Upper bound, m, of the distance of K pairs at one configuration q (n,): that of the farthest points."""
        poses = self.kinematics.poses(q[None])[0, self.joint] @ self.placement
        centre = np.einsum("gij,gj->gi", poses[:, :3, :3], self.centre) + poses[:, :3, 3]
        a, b = self.pairs[pairs].T
        return np.asarray(np.linalg.norm(centre[b] - centre[a], axis=1) + self.radius[a] + self.radius[b])

    def moment_arms(self, stroke: Array) -> Array:
        """Metres that a pair's bodies travel against each other at most for each rad or m of each joint: (P, n).

        Holds at: every configuration with |q_j| <= stroke_j (n,). Along a straight motion by d, the distance of pair p
        changes by at most sum_j moment_arms[p, j] |d_j|.
        """
        moved = np.flatnonzero(self.joint)
        corners = np.ascontiguousarray((self.placement[moved] @ self._corners[moved])[:, :3].swapaxes(1, 2))
        key = digest([stroke.tobytes(), self.joint[moved].tobytes(), corners.tobytes()])
        bodies = np.zeros((len(self.joint), len(self.kinematics.revolute)))
        bodies[moved] = _kept_arms(self.kinematics).get(key, lambda: self._arms(self.joint[moved], corners, stroke))
        both = bodies[self.pairs] * self.moves  # (P, 2, J)
        return self.kinematics.planned_bound(both.sum(axis=1))

    def _arms(self, joints: Index, corners: Array, stroke: Array) -> Array:
        """`BatchKinematics.moment_arms` (M, J) of M bodies, their corners (M, 8, 3) fixed to joints (M,)."""
        found = np.zeros((len(joints), len(self.kinematics.revolute)))
        for joint in distinct(joints).tolist():
            own = joints == joint
            found[own] = self.kinematics.moment_arms(joint, corners[own], stroke)
        return found

    def body_reaches(self) -> Array:
        """Distance, m, of the farthest corner of every body's box from the origin of its joint, (G,)."""
        corners = (self.placement @ self._corners)[:, :3].swapaxes(1, 2)
        return np.asarray(np.linalg.norm(corners, axis=2).max(axis=1, initial=0.0))

    def _axis_distances(self, poses: Array) -> Array:
        """Distance, m, of the farthest corner of the box of the bodies that move from each joint axis: (N, J, U).

        `poses` (N, J + 1, 4, 4) are those of the joints. A body that no joint moves counts as 0.
        """
        moving = self._mover_joints.any(axis=1)
        bodies, which = np.unique(self._mover[moving], return_inverse=True)
        corners = poses[:, self.joint[bodies]] @ (self.placement[bodies] @ self._corners[bodies])
        flat = corners.transpose(0, 2, 3, 1).reshape(len(poses), 4, -1)  # (N, 4, 8 bodies)
        across = self.kinematics.across_axes(poses)
        joints = across.shape[1] // 2
        squared = across @ flat
        np.square(squared, out=squared)
        squared = squared[:, :joints] + squared[:, joints:]
        for _ in range(3):  # the largest of the eight
            half = squared.shape[2] // 2
            squared = np.maximum(squared[..., :half], squared[..., half:])
        reach = np.zeros((len(poses), joints, len(self._mover)))
        reach[:, :, moving] = (np.sqrt(squared) + 1e-6)[:, :, which]  # rounding is far less within 10 m of the origin
        return reach

    def witness_gradients(self, Q: Array, pairs: Index, points: Array, normals: Array) -> Array:
        """N . (J_b - J_a) for K contacts: Q (K, n), points (K, 2, 3) on bodies a and b, normals (K, 3); result (K, n).

        Column j of the Jacobian of a point p is axis_j x (p - o_j) for a revolute joint, axis_j for a prismatic one.
        The column of a follower, times its multiplier, is added to that of its leader.
        """
        direction, origin = self.kinematics.axes(self.kinematics.poses(Q))
        total = np.zeros(direction.shape[:2])
        for side, sign in ((0, -1.0), (1, 1.0)):
            arm = points[:, side, None] - origin
            column = np.where(self.kinematics.revolute[None, :, None] > 0.5, np.cross(direction, arm), direction)
            total += sign * self.moves[pairs, side] * np.einsum("kji,ki->kj", column, normals)
        return self.kinematics.of_planned(total)


def ball_to_box(rotation: Array, apart: Array, half: Array, radius: Array) -> Array:
    """Distance (K,), m, of balls from boxes.

    Args:
        rotation: (K, 3, 3) of the boxes.
        apart: (K, 3) from the centre of one to that of the other, m.
        half: (K, 3) half edges of the boxes, m.
        radius: (K,) of the balls, m.
    """
    local = (apart[:, None] @ rotation)[:, 0]
    outside = np.maximum(np.abs(local) - half, 0.0)
    return np.asarray(np.sqrt(np.einsum("ki,ki->k", outside, outside)) - radius)


@once_for_each
def _kept_arms(_kinematics: BatchKinematics) -> MostRecent[Array]:
    """Moment arms of bodies that joints carry, by their joints, corners and the strokes: those of few robots."""
    return MostRecent(8)


def _placements(bodies: Sequence[pin.GeometryObject]) -> Array:
    return np.array([body.placement.homogeneous for body in bodies]).reshape(-1, 4, 4)


def local_box(geometry: coal.CollisionGeometry) -> LocalBox:
    """Centre (3,), half edges (3,) and ball radius, m, of a body in its own frame; a half-space has no bounds."""
    if isinstance(geometry, coal.Halfspace):
        return LocalBox(np.zeros(3), np.full(3, np.inf), np.inf)
    geometry.computeLocalAABB()
    low, high = np.array(geometry.aabb_local.min_), np.array(geometry.aabb_local.max_)
    centre, half = 0.5 * (low + high), 0.5 * (high - low)
    if isinstance(geometry, coal.Sphere):
        return LocalBox(centre, half, float(geometry.radius))
    if isinstance(geometry, coal.ConvexBase):
        vertices = np.array(geometry.points())
        return LocalBox(centre, half, float(np.linalg.norm(vertices - centre, axis=1).max()))
    return LocalBox(centre, half, float(np.linalg.norm(half)))
