"""Bounds on how the pose of one frame in another changes in a short interval."""

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Flags
from optiplan.records import dataclass
from optiplan.robot.batched.kinematics import inverse_poses
from optiplan.robot.robot import Robot
from optiplan.verify.continuous.motion_bounds import Boxes


@dataclass(frozen=True, eq=False)
class FrameBounds:
    """Bounds on K intervals, all (K,), of the pose X_AF(t) of a frame F in a frame A.

    Attributes:
        travel: |p(t) - p(middle)| of F's origin, m; `turn`: angle between R(t) and R(middle), rad.
        curvature: |p''|, m/s²; `turn_curvature`: |(R e)''| of every unit vector e, 1/s².
        step: what tolerated steps of position at the ends move F's origin by, m; `turn_step`: turn it by, rad.
    """

    travel: Array
    turn: Array
    curvature: Array
    turn_curvature: Array
    step: Array
    turn_step: Array


class FrameMotion:
    """The pose of a frame in the world or in another frame along a motion, and bounds on how it changes.

    Only joints that carry one of the two frames and not the other move them against each other. Taken in the order of
    the chain from A to F, with L_j the distance of F's origin from the axis of joint j (1 where it slides), V and A
    bounds on the joints' speed and acceleration:
        |p''| <= sum_j A_j L_j + sum_k L_k V_k (V_k + 2 sum_{j<k} V_j),
    because the second partial derivative of p in q_j and q_k is no longer than L of the joint nearer to F
    (`motion_bounds.Motion`). A unit vector fixed to F obeys the same with L = 1 for joints that turn and 0 for others.
    """

    def __init__(self, robot: Robot, frame: str, base: str | None = None) -> None:
        self.kinematics = robot.kinematics
        self._joint, self._placement = _placed(robot, frame)
        self._base_joint, self._base_placement = (0, np.eye(4)) if base is None else _placed(robot, base)
        carried = self.kinematics.carries
        own, other = carried[self._joint], carried[self._base_joint]
        after = np.flatnonzero(own & ~other)
        self._chain = np.concatenate([np.flatnonzero(other & ~own)[::-1], after])
        self._turns: Flags = self.kinematics.revolute[self._chain] > 0.5

    def poses(self, Q: Array) -> Array:
        """X_AF at configurations Q (N, n): (N, 4, 4)."""
        joints = self.kinematics.poses(Q)
        return np.asarray(inverse_poses(joints[:, self._base_joint] @ self._base_placement) @ self._world(joints))

    def twists(self, Q: Array, V: Array) -> tuple[Array, Array]:
        """Velocity of F's origin, m/s, and angular velocity, rad/s, in the world, each (N, 3); of A at rest only."""
        joints = self.kinematics.poses(Q)
        direction, point = self.kinematics.axes(joints)
        rates = self.kinematics.joint_rates(V)[:, self._chain]
        direction, arm = direction[:, self._chain], self._world(joints)[:, None, :3, 3] - point[:, self._chain]
        linear = np.where(self._turns[:, None], np.cross(direction, arm), direction)
        angular = np.where(self._turns[:, None], direction, 0.0)
        return np.einsum("kj,kji->ki", rates, linear), np.einsum("kj,kji->ki", rates, angular)

    def bounds(self, boxes: Boxes) -> FrameBounds:
        """Bounds on intervals with these bounds of the joints' motion."""
        kinematics, chain = self.kinematics, self._chain
        reach, speed, acceleration, jump = (
            kinematics.joint_reach(bound)[:, chain]
            for bound in (boxes.reach, boxes.speed, boxes.acceleration, boxes.jump)
        )
        joints = kinematics.poses(boxes.q)
        direction, point = kinematics.axes(joints)
        arm = np.cross(direction[:, chain], self._world(joints)[:, None, :3, 3] - point[:, chain])
        lever = np.where(self._turns, np.linalg.norm(arm, axis=2), 1.0)
        travelled = np.zeros(len(lever))
        for j in reversed(range(len(chain))):  # joints move one after another, from F to A
            if self._turns[j]:
                lever[:, j] += travelled
            travelled = travelled + reach[:, j] * lever[:, j]
        before = np.cumsum(speed, axis=1) - speed
        curvatures = acceleration + speed * (speed + 2.0 * before)
        turning = speed * self._turns
        turns_before = np.cumsum(turning, axis=1) - turning
        turn_curvatures = self._turns * (acceleration + turning * (turning + 2.0 * turns_before))
        turn, turn_step = ((bound * self._turns).sum(axis=1) for bound in (reach, jump))
        curvature, step = ((lever * bound).sum(axis=1) for bound in (curvatures, jump))
        return FrameBounds(travelled, turn, curvature, turn_curvatures.sum(axis=1), step, turn_step)

    def _world(self, joints: Array) -> Array:
        return np.asarray(joints[:, self._joint] @ self._placement)


def _placed(robot: Robot, frame: str) -> tuple[int, Array]:
    """The joint that carries a frame, and the frame's pose there (4, 4)."""
    found: pin.Frame = robot.model.frames[robot.frame_id(frame)]
    return int(found.parentJoint), np.array(found.placement.homogeneous)
