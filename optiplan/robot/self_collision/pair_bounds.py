"""Bounds and gradients of pair distances without coal queries, for many configurations at once."""

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Flags, Index
from optiplan.robot.batch_fk import BatchKinematics, carrying_joints


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

    def __init__(self, model: pin.Model, geometry: pin.GeometryModel, pairs: list[tuple[int, int]]) -> None:
        self.kinematics = BatchKinematics(model)
        bodies = list(geometry.geometryObjects)
        self.joint = np.array([int(body.parentJoint) for body in bodies], dtype=np.intp)
        self.placement = np.array([body.placement.homogeneous for body in bodies]).reshape(-1, 4, 4)
        boxes = [_local_box(body.geometry) for body in bodies]
        self.centre = np.array([box[0] for box in boxes]).reshape(-1, 3)
        self.half = np.array([box[1] for box in boxes]).reshape(-1, 3)
        self.radius = np.array([box[2] for box in boxes])
        signs = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
        edges = np.where(np.isfinite(self.half), self.half, 0.0)
        self._corners = self.centre[:, None] + edges[:, None] * signs  # (G, 8, 3)
        self.pairs: Index = np.array(pairs, dtype=np.intp).reshape(-1, 2)
        moves = carrying_joints(model)[self.joint[self.pairs]]  # (P, 2, J)
        # A joint that carries both bodies of a pair does not change their distance.
        self.moves = moves & ~moves[:, ::-1]
        self.depends: Flags = self.kinematics.joint_dependence(np.asarray(self.moves.any(axis=1)))
        planes = [isinstance(body.geometry, coal.Halfspace) for body in bodies]
        self.plane_pairs: Index = np.flatnonzero(np.array(planes, dtype=bool)[self.pairs].any(axis=1))
        self._plane_of = {g: (np.array(bodies[g].geometry.n), bodies[g].geometry.d) for g, p in enumerate(planes) if p}

    def distances(self, Q: Array) -> Array:
        """Lower bound, m, of every pair's distance at Q (N, n): (N, P).

        The larger of the distances from the ball of one body to the box of the other, both ways.
        """
        poses = self.kinematics.poses(Q)[:, self.joint] @ self.placement  # X_WG of every body, (N, G, 4, 4)
        rotation, origin = poses[..., :3, :3], poses[..., :3, 3]
        centre = origin + np.einsum("ngij,gj->ngi", rotation, self.centre)
        a, b = self.pairs[:, 0], self.pairs[:, 1]
        result = np.maximum(
            self._ball_to_box(rotation[:, b], centre[:, a] - centre[:, b], b, a),
            self._ball_to_box(rotation[:, a], centre[:, b] - centre[:, a], a, b),
        )
        for pair in self.plane_pairs:
            plane, body = a[pair], b[pair]
            if int(plane) not in self._plane_of:
                plane, body = body, plane
            normal, offset = self._plane_of[int(plane)]
            world_normal = rotation[:, plane] @ normal
            height = np.einsum("ni,ni->n", world_normal, centre[:, body] - origin[:, plane]) - offset
            result[:, pair] = height - self.radius[body]
        return np.asarray(result)

    def _ball_to_box(self, rotation: Array, apart: Array, box: Index, ball: Index) -> Array:
        local = np.einsum("npji,npj->npi", rotation, apart)
        outside = np.maximum(np.abs(local) - self.half[box], 0.0)
        return np.asarray(np.sqrt(np.einsum("npi,npi->np", outside, outside)) - self.radius[ball])

    def travel(self, Q: Array, D: Array) -> Array:
        """Bound, m, on the change of every pair's distance while |q_j - Q_j| <= D_j; Q, D (N, n), result (N, P)."""
        everything = np.arange(len(self.pairs))
        rows, pairs = np.repeat(np.arange(len(Q)), len(everything)), np.tile(everything, len(Q))
        return self.travel_of(Q, D, rows, pairs).reshape(len(Q), len(everything))

    def travel_of(self, Q: Array, D: Array, rows: Index, pairs: Index) -> Array:
        """Return the travel bound (K,) of chosen pairs: entry k is pair `pairs[k]` at configuration `Q[rows[k]]`.

        Joints are moved one after another, from the tip to the base. A joint j that turns by at most D_j moves every
        point of the body by at most D_j times the point's distance from the axis. That distance is at most R_j, taken
        at Q, plus the travel t that the joints nearer to the tip have caused already: t <- t + D_j (R_j + t). A
        prismatic joint adds D_j. Both bodies of a pair move against the joint that carries both.
        """
        reach, D = self._axis_distances(Q), self.kinematics.joint_reach(D)  # (N, G, J), (N, J)
        moved = np.zeros(len(rows))
        for side in (0, 1):
            radius = reach[rows, self.pairs[pairs, side]]  # (K, J)
            step = D[rows] * self.moves[pairs, side]
            own = np.zeros(len(rows))
            for j in reversed(range(D.shape[1])):
                own = own + step[:, j] * ((radius[:, j] + own) if self.kinematics.revolute[j] else 1.0)
            moved += own
        return moved

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
            found = self._ball_to_box(rotation[None, :, box], apart[None], bodies[:, box], bodies[:, ball])
            result = np.maximum(result, found[0])
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

    def meeting(self, Q: Array, gap: float) -> tuple[Index, Index, Array]:
        """Pairs whose bounding volumes come nearer than `gap` (m) at Q (N, n): balls against balls first, then boxes.

        Returns:
            Row of Q and pair of each of the K found, and poses of both bodies in the world, (K, 2, 4, 4).
        """
        poses = self.kinematics.poses(Q)[:, self.joint] @ self.placement
        centre = np.einsum("ngij,gj->ngi", poses[..., :3, :3], self.centre) + poses[..., :3, 3]
        a, b = self.pairs.T
        apart = centre[:, b] - centre[:, a]
        rows, pairs = np.nonzero(np.einsum("npi,npi->np", apart, apart) <= (self.radius[a] + self.radius[b] + gap) ** 2)
        placed = poses[rows[:, None], self.pairs[pairs]]
        meet = self.distances_of(placed, pairs) <= gap
        return rows[meet], pairs[meet], placed[meet]

    def reach_of(self, q: Array, pairs: Index) -> Array:
        """Upper bound, m, of the distance of K pairs at one configuration q (n,): that of the farthest points."""
        poses = self.kinematics.poses(q[None])[0, self.joint] @ self.placement
        centre = np.einsum("gij,gj->gi", poses[:, :3, :3], self.centre) + poses[:, :3, 3]
        a, b = self.pairs[pairs].T
        return np.asarray(np.linalg.norm(centre[b] - centre[a], axis=1) + self.radius[a] + self.radius[b])

    def moment_arms(self, stroke: Array) -> Array:
        """Metres that a pair's bodies travel against each other at most for each rad or m of each joint: (P, n).

        Holds at: every configuration with |q_j| <= stroke_j (n,), so that along a straight motion by d the distance of
        pair p changes by at most sum_j moment_arms[p, j] |d_j|.
        """
        corners = np.einsum("gij,gkj->gki", self.placement[:, :3, :3], self._corners) + self.placement[:, None, :3, 3]
        bodies = [self.kinematics.moment_arms(int(j), x, stroke) for j, x in zip(self.joint, corners, strict=True)]
        both = np.array(bodies).reshape(-1, len(self.kinematics.revolute))[self.pairs] * self.moves  # (P, 2, J)
        return self.kinematics.planned_bound(both.sum(axis=1))

    def body_reaches(self) -> Array:
        """Distance, m, of the farthest corner of every body's box from the origin of its joint, (G,)."""
        corners = np.einsum("gij,gkj->gki", self.placement[:, :3, :3], self._corners) + self.placement[:, None, :3, 3]
        return np.asarray(np.linalg.norm(corners, axis=2).max(axis=1, initial=0.0))

    def _axis_distances(self, Q: Array) -> Array:
        """Distance, m, of the farthest corner of every body's box from every joint axis at Q (N, n): (N, G, J)."""
        poses = self.kinematics.poses(Q)
        direction, point = self.kinematics.axes(poses)  # (N, J, 3)
        placed = poses[:, self.joint] @ self.placement
        corners = np.einsum("ngij,gkj->ngki", placed[..., :3, :3], self._corners) + placed[:, :, None, :3, 3]
        flat = corners.reshape(len(Q), -1, 3)
        along = flat @ direction.transpose(0, 2, 1) - np.einsum("nji,nji->nj", point, direction)[:, None]
        squared = (
            np.einsum("nki,nki->nk", flat, flat)[:, :, None]
            - 2.0 * flat @ point.transpose(0, 2, 1)
            + np.einsum("nji,nji->nj", point, point)[:, None]
            - along**2
        )
        # The difference of squares loses half the digits near the axis: 1e-6 m covers it within 10 m of the origin.
        farthest = np.sqrt(np.maximum(squared, 0.0)).reshape(*corners.shape[:3], direction.shape[1]).max(axis=2) + 1e-6
        return np.asarray(farthest)

    def witness_gradients(self, Q: Array, pairs: Index, points: Array, normals: Array) -> Array:
        """N . (J_b - J_a) for K contacts: Q (K, n), points (K, 2, 3) on bodies a and b, normals (K, 3); result (K, n).

        Column j of the Jacobian of a point p is axis_j x (p - o_j) for a revolute joint, axis_j for a prismatic one;
        that of a follower counts for its leader, times the multiplier.
        """
        direction, origin = self.kinematics.axes(self.kinematics.poses(Q))
        total = np.zeros(direction.shape[:2])
        for side, sign in ((0, -1.0), (1, 1.0)):
            arm = points[:, side, None] - origin
            column = np.where(self.kinematics.revolute[None, :, None] > 0.5, np.cross(direction, arm), direction)
            total += sign * self.moves[pairs, side] * np.einsum("kji,ki->kj", column, normals)
        return self.kinematics.of_planned(total)


def _local_box(geometry: coal.CollisionGeometry) -> tuple[Array, Array, float]:
    """Centre (3,), half edges (3,) and ball radius, m, of a body in its own frame; a half-space has no bounds."""
    if isinstance(geometry, coal.Halfspace):
        return np.zeros(3), np.full(3, np.inf), np.inf
    geometry.computeLocalAABB()
    low, high = np.array(geometry.aabb_local.min_), np.array(geometry.aabb_local.max_)
    centre, half = 0.5 * (low + high), 0.5 * (high - low)
    if isinstance(geometry, coal.Sphere):
        return centre, half, float(geometry.radius)
    if isinstance(geometry, coal.ConvexBase):
        vertices = np.array(geometry.points())
        return centre, half, float(np.linalg.norm(vertices - centre, axis=1).max())
    return centre, half, float(np.linalg.norm(half))
