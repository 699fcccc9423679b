"""Path constraints on the pose of a frame."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.poses import pose_from_data, pose_to_data
from optiplan.problem.constraints.base import WHOLE, During, Statement, unit


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

    def to_data(self) -> dict[str, Any]:
        """Return its values as a problem file says them."""
        return {"axis": self.axis, "toward": self.toward, "within": self.within}


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


@dataclass(frozen=True, eq=False)
class PositionBox(Statement):
    """The origin of a frame stays in a box.

    Attributes:
        frame: a link or fixed frame of the robot.
        size: (3,) edge lengths, m.
        X_WC: pose of the box in the world.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "position"

    frame: str
    size: Array
    X_WC: pin.SE3
    during: During = WHOLE

    @classmethod
    def of(cls, data: Mapping[str, Any], frame: str, during: During) -> Self:
        """Return the constraint of a validated entry of a file."""
        return cls(frame, np.array(data["box"]["size"]), pose_from_data(data["box"]["pose"]), during)

    def to_data(self) -> dict[str, Any]:
        """Return its values as a problem file says them."""
        return {"box": {"size": np.asarray(self.size).tolist(), "pose": pose_to_data(self.X_WC)}}


@dataclass(frozen=True, eq=False)
class OnPlane(Statement):
    """The origin p of a frame stays near a plane: |normal · p - offset| <= within.

    Attributes:
        frame: a link or fixed frame of the robot.
        normal: (3,) unit vector in the world.
        offset: m.
        within: m.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "plane"

    frame: str
    normal: Array
    offset: float
    within: float
    during: During = WHOLE

    @classmethod
    def of(cls, data: Mapping[str, Any], frame: str, during: During) -> Self:
        """Return the constraint of a validated entry of a file."""
        return cls(frame, unit(data["normal"]), data["offset"], data["within"], during)

    def to_data(self) -> dict[str, Any]:
        """Return its values as a problem file says them."""
        return {"normal": self.normal, "offset": self.offset, "within": self.within}


@dataclass(frozen=True, eq=False)
class OnLine(Statement):
    """The origin of a frame stays near the segment between two points.

    Attributes:
        frame: a link or fixed frame of the robot.
        start, end: (3,) in the world, m.
        within: m.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "line"

    frame: str
    start: Array
    end: Array
    within: float
    during: During = WHOLE

    @classmethod
    def of(cls, data: Mapping[str, Any], frame: str, during: During) -> Self:
        """Return the constraint of a validated entry of a file."""
        return cls(frame, np.array(data["from"], float), np.array(data["to"], float), data["within"], during)

    def to_data(self) -> dict[str, Any]:
        """Return its values as a problem file says them."""
        return {"from": self.start, "to": self.end, "within": self.within}


@dataclass(frozen=True, eq=False)
class OnCircle(Statement):
    """The origin of a frame stays near a circle.

    Attributes:
        frame: a link or fixed frame of the robot.
        centre: (3,) m.
        normal: (3,) unit vector along its axis.
        radius: m.
        within: m.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "circle"

    frame: str
    centre: Array
    normal: Array
    radius: float
    within: float
    during: During = WHOLE

    @classmethod
    def of(cls, data: Mapping[str, Any], frame: str, during: During) -> Self:
        """Return the constraint of a validated entry of a file."""
        return cls(frame, np.array(data["centre"], float), unit(data["normal"]), data["radius"], data["within"], during)

    def to_data(self) -> dict[str, Any]:
        """Return its values as a problem file says them."""
        return {"centre": self.centre, "normal": self.normal, "radius": self.radius, "within": self.within}


@dataclass(frozen=True, eq=False)
class OnArc(Statement):
    """The origin of a frame stays near the circular arc between two points, through a third.

    Attributes:
        frame: a link or fixed frame of the robot.
        start, through, end: (3,) in the world, m; not in line.
        within: m.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "arc"

    frame: str
    start: Array
    through: Array
    end: Array
    within: float
    during: During = WHOLE

    @classmethod
    def of(cls, data: Mapping[str, Any], frame: str, during: During) -> Self:
        """Return the constraint of a validated entry of a file."""
        return cls(frame, *_points(data), data["within"], during)

    def to_data(self) -> dict[str, Any]:
        """Return its values as a problem file says them."""
        return {"from": self.start, "through": self.through, "to": self.end, "within": self.within}


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

    def to_data(self) -> dict[str, Any]:
        """Return its values as a problem file says them."""
        return {"axis": self.axis, "target": self.target, "within": self.within}


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


def _tolerance(data: Mapping[str, Any]) -> tuple[float, float]:
    return data["tolerance"]["position"], data["tolerance"]["orientation"]


def _points(data: Mapping[str, Any]) -> tuple[Array, Array, Array]:
    start, through, end = (np.array(data[key], float) for key in ("from", "through", "to"))
    return start, through, end


def _rotation(data: Mapping[str, Any]) -> dict[str, Any]:
    return {key: data[key] for key in ("rpy", "quaternion") if data.get(key) is not None}
