"""Poses and rotations as the tests of the reports need them."""

import numpy as np
import pinocchio as pin

from optiplan.robot.robot import Robot


def rot(axis: str, angle: float) -> np.ndarray:
    return pin.rpy.rpyToMatrix(*(angle if name == axis else 0.0 for name in "xyz"))


def pose(rotation: np.ndarray, point: object) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = rotation, point
    return X


def tool_pose(robot: Robot, q: object, frame: str = "") -> np.ndarray:
    """X_WF (4, 4) of a frame, by default the tool's, from pinocchio."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, np.asarray(q, dtype=float))
    return np.array(data.oMf[robot.model.getFrameId(frame or robot.tool_frame)].homogeneous)


def angle_between(X: np.ndarray, Y: np.ndarray) -> float:
    """Angle, rad, between the rotations of two poses, of which one may be printed with few digits."""
    return float(np.linalg.norm(pin.log3(nearest_rotation(X[:3, :3]).T @ nearest_rotation(Y[:3, :3]))))


def nearest_rotation(R: np.ndarray) -> np.ndarray:
    """The rotation matrix nearest to R (Frobenius norm)."""
    U, _, Vt = np.linalg.svd(R)
    return U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt


def turn(q: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Largest difference of joint angles, rad, whole turns not counted; over the last axis."""
    return np.abs(np.angle(np.exp(1j * (np.asarray(q) - np.asarray(other))))).max(axis=-1)


def jacobian(robot: Robot, q: object, frame: str = "") -> np.ndarray:
    """Geometric Jacobian (6, n) of a frame, by default the tool's, along the world's axes: v (m/s), then w (rad/s)."""
    index = robot.model.getFrameId(frame or robot.tool_frame)
    data, at = robot.model.createData(), np.asarray(q, dtype=float)
    return np.array(pin.computeFrameJacobian(robot.model, data, at, index, pin.LOCAL_WORLD_ALIGNED))
