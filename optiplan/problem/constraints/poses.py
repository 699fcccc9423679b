"""Path constraints on the pose of a frame: what stands under each key of a problem file, and what it states."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Self

import numpy as np
import pinocchio as pin
from pydantic import Field, model_validator

from optiplan.arrays import Array
from optiplan.config.values import Coordinate, Direction, Length, Name, Quaternion, Vector
from optiplan.geometry.pose import Angles, PoseSpec, ToleranceSpec
from optiplan.geometry.poses import in_radians, pose_from_data, pose_to_data
from optiplan.problem.constraints.base import WHOLE, ConstraintSpec, During, Mention, Statement, unit


class OrientationConeSpec(ConstraintSpec):
    """`axis` of the frame stays within an angle, rad, of the direction `toward` of the world."""

    axis: Direction
    toward: Direction
    within: Annotated[Length, Field(le=math.pi)]


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

    frame: str
    axis: Array
    toward: Array
    within: float
    during: During = WHOLE

    @classmethod
    def of(cls, data: Mapping[str, Any], frame: str, during: During) -> Self:
        """Return the constraint of a validated entry of a file."""
        return cls(frame, unit(data["axis"]), unit(data["toward"]), data["within"], during)


class FixedOrientationSpec(ConstraintSpec):
    """The frame keeps its orientation in the world, `rpy`, `rpy_deg` or `quaternion`, within an angle, rad."""

    rpy: Angles | None = None
    rpy_deg: Vector | None = None
    quaternion: Quaternion | None = None
    within: Annotated[Length, Field(le=math.pi)]

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

    frame: str
    R_WF: Array
    within: float
    during: During = WHOLE

    @classmethod
    def of(cls, data: Mapping[str, Any], frame: str, during: During) -> Self:
        """Return the constraint of a validated entry of a file."""
        return cls(
            frame, pose_from_data({"position": [0.0, 0.0, 0.0], **_rotation(data)}).rotation, data["within"], during
        )

    def to_data(self) -> dict[str, Any]:
        """Return its values as a problem file says them."""
        return {"quaternion": pin.Quaternion(np.asarray(self.R_WF)).coeffs().tolist(), "within": self.within}


class LookAtSpec(ConstraintSpec):
    """`axis` of the frame points at `target`, m, within an angle, rad."""

    axis: Direction
    target: Vector
    within: Annotated[Length, Field(lt=math.pi / 2)]


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

    frame: str
    axis: Array
    target: Array
    within: float
    during: During = WHOLE

    @classmethod
    def of(cls, data: Mapping[str, Any], frame: str, during: During) -> Self:
        """Return the constraint of a validated entry of a file."""
        return cls(frame, unit(data["axis"]), np.array(data["target"], float), data["within"], during)


class OnScrewSpec(ConstraintSpec):
    """The frame turns about an axis through `point`, sliding by `pitch`, m/rad; `pose` is one of its poses."""

    axis: Direction
    point: Vector
    pitch: Coordinate = 0.0
    pose: PoseSpec
    tolerance: ToleranceSpec = ToleranceSpec()


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

    frame: str
    axis: Array
    point: Array
    pitch: float
    X_WF: pin.SE3
    position: float
    orientation: float
    during: During = WHOLE

    @classmethod
    def of(cls, data: Mapping[str, Any], frame: str, during: During) -> Self:
        """Return the constraint of a validated entry of a file."""
        return cls(
            frame,
            unit(data["axis"]),
            np.array(data["point"], float),
            data["pitch"],
            pose_from_data(data["pose"]),
            *_tolerance(data),
            during,
        )

    def to_data(self) -> dict[str, Any]:
        """Return its values as a problem file says them."""
        return {
            "axis": self.axis,
            "point": self.point,
            "pitch": self.pitch,
            "pose": pose_to_data(self.X_WF),
            "tolerance": {"position": self.position, "orientation": self.orientation},
        }


class RelativePoseSpec(ConstraintSpec, PoseSpec):
    """The frame keeps its pose in the frame `to`, within `tolerance`."""

    to: Name
    tolerance: ToleranceSpec = ToleranceSpec()


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

    frame: str
    to: str
    X_TF: pin.SE3
    position: float
    orientation: float
    during: During = WHOLE

    @classmethod
    def of(cls, data: Mapping[str, Any], frame: str, during: During) -> Self:
        """Return the constraint of a validated entry of a file."""
        return cls(frame, data["to"], pose_from_data(data), *_tolerance(data), during)

    def to_data(self) -> dict[str, Any]:
        """Return its values as a problem file says them."""
        return {
            "to": self.to,
            **pose_to_data(self.X_TF),
            "tolerance": {"position": self.position, "orientation": self.orientation},
        }

    def mentioned(self) -> list[Mention]:
        """Return both frames."""
        return [*super().mentioned(), Mention(("to",), "frame", self.to)]


def _tolerance(data: Mapping[str, Any]) -> tuple[float, float]:
    return data["tolerance"]["position"], data["tolerance"]["orientation"]


def _rotation(data: Mapping[str, Any]) -> dict[str, Any]:
    return {key: data[key] for key in ("rpy", "quaternion") if data.get(key) is not None}
