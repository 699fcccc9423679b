"""Poses from and to plain data (YAML, JSON) and the distance of two, over `pinocchio.SE3`."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, NoReturn, TypeVar

import numpy as np
import pinocchio as pin

from optiplan.arrays import UNIT_TOLERANCE, Array, ReadOnlyArrays, read_only, unit_vector

HALF_TURN = 1e-9
"""Components of a unit quaternion smaller than this count as 0 when the shorter of two rotations is chosen."""


_LARGEST_ANGLE = 2.0 * math.pi + 1e-3
"""rad; a turn to either side, with room for rounding: a larger angle was meant in degrees."""


Angles = TypeVar("Angles", bound=Sequence[float])


def check_angles(rpy: Angles, degrees: str = "") -> Angles:
    """Return angles, none of which is beyond a whole turn.

    Args:
        rpy: rad.
        degrees: the key that takes degrees instead, if there is one.

    Raises:
        ValueError: there is one, most likely in degrees.
    """
    for angle in rpy:
        if not abs(angle) <= _LARGEST_ANGLE:
            hint = f"; for degrees: {degrees}" if degrees else ""
            raise ValueError(f"found {angle:g}; expected angles in rad, within a turn (6.2832){hint}")
    return rpy


def in_radians(data: Any) -> Any:
    """Return a mapping with `rpy`, rad, in place of `rpy_deg`; return other data unchanged.

    Raises:
        ValueError: it has both, or an angle beyond a turn.
    """
    if not isinstance(data, Mapping) or data.get("rpy_deg") is None:
        return data
    if data.get("rpy") is not None:
        raise ValueError("found both rpy and rpy_deg; expected at most one of them")
    try:
        turned = [math.radians(angle) for angle in data["rpy_deg"] if not isinstance(angle, bool)]
    except (TypeError, OverflowError):
        return data  # the check of the field reports the error
    if not all(map(math.isfinite, turned)):
        return data  # likewise
    for angle in turned:
        if abs(angle) > _LARGEST_ANGLE:
            raise ValueError(f"found {math.degrees(angle):g} in rpy_deg; expected angles within a turn (360)")
    return {**{key: value for key, value in data.items() if key != "rpy_deg"}, "rpy": turned}


def pose_from_data(data: Mapping[str, Any]) -> pin.SE3:
    """Return the pose X_AB of `position` [x, y, z], m, and `rpy` or `quaternion`; a missing key is the identity.

    `rpy` [r, p, y], rad, or `rpy_deg`: rotations about the *fixed* axes x, then y, then z of A, as in URDF:
    R_AB = Rz(y) Ry(p) Rx(r).

    `quaternion` [x, y, z, w] of unit length.

    Raises:
        ValueError: several rotations are given, an angle is beyond a turn, or the quaternion is not a unit quaternion.
    """
    data = in_radians(data)
    if data.get("rpy_deg") is not None:
        raise ValueError(f"found {data['rpy_deg']} in rpy_deg; expected three finite numbers")
    rpy, quaternion = data.get("rpy"), data.get("quaternion")
    if rpy is not None and quaternion is not None:
        raise ValueError("found both rpy and quaternion; expected at most one of them")
    rotation = np.eye(3)
    if rpy is not None:
        check_angles(rpy)
        rotation = pin.rpy.rpyToMatrix(*map(float, rpy))
    elif quaternion is not None:
        rotation = pin.Quaternion(unit_vector(quaternion)).toRotationMatrix()
    position = data.get("position")
    return pin.SE3(rotation, np.zeros(3) if position is None else np.asarray(position, float))


def pose_to_data(X_AB: pin.SE3) -> dict[str, list[float]]:
    """Return `position`, m, and `quaternion` [x, y, z, w] with w >= 0: the inverse of `pose_from_data`."""
    quaternion = pin.Quaternion(X_AB.rotation).coeffs()
    if quaternion[3] < 0.0:
        quaternion = -quaternion
    return {"position": [float(x) for x in X_AB.translation], "quaternion": [float(x) for x in quaternion]}


def pose_from_matrix(values: Sequence[float]) -> pin.SE3:
    """Return the pose X_AB of a homogeneous matrix, row by row: 16 numbers, or 12 without the last row 0, 0, 0, 1.

    R often has few digits, so the nearest rotation U Vᵀ of R = U S Vᵀ is taken.

    Raises:
        ValueError: another number of values, another last row, or no rotation within `UNIT_TOLERANCE`.
    """
    if len(values) not in (12, 16) or not all(map(math.isfinite, values)):
        raise ValueError(f"found {len(values)} numbers; expected 12 or 16, row by row")
    matrix = np.asarray(values, float).reshape(-1, 4)
    if len(matrix) == 4 and np.abs(matrix[3] - [0.0, 0.0, 0.0, 1.0]).max() > UNIT_TOLERANCE:
        raise ValueError(f"found the last row {', '.join(f'{x:g}' for x in matrix[3])}; expected 0, 0, 0, 1")
    R = matrix[:3, :3]
    off = float(np.abs(R.T @ R - np.eye(3)).max())
    if not off <= UNIT_TOLERANCE or np.linalg.det(R) < 0.0:
        found = f"RᵀR off from the identity by {off:.3g}" if off > UNIT_TOLERANCE else "a reflection, det R = -1"
        raise ValueError(f"found {found}; expected a rotation, RᵀR = I within {UNIT_TOLERANCE:g} and det R = 1")
    U, _, Vt = np.linalg.svd(R)
    return pin.SE3(U @ Vt, matrix[:3, 3])


def is_matrix_of_pose(value: object) -> bool:
    """Return whether a value is a homogeneous matrix (4, 4), an array or a list of rows."""
    if not isinstance(value, np.ndarray | list | tuple):  # a `pinocchio.SE3` can be asked for its matrix
        return False
    try:
        matrix = np.asarray(value, float)
        pose_from_matrix(matrix.ravel().tolist())
    except (TypeError, ValueError, OverflowError):
        return False
    return matrix.shape == (4, 4)


class PoseError(NamedTuple):
    """How far a pose is from another.

    Attributes:
        position: distance of the origins, m.
        orientation: angle of the rotation from one to the other, rad.
    """

    position: float
    orientation: float


def pose_error(X_WF: pin.SE3, X_WG: pin.SE3) -> PoseError:
    """Return the distance between two poses: |p_G - p_F| and |log(R_WFᵀ R_WG)|."""
    angle = np.linalg.norm(pin.log3(X_WF.rotation.T @ X_WG.rotation))
    return PoseError(float(np.linalg.norm(X_WG.translation - X_WF.translation)), float(angle))


class FixedPose(pin.SE3):  # type: ignore[misc]  # pinocchio has no types
    """A copy of a pose, whose numbers are read-only.

    Bodies and proofs are made of the poses of a scene once and kept. Were a pose edited in place, they would be about
    another scene than the one at hand.
    """

    @property
    def translation(self) -> Array:
        """The translation (3,), m."""
        return read_only(pin.SE3.translation.fget(self))

    @property
    def rotation(self) -> Array:
        """The rotation matrix (3, 3)."""
        return read_only(pin.SE3.rotation.fget(self))

    def setIdentity(self) -> NoReturn:
        """Refuse."""
        raise AttributeError("this pose is read-only; edit a copy() of it")

    setRandom = setIdentity

    def __reduce__(self) -> tuple[Any, ...]:
        """How to pickle it."""
        return FixedPose, (self.copy(),)

    def __copy__(self) -> "FixedPose":
        """Itself; pinocchio would give a pose that can be edited."""
        return self

    def __deepcopy__(self, memo: Any) -> "FixedPose":
        """Itself."""
        return self


class ReadOnlyPoses(ReadOnlyArrays):
    """A frozen dataclass with poses and arrays that nobody may write into: its attributes are copies."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, value in vars(self).items():
            if isinstance(value, pin.SE3) and not isinstance(value, FixedPose):
                object.__setattr__(self, name, FixedPose(value))
