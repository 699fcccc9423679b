"""One descent of the numeric inverse kinematics towards targets of several frames at once."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.kinematics.ik.levenberg_marquardt import Descent
from optiplan.robot.robot import Robot


class SeveralFrames(Descent):
    """Work space for several frames of one robot: the errors and Jacobians of `Descent`, one below the other.

    Attributes:
        parts: of each frame, `(name, whether its orientation counts)`; they place frames and hold their targets.
    """

    def __init__(self, robot: Robot, frames: Sequence[tuple[str, bool]]) -> None:
        super().__init__(robot, frames[0][0])
        self.parts = [Descent(robot, frame, oriented) for frame, oriented in frames]
        self._rows = sum(6 if oriented else 3 for _, oriented in frames)
        self._diagonal = slice(None, None, self._rows + 1)

    @property
    def _native(self) -> None:
        """The core's descent knows one frame."""

    def aim_all(self, targets: Sequence[pin.SE3]) -> None:
        """Choose the pose X_WG that each frame should have."""
        for part, X_WG in zip(self.parts, targets, strict=True):
            part.aim(X_WG)

    def places(self, q: Array) -> list[pin.SE3]:
        """Return the poses X_WF of all frames at q (n,)."""
        return [part.place(q).copy() for part in self.parts]

    def _linearise(self, q: Array) -> tuple[Array, Array]:
        found = [part.error(q) for part in self.parts]
        return np.concatenate([e for e, _ in found]), np.vstack([J for _, J in found])
