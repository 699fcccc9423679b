"""The schema of path constraints in a problem file."""

import math
from typing import Annotated, Any, Self

from pydantic import AfterValidator, Field, model_validator

from optiplan.config.document import Number, Strict
from optiplan.config.values import Coordinate, Direction, ExactlyOne, Length, Name, NamePair, Quaternion, Size, Vector
from optiplan.geometry.pose import Angles, PoseSpec, ToleranceSpec
from optiplan.geometry.poses import in_radians


def _ordered(values: tuple[float, ...]) -> tuple[float, ...]:
    if len(values) != 2 or not 0.0 <= values[0] < values[1] <= 1.0:
        expected = "two fractions of the duration, [from, to] with 0 <= from < to <= 1"
        raise ValueError(f"found {list(values)}; expected {expected}")
    return values


class ConstraintSpec(Strict):
    """What all path constraints have; `frame` is the robot's tool frame without one."""

    frame: Name | None = None
    during: Annotated[tuple[Number, ...], AfterValidator(_ordered)] | None = None


class OrientationConeSpec(ConstraintSpec):
    """`axis` of the frame stays within an angle, rad, of the direction `toward` of the world."""

    axis: Direction
    toward: Direction
    within: Annotated[Length, Field(le=math.pi)]


class BoxSpec(Strict):
    """A box of edge lengths `size`, m, at `pose` in the world."""

    size: Size
    pose: PoseSpec = PoseSpec()


class PositionBoxSpec(ConstraintSpec):
    """The frame's origin stays in a box."""

    box: BoxSpec


class OnPlaneSpec(ConstraintSpec):
    """The frame's origin p stays near a plane: |normal · p - offset| <= within, m."""

    normal: Direction
    offset: Coordinate
    within: Length


class OnLineSpec(ConstraintSpec):
    """The frame's origin stays within a distance, m, of the segment between two points."""

    from_: Annotated[Vector, Field(alias="from")]
    to: Vector
    within: Length


class ToolSpeedSpec(ConstraintSpec):
    """The frame moves no faster than `linear`, m/s, and turns no faster than `angular`, rad/s."""

    linear: Length | None = None
    angular: Length | None = None

    @model_validator(mode="after")
    def _something(self) -> Self:
        if self.linear is None and self.angular is None:
            raise ValueError("found neither; expected linear, angular, or both")
        return self


class PairClearanceSpec(Strict):
    """Pairs of bodies stay farther apart than `at_least`, m."""

    pairs: Annotated[tuple[NamePair, ...], Field(min_length=1)]
    at_least: Length
    during: Annotated[tuple[Number, ...], AfterValidator(_ordered)] | None = None


class RelativePoseSpec(ConstraintSpec, PoseSpec):
    """The frame keeps its pose in the frame `to`, within `tolerance`."""

    to: Name
    tolerance: ToleranceSpec = ToleranceSpec()


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


class LookAtSpec(ConstraintSpec):
    """`axis` of the frame points at `target`, m, within an angle, rad."""

    axis: Direction
    target: Vector
    within: Annotated[Length, Field(lt=math.pi / 2)]


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


class OnCircleSpec(ConstraintSpec):
    """The frame's origin stays within a distance, m, of a circle."""

    centre: Vector
    normal: Direction
    radius: Length
    within: Length


class OnScrewSpec(ConstraintSpec):
    """The frame turns about an axis through `point`, sliding by `pitch`, m/rad; `pose` is one of its poses."""

    axis: Direction
    point: Vector
    pitch: Coordinate = 0.0
    pose: PoseSpec
    tolerance: ToleranceSpec = ToleranceSpec()


class ToolAccelerationSpec(ToolSpeedSpec):
    """The frame's acceleration is at most `linear`, m/s², its angular acceleration at most `angular`, rad/s²."""


class ManipulabilitySpec(ConstraintSpec):
    """Yoshikawa's measure of the frame's Jacobian is at least this."""

    at_least: Length


class JointCouplingSpec(Strict):
    """A sum of joint positions: |sum of coefficient · q - equals| <= within."""

    joints: Annotated[dict[Name, Number], Field(min_length=1)]
    equals: Number = 0.0
    within: Length
    during: Annotated[tuple[Number, ...], AfterValidator(_ordered)] | None = None


class WheelSpeedSpec(Strict):
    """No mecanum wheel of the robot turns faster than `at_most`, rad/s."""

    at_most: Length
    during: Annotated[tuple[Number, ...], AfterValidator(_ordered)] | None = None


class PathConstraintSpec(ExactlyOne):
    """One constraint on the path."""

    orientation: OrientationConeSpec | None = None
    position: PositionBoxSpec | None = None
    plane: OnPlaneSpec | None = None
    line: OnLineSpec | None = None
    tool_speed: ToolSpeedSpec | None = None
    clearance: PairClearanceSpec | None = None
    relative_pose: RelativePoseSpec | None = None
    fixed_orientation: FixedOrientationSpec | None = None
    look_at: LookAtSpec | None = None
    arc: OnArcSpec | None = None
    circle: OnCircleSpec | None = None
    screw: OnScrewSpec | None = None
    tool_acceleration: ToolAccelerationSpec | None = None
    manipulability: ManipulabilitySpec | None = None
    coupling: JointCouplingSpec | None = None
    wheel_speed: WheelSpeedSpec | None = None
