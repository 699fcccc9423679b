"""`Configuration`: kinematics and dynamics of a robot at one state, computed once for tasks and limits."""

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.robot.mimic_joints import unfold
from optiplan.robot.robot import Robot

_AHEAD = 1e-6
"""s; how far ahead a Jacobian is taken for its rate of change: rounding costs 1e-10 of it, curvature 1e-6."""


class Configuration:
    """A robot at q and v; `update` moves it. Frames are given by their index, `robot.frame_id(name)`.

    Kinematics are computed at their first use: a limit that the native core measures needs none.

    Attributes:
        q: (n,), rad or m; `v`: (n,), rad/s or m/s.

    Args:
        robot: the robot.
        model: its model with joints of moving obstacles, which are then of q; None: its own.
    """

    def __init__(self, robot: Robot, model: pin.Model | None = None) -> None:
        self.robot = robot
        self._model = robot.model if model is None else model
        self._data = self._model.createData()
        self._plain = unfold(robot.model)
        self._plain_data = self._data if self._plain.model is self._model else self._plain.model.createData()
        self._ahead: Configuration | None = None
        self.update(np.zeros(robot.n), np.zeros(robot.n))

    def update(self, q: Array, v: Array) -> None:
        """Move to q (n,) with velocities v (n,)."""
        self.q, self.v = q, v
        self._is_placed = self._ahead_is_current = self._rates_are_current = False

    def pose(self, frame: int) -> pin.SE3:
        """X_WF; the next update changes it."""
        data = self.data
        pin.updateFramePlacement(self._model, data, frame)
        return data.oMf[frame]

    def jacobian(self, frame: int) -> Array:
        """J (6, n): velocity, m/s, of the frame's origin and angular velocity, rad/s, along the axes of the world."""
        J: Array = pin.getFrameJacobian(self._model, self.data, frame, pin.LOCAL_WORLD_ALIGNED)
        return J if J.ndim == 2 else J.reshape(6, -1)

    def jacobian_rate(self, frame: int) -> Array:
        """Rate of change (6, n) of `jacobian` at velocities v."""
        if self.robot.followers:  # of which pinocchio knows no rates
            return self.rate(self.jacobian(frame).copy(), self.ahead.jacobian(frame))
        if not self._rates_are_current:
            pin.computeJointJacobiansTimeVariation(self._model, self._data, self.q, self.v)
            self._is_placed = self._rates_are_current = True
        pin.updateFramePlacement(self._model, self._data, frame)
        dJ: Array = pin.getFrameJacobianTimeVariation(self._model, self._data, frame, pin.LOCAL_WORLD_ALIGNED)
        return dJ if dJ.ndim == 2 else dJ.reshape(6, -1)

    def joint_jacobians(self) -> Array:
        """Spatial Jacobians (6, J) of all joints about the origin of the world, followers too: linear part first."""
        J: Array = self.data.J
        return J if J.ndim == 2 else J.reshape(6, -1)

    @property
    def data(self) -> pin.Data:
        """Pinocchio's data with the joints placed, and their Jacobians, to be read."""
        if not self._is_placed:
            pin.computeJointJacobians(self._model, self._data, self.q)
            self._is_placed = True
        return self._data

    def centre_of_mass(self) -> tuple[Array, Array]:
        """Position (3,), m, of the centre of mass in the world, and its Jacobian (3, n)."""
        if not self.robot.followers:
            J = pin.jacobianCenterOfMass(self._model, self._data, self.q)
            return np.array(self._data.com[0]), np.asarray(J).reshape(3, -1)
        A, b = self._plain.A, self._plain.b
        J = pin.jacobianCenterOfMass(self._plain.model, self._plain_data, A @ self.q + b)
        return np.array(self._plain_data.com[0]), np.asarray(J).reshape(3, -1) @ A

    def dynamics(self) -> tuple[Array, Array]:
        """M (n, n) and h (n,) of tau = M a + h, with h the torques of gravity, Coriolis and centrifugal forces."""
        plain, data = self._plain, self._plain_data
        if not self.robot.followers:
            M = pin.crba(plain.model, data, self.q)
            return np.asarray(M), np.asarray(pin.nonLinearEffects(plain.model, data, self.q, self.v))
        q, v, A = plain.A @ self.q + plain.b, plain.A @ self.v, plain.A
        M = pin.crba(plain.model, data, q)
        return A.T @ np.asarray(M) @ A, A.T @ np.asarray(pin.nonLinearEffects(plain.model, data, q, v))

    @property
    def ahead(self) -> "Configuration":
        """The same robot a microsecond later at constant velocity, for rates of change of Jacobians."""
        if self._ahead is None:
            self._ahead = Configuration(self.robot)
        if not self._ahead_is_current:
            self._ahead.update(self.q + _AHEAD * self.v, self.v)
            self._ahead_is_current = True
        return self._ahead

    def rate(self, now: Array, ahead: Array) -> Array:
        """Rate of change of what is `now` here and `ahead` at `self.ahead`."""
        return (ahead - now) / _AHEAD
