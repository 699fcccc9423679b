"""Path constraints on the origin of a frame: what stands under each key of a problem file, and what it states."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Self

import numpy as np
import pinocchio as pin
from pydantic import Field, model_validator

from optiplan.arrays import Array
from optiplan.config.document import Strict
from optiplan.config.values import Coordinate, Direction, Length, Size, Vector
from optiplan.geometry.pose import PoseSpec
from optiplan.geometry.poses import pose_from_data, pose_to_data
from optiplan.problem.constraints.base import WHOLE, ConstraintSpec, During, Statement, unit


class BoxSpec(Strict):
    """A box of edge lengths `size`, m, at `pose` in the world."""

    size: Size
    pose: PoseSpec = PoseSpec()


class PositionBoxSpec(ConstraintSpec):
    """The frame's origin stays in a box."""

    box: BoxSpec


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


class OnPlaneSpec(ConstraintSpec):
    """The frame's origin p stays near a plane: |normal · p - offset| <= within, m."""

    normal: Direction
    offset: Coordinate
    within: Length


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


class OnLineSpec(ConstraintSpec):
    """The frame's origin stays within a distance, m, of the segment between two points."""

    from_: Annotated[Vector, Field(alias="from")]
    to: Vector
    within: Length


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


class OnCircleSpec(ConstraintSpec):
    """The frame's origin stays within a distance, m, of a circle."""

    centre: Vector
    normal: Direction
    radius: Length
    within: Length


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


class OnArcSpec(ConstraintSpec):
    """The frame's origin stays within a distance, m, of the arc between two points through a third."""

    from_: Annotated[Vector, Field(alias="from")]
    through: Vector
    to: Vector
    within: Length

    @model_validator(mode="after")
    def _round(self) -> Self:
        a, b, c = (tuple(point) for point in (self.from_, self.through, self.to))
        u, v = ([y - x for x, y in zip(a, end, strict=True)] for end in (b, c))
        cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
        if math.hypot(*cross) <= 1e-6 * math.hypot(*u) * math.hypot(*v) or math.hypot(*u) * math.hypot(*v) == 0.0:
            raise ValueError("found three points in line; expected points of an arc")
        return self


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


def _points(data: Mapping[str, Any]) -> tuple[Array, Array, Array]:
    start, through, end = (np.array(data[key], float) for key in ("from", "through", "to"))
    return start, through, end
