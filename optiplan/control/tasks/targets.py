"""Targets of tasks from what users have: poses of pinocchio, `op.Pose`, matrices, points, angles."""

from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.control.arguments import squares_are_finite
from optiplan.errors import InputError, described, wrong_argument
from optiplan.geometry.pose import Pose
from optiplan.geometry.poses import check_angles, pose_from_data, pose_from_matrix

Target = Any
"""`pinocchio.SE3`, `op.Pose`, a homogeneous matrix (4, 4); of positions a point (3,), of orientations (3, 3) or rpy."""

_EXPECTED = "a pose: pinocchio.SE3, op.Pose or a matrix (4, 4), all finite"


def as_pose(owner: object, value: Target, expected: str = _EXPECTED) -> pin.SE3:
    """X_WT.

    Raises:
        InputError: it is no pose, or holds NaN.
    """
    if isinstance(value, pin.SE3):
        if squares_are_finite(value.homogeneous):
            return value
        raise wrong_argument(type(owner).__name__, "target", "a pose with NaN or infinity in it", expected)
    try:
        if isinstance(value, Pose):
            said = {"position": value.position, "rpy": value.rpy, "quaternion": value.quaternion}
            return pose_from_data({key: part for key, part in said.items() if part is not None})
        matrix = np.asarray(value, dtype=np.float64)
        if matrix.shape == (4, 4):
            return pose_from_matrix(matrix.ravel().tolist())
    except (TypeError, ValueError, OverflowError, InputError) as error:
        found = f"{described(value)}: {error}"
        raise wrong_argument(type(owner).__name__, "target", found, expected) from None
    raise wrong_argument(type(owner).__name__, "target", described(value), expected)


def as_position(owner: object, value: Target) -> pin.SE3:
    """A pose at a point (3,), or a pose.

    Raises:
        InputError: neither.
    """
    numbers = _numbers(value, (3,))
    if numbers is not None:
        return pin.SE3(np.eye(3), numbers)
    return as_pose(owner, value, "a point [x, y, z], m, all finite, or a pose")


def as_rotation(owner: object, value: Target) -> pin.SE3:
    """A pose of a rotation (3, 3) or of [roll, pitch, yaw], or a pose.

    Raises:
        InputError: neither.
    """
    rpy = _numbers(value, (3,))
    if rpy is not None:
        try:
            check_angles(rpy.tolist())
        except ValueError as error:
            raise wrong_argument(type(owner).__name__, "target", described(value), str(error)) from None
        return pin.SE3(pin.rpy.rpyToMatrix(*rpy.tolist()), np.zeros(3))
    rotation = _numbers(value, (3, 3))
    expected = "a rotation matrix (3, 3), [roll, pitch, yaw], rad, or a pose"
    if rotation is not None:
        padded = np.eye(4)
        padded[:3, :3] = rotation
        return as_pose(owner, padded, expected)
    return as_pose(owner, value, expected)


def _numbers(value: Target, shape: tuple[int, ...]) -> Any:
    """The value as finite numbers of that shape; None if it is something else."""
    if isinstance(value, pin.SE3 | Pose):
        return None
    try:
        found = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return None
    return found if found.shape == shape and np.isfinite(found).all() else None
