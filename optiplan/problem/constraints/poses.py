"""Path constraints on the pose of a frame."""

import math
from typing import Annotated, Any, ClassVar, Self, TypeAlias

import numpy as np
import pinocchio as pin
from pydantic import Field, model_validator

from optiplan.arrays import Array
from optiplan.config.values import Coordinate, Length, Name, Quaternion, Vector
from optiplan.geometry.pose import Angles, PoseSpec, ToleranceSpec, pose_of
from optiplan.geometry.poses import in_radians, pose_from_data, pose_to_data
from optiplan.problem.constraints.base import (
    WHOLE,
    Angle,
    ConstraintSpec,
    During,
    Frame,
    Key,
    Mention,
    Point,
    Statement,
    UnitVector,
)
from optiplan.records import dataclass

WithinMetres: TypeAlias = Annotated[
    float, Key(ToleranceSpec, name="tolerance", part="position", default=ToleranceSpec())
]
WithinAngle: TypeAlias = Annotated[
    float, Key(ToleranceSpec, name="tolerance", part="orientation", default=ToleranceSpec())
]


@dataclass(frozen=True, eq=False)
class OrientationCone(Statement):
    """An axis of a frame stays within an angle of a direction of the world.

    Attributes:
        frame: a link or fixed frame of the robot.
        axis: (3,) unit vector in the frame.
        toward: (3,) unit vector in the world.
        within: rad.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "orientation"

    frame: Frame
    axis: UnitVector
    toward: UnitVector
    within: Angle
    during: During = WHOLE


class RotationSpec(ConstraintSpec):
    """An orientation: `rpy`, `rpy_deg` or `quaternion`."""

    rpy: Angles | None = None
    rpy_deg: Vector | None = None
    quaternion: Quaternion | None = None

    @model_validator(mode="before")
    @classmethod
    def _radians(cls, data: Any) -> Any:
        return in_radians(data)

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.rpy is None) == (self.quaternion is None):
            found = "neither" if self.rpy is None else "both"
            raise ValueError(f"found {found}; expected rpy, rpy_deg or quaternion")
        return self


def _rotation(spec: RotationSpec) -> Array:
    return np.asarray(pose_from_data({"rpy": spec.rpy, "quaternion": spec.quaternion}).rotation)


def _quaternion(R: Array) -> dict[str, Any]:
    return {"quaternion": pin.Quaternion(np.asarray(R)).coeffs().tolist()}


@dataclass(frozen=True, eq=False)
class FixedOrientation(Statement):
    """A frame keeps its orientation in the world, within an angle.

    Attributes:
        frame: a link or fixed frame of the robot.
        R_WF: (3, 3) that orientation.
        within: rad.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "fixed_orientation"

    frame: Frame
    R_WF: Annotated[Array, Key(RotationSpec, _rotation, _quaternion, beside=True)]
    within: Angle
    during: During = WHOLE


@dataclass(frozen=True, eq=False)
class LookAt(Statement):
    """An axis of a frame points at a point of the world, within an angle: a camera.

    Attributes:
        frame: a link or fixed frame of the robot.
        axis: (3,) unit vector in the frame.
        target: (3,) in the world, m.
        within: rad.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "look_at"

    frame: Frame
    axis: UnitVector
    target: Point
    within: Annotated[float, Key(Annotated[Length, Field(lt=math.pi / 2)])]
    during: During = WHOLE


@dataclass(frozen=True, eq=False)
class OnScrew(Statement):
    """A frame turns about an axis and slides along it by `pitch` for every rad: a bolt, a door (pitch 0).

    Attributes:
        frame: a link or fixed frame of the robot.
        axis: (3,) unit vector in the world.
        point: (3,) m, on the axis.
        pitch: m/rad.
        X_WF: one pose of the frame on the screw.
        position: tolerance, m.
        orientation: tolerance, rad.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "screw"

    frame: Frame
    axis: UnitVector
    point: Point
    pitch: Annotated[float, Key(Coordinate, default=0.0)]
    X_WF: Annotated[pin.SE3, Key(PoseSpec, pose_of, pose_to_data, name="pose")]
    position: WithinMetres
    orientation: WithinAngle
    during: During = WHOLE


class FramePoseSpec(ConstraintSpec, PoseSpec):
    """A pose of a frame."""


@dataclass(frozen=True, eq=False)
class RelativePose(Statement):
    """One frame keeps its pose in another: two hands on one tray.

    Attributes:
        frame: a link or fixed frame of the robot.
        to: the frame that it keeps its pose in.
        X_TF: that pose.
        position: tolerance, m.
        orientation: tolerance, rad.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "relative_pose"

    frame: Frame
    to: Annotated[str, Key(Name)]
    X_TF: Annotated[pin.SE3, Key(FramePoseSpec, pose_of, pose_to_data, beside=True)]
    position: WithinMetres
    orientation: WithinAngle
    during: During = WHOLE

    def mentioned(self) -> list[Mention]:
        """Return both frames."""
        return [*super().mentioned(), Mention(("to",), "frame", self.to)]
