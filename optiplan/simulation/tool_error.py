"""Where the tool is and where it should be, at many instants at once."""

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.robot.robot import Robot


class ToolPoses:
    """Poses of a frame of a robot at many configurations."""

    def __init__(self, robot: Robot, frame: str | None = None) -> None:
        index = robot.frame_id(frame or robot.tool_frame)
        placed = robot.model.frames[index]
        self._joint, self._placement = int(placed.parentJoint), np.array(placed.placement.homogeneous)
        self._kinematics = robot.kinematics

    def of(self, Q: Array) -> Array:
        """X_WF at configurations Q (K, n): (K, 4, 4)."""
        return np.asarray(self._kinematics.poses(Q)[:, self._joint] @ self._placement)


def pose_errors(wanted: Array, actual: Array) -> Array:
    """Distance, m, and angle, rad, between poses (K, 4, 4) and (K, 4, 4): (K, 2).

    The angle is 2 asin(|R - R'|_F / sqrt 8), exact for small angles as well, where the arc cosine of the trace is not.
    """
    distance = np.linalg.norm(wanted[:, :3, 3] - actual[:, :3, 3], axis=1)
    chord = np.linalg.norm(wanted[:, :3, :3] - actual[:, :3, :3], axis=(1, 2))
    return np.column_stack([distance, 2.0 * np.arcsin(np.clip(chord / np.sqrt(8.0), 0.0, 1.0))])


def homogeneous(poses: list[pin.SE3]) -> Array:
    """Poses as an array (K, 4, 4)."""
    return np.array([X.homogeneous for X in poses]).reshape(-1, 4, 4)
