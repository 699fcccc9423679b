"""`Pose`, and the schema of poses and their tolerances in a problem file."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar

import numpy as np
import pinocchio as pin
from pydantic import AfterValidator, BaseModel, model_validator

from optiplan.arrays import Array
from optiplan.config.document import Document, Strict, plain, validate
from optiplan.config.values import Length, Name, Quaternion, Vector
from optiplan.errors import InputError, Issue, described, wrong_argument
from optiplan.geometry.poses import check_angles, in_radians, pose_from_data, pose_from_matrix, pose_to_data
from optiplan.records import dataclass

Angles = Annotated[Vector, AfterValidator(partial(check_angles, degrees="rpy_deg"))]
"""Roll, pitch and yaw, rad, each within a turn."""


class PoseSpec(Strict):
    """`position`, m, and `rpy` about fixed axes, rad, `rpy_deg` or `quaternion` [x, y, z, w]; none is the identity.

    A value given as `rpy_deg` is converted to `rpy`.
    """

    position: Vector = (0.0, 0.0, 0.0)
    rpy: Angles | None = None
    rpy_deg: Vector | None = None
    quaternion: Quaternion | None = None

    @model_validator(mode="before")
    @classmethod
    def _radians(cls, data: Any) -> Any:
        return in_radians(data)

    @model_validator(mode="after")
    def _one_rotation(self) -> Self:
        if self.rpy is not None and self.quaternion is not None:
            raise ValueError("found both rpy and quaternion; expected at most one of them")
        return self


def pose_of(spec: PoseSpec) -> pin.SE3:
    """Return the pose of what a file says."""
    return pose_from_data(dict(spec))


class ToleranceSpec(Strict):
    """Tolerance of a pose: `position` in m, `orientation` in rad."""

    position: Length = 1e-4
    orientation: Length = 1e-3


class PoseGoalSpec(PoseSpec):
    """The pose of `frame` (default: the robot's tool frame) in the world."""

    frame: Name | None = None
    position: Vector
    tolerance: ToleranceSpec = ToleranceSpec.model_construct()


Values = Sequence[float] | Array
Spec = TypeVar("Spec", bound=BaseModel)


@dataclass(frozen=True)
class Pose:
    """Desired pose of a frame of the robot in the world: a goal or a via.

    Attributes:
        position: [x, y, z], m.
        rpy: [roll, pitch, yaw], rad, about the fixed axes x, then y, then z of the world, as in URDF.
        quaternion: [x, y, z, w] of unit length, instead of `rpy`; with neither the axes are those of the world.
        frame: a link or fixed frame of the robot; None: its tool frame.
        position_tolerance: m; None: 1e-4 (of a via point: 1e-6).
        orientation_tolerance: rad; None: 1e-3 (of a via point: 1e-6).
        rpy_deg: `rpy` in degrees; the pose then has `rpy`.

    Raises:
        InputError: a vector of another length, both rotations, a quaternion not of unit length, a tolerance not > 0.

    Example:
        >>> import optiplan as op
        >>> op.Pose(position=(0.5, 0.2, 0.6), rpy=(3.14, 0, 0))
        Pose(position=(0.5, 0.2, 0.6), rpy=(3.14, 0.0, 0.0))
    """

    position: Values
    rpy: Values | None = None
    quaternion: Values | None = None
    frame: str | None = None
    position_tolerance: float | None = None
    orientation_tolerance: float | None = None
    rpy_deg: Values | None = None

    def __post_init__(self) -> None:
        names = {"tolerance.position": "position_tolerance", "tolerance.orientation": "orientation_tolerance"}
        spec = checked(PoseGoalSpec, self.to_data(), "Pose", names)
        for name in ("position", "rpy", "rpy_deg", "quaternion"):
            object.__setattr__(self, name, getattr(spec, name))

    @classmethod
    def from_matrix(cls, X_WG: Array | pin.SE3, frame: str | None = None) -> "Pose":
        """Return the pose of a homogeneous matrix (4, 4), m, or of a `pinocchio.SE3`.

        Raises:
            InputError: not a rigid transform.
        """
        if isinstance(X_WG, pin.SE3):
            return cls.of(X_WG, frame)
        with suppress(TypeError, ValueError, OverflowError):
            matrix = np.asarray(X_WG, float)
            if matrix.shape == (4, 4):
                return cls.of(pose_from_matrix(matrix.ravel().tolist()), frame)
        expected = "a matrix (4, 4): a rotation and a translation in m above the row 0, 0, 0, 1"
        raise wrong_argument("Pose.from_matrix", "X_WG", described(X_WG), expected)

    @classmethod
    def of(cls, X_WG: pin.SE3, frame: str | None) -> "Pose":
        """Return the pose of a `pinocchio.SE3`."""
        data = pose_to_data(X_WG)
        return cls(data["position"], quaternion=data["quaternion"], frame=frame)

    @property
    def matrix(self) -> Array:
        """The homogeneous matrix (4, 4), m."""
        return np.asarray(pose_from_data(self.to_data()).homogeneous)

    def __matmul__(self, within: "Pose") -> "Pose":
        """Return X_WF X_FB, where this pose is X_WF and `within` is X_FB, with the frame and tolerances of `within`.

        Example:
            >>> import optiplan as op
            >>> tray = op.Pose((0.5, 0, 0.1), rpy_deg=(0, 0, 90))
            >>> (tray @ op.Pose((0.2, 0, 0.1))).position
            (0.5, 0.2, 0.2)

        Raises:
            InputError: `within` is no pose.
        """
        if not isinstance(within, Pose):
            raise wrong_argument("Pose", "@", described(within), "op.Pose(…)")
        placed = pose_to_data(pose_from_data(self.to_data()) * pose_from_data(within.to_data()))
        position = tuple(round(x, 12) for x in placed["position"])
        return replace(within, position=position, rpy=None, rpy_deg=None, quaternion=tuple(placed["quaternion"]))

    def to_data(self) -> dict[str, Any]:
        """Return the keys of a problem file."""
        tolerance = {"position": self.position_tolerance, "orientation": self.orientation_tolerance}
        parts = {key: getattr(self, key) for key in ("frame", "position", "rpy", "rpy_deg", "quaternion")}
        stated = {**parts, "tolerance": {key: value for key, value in tolerance.items() if value is not None} or None}
        return {key: plain(value) for key, value in stated.items() if value is not None}

    def __repr__(self) -> str:
        """Return the arguments that are not None."""
        given = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return f"Pose({', '.join(f'{name}={value!r}' for name, value in given.items() if value is not None)})"


def place_data(pose: Any, function: str, argument: str, expected: str = "op.Pose(position, rpy=…)") -> dict[str, Any]:
    """Return where something is, an `op.Pose` or `pinocchio.SE3`, by the keys of a problem file.

    Raises:
        InputError: neither, or with a frame or tolerances of its own, which count for a goal alone.
    """
    if isinstance(pose, pin.SE3):
        return pose_to_data(pose)
    if not isinstance(pose, Pose):
        raise wrong_argument(function, argument, described(pose), expected)
    data = pose.to_data()
    if own := [key for key in ("frame", "tolerance") if key in data]:
        raise wrong_argument(function, argument, f"a pose with a {own[0]} of its own", expected)
    return data


def checked(spec: type[Spec], data: Mapping[str, Any], function: str, names: Mapping[str, str]) -> Spec:
    """Validate data by a class of the schema; issues name the arguments of the call.

    Args:
        spec: class of the schema.
        data: keys of a problem file.
        function: name of the function that the user called, without `op.`.
        names: arguments by the fields of the schema.

    Raises:
        InputError: invalid data.
    """
    try:
        return validate(spec, Document(Path(f"op.{function}"), plain(data), {}))
    except InputError as error:
        raise InputError(replace(issue, field=_argument(issue, names)) for issue in error.issues) from None


def _argument(issue: Issue, names: Mapping[str, str]) -> str:
    field = issue.field if issue.path else ""  # a call has no file to name where it is about all of its arguments
    for name, argument in names.items():
        if field == name or field.startswith((f"{name}[", f"{name}.")):
            return argument + field.removeprefix(name)
    return field
