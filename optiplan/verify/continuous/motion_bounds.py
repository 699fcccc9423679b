"""Bound the approach of two bodies in a short interval by their velocities and accelerations."""

from copy import copy
from dataclasses import dataclass

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.verify.continuous.bodies import Bodies, PlacedBody


@dataclass(frozen=True, eq=False)
class Boxes:
    """Bounds of joint motions on N intervals of half width `half` (N,), s, about their middles; the rest is (N, n).

    Attributes:
        q: configuration at the middle; `v`: velocity there.
        reach: bound on |q_j(t) - q_j(middle)|; `speed`, `acceleration`: bounds on |q_j'|, |q_j''| over the interval.
        jump: a tolerated step of position at the ends, contained in `reach` and in no derivative.
    """

    half: Array
    q: Array
    v: Array
    reach: Array
    speed: Array
    acceleration: Array
    jump: Array


@dataclass(frozen=True, eq=False)
class DistanceQuery:
    """K queries: pair pairs[k] on interval rows[k], where `placed` has its bodies.

    `direction` and `point`, both (N, J, 3), are all joints' axes in the world at the middles of all N intervals.
    """

    rows: Index
    pairs: Index
    placed: PlacedBody
    direction: Array
    point: Array


@dataclass(frozen=True, eq=False)
class SeparationRate:
    """Bounds for K pairs on their intervals, all (K,), m.

    Attributes:
        travel: change of distance, whatever the direction.
        linear: lower bound of the gap along the normal, were every point to keep its velocity of the middle.
        curvature_loss: how far acceleration can take the gap below that.
    """

    travel: Array
    linear: Array
    curvature_loss: Array


class Motion:
    """Bounds on the relative motion of the pairs of bodies; joints that carry both bodies of a pair do not count."""

    def __init__(self, bodies: Bodies) -> None:
        self._bodies = bodies
        self._revolute = bodies.kinematics.revolute > 0.5
        self._turns, self._slides = bodies.kinematics.revolute, 1.0 - bodies.kinematics.revolute
        self._moves = np.ascontiguousarray(bodies.moves.swapaxes(0, 1), float)  # (2, P, J), 1 or 0
        self._centre = bodies.centre[bodies.pairs.T]  # (2, P, 3)
        # A half-space has no farthest point, and must not move: then its levers are multiplied by zero.
        self._radius = np.where(self._moves.any(axis=2), bodies.radius[bodies.pairs.T], 0.0)  # (2, P)

    def with_obstacles_of(self, bodies: Bodies) -> "Motion":
        """Return the same of bodies of which obstacles stand elsewhere."""
        twin = copy(self)
        twin._bodies = bodies
        return twin

    def separation_rate(self, boxes: Boxes, query: DistanceQuery, normals: Array) -> SeparationRate:
        """Bounds for K pairs on their intervals, with unit normals w (K, 3) from a to b at the middle.

        For a point x of a body let f(s) = w . x(middle + s). Then |f(s) - f(0) - f'(0) s| <= F s^2 / 2 with
            F = sum_j A_j L_j + sum_k L_k V_k (V_k + 2 sum_{j<k} V_j) >= |x''|,
        where V and A bound the joints' speed and acceleration and L_j the distance of x from axis j (1 for a prismatic
        joint), because the second partial derivative of x in q_j and q_k is no longer than L of the joint nearer to the
        tip. With Omega, u the body's twist at the middle, f(0) + f'(0) s = x . (w + s w x Omega) + s w . u, whose
        maximum over the body is a support function, convex in s: so its maximum for |s| <= h is at s = h or -h.
        """
        boxes = self._of_all_joints(boxes)
        rows, half = query.rows, boxes.half[query.rows]
        moves = self._moves[:, query.pairs]  # (2, K, J), as all that follows
        axes = query.direction[rows], query.point[rows]
        lever, travel = self._moment_arms(boxes.reach[rows] * moves, query, axes)
        speed, acceleration = boxes.speed[rows] * moves, boxes.acceleration[rows] * moves
        before = np.cumsum(speed, axis=2) - speed
        curve = np.einsum("skj,skj->sk", lever, acceleration + speed * (speed + 2.0 * before))
        jump = np.einsum("skj,skj->sk", boxes.jump[rows] * moves, lever)
        omega, u = self._twist(boxes.v[rows] * moves, *axes)
        sign = np.array([1.0, -1.0])[:, None, None]  # of side a and b
        turn, shift = _cross(normals, omega), np.einsum("ski,ki->sk", u, normals)
        s = np.array([1.0, -1.0])[:, None, None] * half  # at both ends
        direction = sign * (normals + s[..., None] * turn)  # (2 ends, 2 sides, K, 3)
        height = self._bodies.support(query.placed, direction) + sign[..., 0] * s * shift
        linear = np.minimum(*-(height[:, 0] + height[:, 1]))
        linear[np.isnan(linear)] = -np.inf
        loss = 0.5 * half**2 * curve + jump
        return SeparationRate(travel[0] + travel[1], linear, loss[0] + loss[1])

    def _of_all_joints(self, boxes: Boxes) -> Boxes:
        """Return the bounds of all J joints: a follower moves by its multiplier times what its leader does."""
        kinematics = self._bodies.kinematics
        if not kinematics.follows:
            return boxes
        bounds = (boxes.reach, boxes.speed, boxes.acceleration, boxes.jump)
        reach, speed, acceleration, jump = map(kinematics.joint_reach, bounds)
        q, v = kinematics.joint_rates(boxes.q) + kinematics.offset, kinematics.joint_rates(boxes.v)
        return Boxes(boxes.half, q, v, reach, speed, acceleration, jump)

    def _moment_arms(self, step: Array, query: DistanceQuery, axes: tuple[Array, Array]) -> tuple[Array, Array]:
        """L (2, K, J), the farthest any point of the body gets from each axis on the interval, and its travel (2, K).

        Both in m, of sides a and b. Joints are moved one after another, from the tip to the base. When joint j turns,
        about its axis at the middle, the body has travelled t already: its points are within R_j + t of the axis and
        move by at most D_j (R_j + t).

        Args:
            step: (2, K, J) D, the bounds on how far each joint that moves the side goes, rad or m.
            query: the pairs, and where they are.
            axes: direction and a point of all joints' axes, (K, J, 3) each.
        """
        direction, point = axes
        poses, pairs = query.placed.poses.swapaxes(0, 1), query.pairs
        centre = (poses[..., :3, :3] @ self._centre[:, pairs, :, None])[..., 0] + poses[..., :3, 3]
        arm = _cross(direction, centre[:, :, None] - point)
        lever = np.sqrt(np.einsum("skji,skji->skj", arm, arm)) + self._radius[:, pairs, None]
        lever[..., ~self._revolute] = 1.0
        travelled = np.zeros(step.shape[:2])
        for j in reversed(range(lever.shape[2])):
            if self._revolute[j]:
                lever[..., j] += travelled
            travelled += step[..., j] * lever[..., j]
        return lever, travelled

    def _twist(self, v: Array, direction: Array, point: Array) -> tuple[Array, Array]:
        """Angular velocity (2, K, 3), rad/s, and velocity (2, K, 3), m/s, of the body's point at the world's origin."""
        turning = (v * self._turns)[..., None, :]
        slide = (v * self._slides)[..., None, :] @ direction
        return (turning @ direction)[..., 0, :], (turning @ _cross(point, direction) + slide)[..., 0, :]


def _cross(a: Array, b: Array) -> Array:
    result = np.empty(np.broadcast_shapes(a.shape, b.shape))
    result[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    result[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    result[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return result
