"""The tool of an arm in the terms of screw theory: its pose and its spatial Jacobian."""

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.robot.robot import Robot


class ScrewTool:
    """Work space for one frame T of one robot."""

    def __init__(self, robot: Robot, frame: str) -> None:
        """Raises UnknownChoiceError: the robot has no such frame."""
        self.robot, self.frame = robot, frame
        self._model, self._data, self._frame = robot.model, robot.model.createData(), robot.frame_id(frame)

    def pose(self, q: Array) -> pin.SE3:
        """X_WT at q (n,), rad or m."""
        pin.framesForwardKinematics(self._model, self._data, q)
        return pin.SE3(self._data.oMf[self._frame])

    def at(self, q: Array) -> tuple[pin.SE3, Array]:
        """Return X_WT and the spatial Jacobian J_s (6, n) at q: dX_WT/dt = [J_s q̇] X_WT.

        The twist J_s q̇ = (v, w) has the angular velocity w, rad/s, and the velocity v, m/s, of the body point at the
        world's origin. A revolute joint about the unit axis z through p has the column (p x z, z).
        """
        J = pin.computeFrameJacobian(self._model, self._data, q, self._frame, pin.ReferenceFrame.WORLD)
        X_WT = pin.SE3(pin.updateFramePlacement(self._model, self._data, self._frame))
        return X_WT, np.asarray(J.reshape(6, -1))  # of one joint it is (6,)
