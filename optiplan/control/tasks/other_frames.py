"""Tasks of a frame in another frame of the robot, and of a frame that looks at a point."""

from typing import ClassVar

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.control.arguments import checked_direction, checked_vector, frame_index, pose_cost
from optiplan.control.configuration import Configuration
from optiplan.control.tasks.base import MovedFrameTask, Weight, capped
from optiplan.control.tasks.targets import Target, as_pose
from optiplan.robot.robot import Robot

_STRAIGHT = 1e-6
"""Sine of the angle below which an axis points straight at its point, or straight away from it."""
_AWAY = np.array([1.0, 0.0])
"""Across the axis: in which direction one that points straight away turns."""


class RelativePoseTask(MovedFrameTask):
    """Frame F at a pose T in another frame R of the robot: e = (p_RF - p_RT, log(R_TF)), in the axes of R and F.

    J = (R_RW (J_vF - J_vR + [p_WF - p_WR]× J_wR), Jlog(R_TF) R_FW (J_wF - J_wR)).

    Args:
        frame: name of F; `root`: name of R, such as the other hand.
        target: X_RT; None: as they stand in the first step.
        position_cost: per metre, one or three; `orientation_cost`: per radian.
        gain: 1/s; None: as large as the robot's jerk limits allow.
        priority: see `ControlTask`.
    """

    name: ClassVar[str] = "relative pose"
    components = ("x", "y", "z", "rotation x", "rotation y", "rotation z")

    def __init__(
        self,
        frame: str,
        root: str,
        target: Target | None = None,
        position_cost: Weight = 1.0,
        orientation_cost: Weight = 1.0,
        gain: float | None = None,
        priority: int = 0,
    ) -> None:
        super().__init__(frame, 6, 1.0, gain, priority)
        self.cost = pose_cost(self, position_cost, orientation_cost)
        self.root, self._root = root, -1
        self._target = None if target is None else as_pose(self, target)

    def bind(self, robot: Robot) -> None:
        """Find F and R."""
        super().bind(robot)
        self._root = frame_index(self, "root", robot, self.root)

    @property
    def target(self) -> pin.SE3 | None:
        """X_RT."""
        return self._target

    @target.setter
    def target(self, pose: Target) -> None:
        self._target = as_pose(self, pose)

    def error(self, c: Configuration) -> Array:
        """(6,), m and rad."""
        X_RF = self._relative(c)
        return np.concatenate([X_RF.translation - self._held.translation, pin.log3(self._turned(X_RF))])

    def jacobian(self, c: Configuration) -> Array:
        """(6, n)."""
        X_RF = self._relative(c)
        X_WF, X_WR = c.pose(self._frame), c.pose(self._root)
        J_F, J_R = c.jacobian(self._frame), c.jacobian(self._root)
        arm = pin.skew(X_WF.translation - X_WR.translation)
        linear = X_WR.rotation.T @ (J_F[:3] - J_R[:3] + arm @ J_R[3:])
        angular = pin.Jlog3(self._turned(X_RF)) @ X_WF.rotation.T @ (J_F[3:] - J_R[3:])
        return np.vstack([linear, angular])

    def wanted_rate(self, e: Array) -> Array:
        """See `MovedFrameTask`."""
        return self._pose_rate(e)

    def _relative(self, c: Configuration) -> pin.SE3:
        X_RF = c.pose(self._root).actInv(c.pose(self._frame))
        self._held = pin.SE3(X_RF) if self._target is None else self._target
        self._target = self._held
        return X_RF

    def _turned(self, X_RF: pin.SE3) -> Array:
        return np.asarray(self._held.rotation.T @ X_RF.rotation)


class LookAtTask(MovedFrameTask):
    """An axis of a frame F towards a point P of the world, such as a camera's; F may turn about that axis.

    With the direction d = R_FW (P - p_WF) / |P - p_WF| seen from F, B (3, 2) perpendicular to the axis and the angle
    θ = atan2(|Bᵀ d|, axis · d):  e = θ Bᵀ d / |Bᵀ d|, rad. An axis that points straight away from P turns in one
    direction u of all: e = π u and J = -u uᵀ d(Bᵀ d)/dq.

    Args:
        frame: name of F.
        point: P [x, y, z], m.
        axis: in F, of any length.
        cost: per radian.
        gain: 1/s; None: as large as the robot's jerk limits allow.
        priority: see `ControlTask`.

    Raises:
        InputError: an axis of length zero, values that are not finite.
    """

    name: ClassVar[str] = "look at"

    def __init__(
        self,
        frame: str,
        point: object,
        axis: object = (0.0, 0.0, 1.0),
        cost: Weight = 1.0,
        gain: float | None = None,
        priority: int = 0,
    ) -> None:
        super().__init__(frame, 2, cost, gain, priority)
        self.point = point
        self.axis = checked_direction(self, "axis", axis, "a direction in the frame")
        self._across = np.linalg.svd(self.axis[None])[2][1:].T

    @property
    def point(self) -> Array:
        """P (3,), m, world."""
        return self._point

    @point.setter
    def point(self, value: object) -> None:
        self._point = checked_vector(self, "point", value, 3)

    def error(self, c: Configuration) -> Array:
        """(2,), rad."""
        d = self._seen(c)[0]
        side, ahead = d @ self._across, float(d @ self.axis)
        sine = float(np.linalg.norm(side))
        return np.pi * _AWAY if sine < _STRAIGHT and ahead < 0.0 else np.asarray(_angle_per_sine(sine, ahead) * side)

    def jacobian(self, c: Configuration) -> Array:
        """(2, n)."""
        d, u, length = self._seen(c)
        R, J = c.pose(self._frame).rotation, c.jacobian(self._frame)
        dd = R.T @ ((np.outer(u, u) - np.eye(3)) @ J[:3] / length + pin.skew(u) @ J[3:])  # (3, n)
        side, ahead = d @ self._across, float(d @ self.axis)
        sine = float(np.linalg.norm(side))
        factor = _angle_per_sine(sine, ahead)
        J_side = self._across.T @ dd
        if sine < _STRAIGHT:
            return np.asarray(factor * J_side if ahead > 0.0 else -np.outer(_AWAY, _AWAY @ J_side))
        d_sine, d_ahead = side @ J_side / sine, self.axis @ dd
        d_factor = (ahead * d_sine - sine * d_ahead - factor * d_sine) / sine
        return np.asarray(factor * J_side + np.outer(side, d_factor))

    def wanted_rate(self, e: Array) -> Array:
        """Within what the robot's joints give."""
        return capped(e, self.gain, *self._turns)

    def _seen(self, c: Configuration) -> tuple[Array, Array, float]:
        """Direction of P seen from F and in the world, and its distance; straight ahead where F is at P."""
        X_WF = c.pose(self._frame)
        arm = self._point - X_WF.translation
        length = float(np.linalg.norm(arm))
        if length < 1e-9:
            return self.axis, X_WF.rotation @ self.axis, 1e-9
        return np.asarray(X_WF.rotation.T @ arm / length), arm / length, length


def _angle_per_sine(sine: float, cosine: float) -> float:
    return float(np.arctan2(sine, cosine)) / sine if sine > 1e-9 else 1.0
