"""The key `dh:` of a robot.yaml: a Denavit–Hartenberg table, the bodies of its links, and links joined beside it."""

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from optiplan.config.document import Number, Strict
from optiplan.config.values import Length, Name, NotNegative
from optiplan.geometry.poses import check_angles
from optiplan.robot.dh.table import DhRow, DhTable

Vector = Annotated[list[Number], Field(min_length=3, max_length=3)]
Moments = Annotated[list[NotNegative], Field(min_length=3, max_length=3)]
Range = Annotated[list[Number], Field(min_length=2, max_length=2)]


class DhRoundSpec(Strict):
    """A cylinder, or a capsule whose `length` is that of the cylindrical part; along z, centred; m."""

    radius: Length
    length: Length


class DhPoseSpec(Strict):
    """`position`, m, and `rpy` about fixed axes, in the unit of the table, or `rpy_deg`."""

    position: Vector = Field(default_factory=lambda: [0.0, 0.0, 0.0])
    rpy: Vector = Field(default_factory=lambda: [0.0, 0.0, 0.0])
    rpy_deg: Vector | None = None

    @model_validator(mode="after")
    def _one_rotation(self) -> Self:
        if self.rpy_deg is not None and any(self.rpy):
            raise ValueError("found both rpy and rpy_deg; expected at most one of them")
        return self


class BodySpec(DhPoseSpec):
    """One primitive, posed in the frame of its link."""

    box: Annotated[list[Length], Field(min_length=3, max_length=3)] | None = None
    sphere: Length | None = None
    cylinder: DhRoundSpec | None = None
    capsule: DhRoundSpec | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        found = [name for name in ("box", "sphere", "cylinder", "capsule") if getattr(self, name) is not None]
        if len(found) != 1:
            words = " and ".join(found) or "no shape"
            raise ValueError(f"found {words}; expected exactly one of: box, sphere, cylinder, capsule")
        return self


class LinkSpec(Strict):
    """Mass, inertia and bodies of a link, in the frame of the link.

    By default the inertia is that of the geometry with uniform density. `centre` (m) and `inertia` about it,
    [xx, yy, zz] (kg·m²), replace it.
    """

    geometry: list[BodySpec] | None = None
    mass: NotNegative | None = None
    centre: Vector | None = None
    inertia: Moments | None = None

    @model_validator(mode="after")
    def _known_together(self) -> Self:
        if (self.centre is None) != (self.inertia is None) or (self.centre is not None and self.mass is None):
            raise ValueError("found some of mass, centre and inertia; expected mass alone, or all three")
        return self


class RowSpec(LinkSpec):
    """One row of the table; the limits [lower, upper] of a revolute joint in the table's unit, default: endless."""

    name: Name | None = None
    joint: Literal["revolute", "prismatic"] | None = None
    joint_name: Name | None = None
    a: Number = 0.0
    alpha: Number = 0.0
    d: Number = 0.0
    theta: Number = 0.0
    limits: Range | None = None

    @model_validator(mode="after")
    def _limits_fit(self) -> Self:
        check_limits(self.joint, self.limits, self.joint_name)
        return self


class BaseSpec(LinkSpec):
    """The link that carries everything, which does not move."""

    name: Name = "base_link"


class JoinedSpec(LinkSpec, DhPoseSpec):
    """A link beside the table, and the joint that holds it: in the pose, before the joint moves, of `parent`."""

    name: Name
    parent: Name
    joint: Literal["revolute", "prismatic"] | None = None
    joint_name: Name | None = None
    axis: Vector = Field(default_factory=lambda: [0.0, 0.0, 1.0])
    limits: Range | None = None

    @model_validator(mode="after")
    def _limits_fit(self) -> Self:
        check_limits(self.joint, self.limits, self.joint_name)
        if not math.hypot(*self.axis) > 0.0:
            raise ValueError("found an axis of length 0; expected a direction")
        return self


class DhSpec(DhPoseSpec):
    """A robot as a table; `position` and `rpy` pose the table's first frame in the link `parent`.

    `radius` (m) of the capsules that stand for links without `geometry`: along the offsets of their rows.
    """

    convention: Literal["standard", "modified"]
    unit: Literal["deg", "rad"]
    rows: Annotated[list[RowSpec], Field(min_length=1)]
    base: BaseSpec = Field(default_factory=BaseSpec)
    parent: Name | None = None
    links: list[JoinedSpec] = Field(default=[])
    radius: Length | None = None

    def angle(self, value: float) -> float:
        """An angle of the file in rad."""
        return math.radians(value) if self.unit == "deg" else value

    @model_validator(mode="after")
    def _angles_fit(self) -> Self:
        if self.unit == "rad":
            for row in self.rows:
                check_angles((row.alpha, row.theta), "unit: deg")
            links = (self.base, *self.rows, *self.links)
            posed: tuple[DhPoseSpec, ...] = (
                self,
                *self.links,
                *(body for link in links for body in link.geometry or ()),
            )
            for one in posed:
                check_angles(one.rpy, "rpy_deg")
        return self

    def rotation(self, pose: DhPoseSpec) -> list[float]:
        """Roll, pitch and yaw of a pose of the file, rad."""
        if pose.rpy_deg is not None:
            return [math.radians(angle) for angle in pose.rpy_deg]
        return [self.angle(angle) for angle in pose.rpy]

    def table(self) -> DhTable:
        """The table itself, in rad and m."""
        names = self.row_names()
        rows = (
            DhRow(row.a, self.angle(row.alpha), row.d, self.angle(row.theta), row.joint, name)
            for row, name in zip(self.rows, names, strict=True)
        )
        return DhTable(self.convention, tuple(rows))

    def row_names(self) -> list[str]:
        """Names of the rows' links: their own, or link_1, link_2 and so on."""
        return [row.name or f"link_{i}" for i, row in enumerate(self.rows, 1)]


def check_limits(joint: str | None, limits: list[float] | None, name: str | None) -> None:
    """Refuse limits that a joint of this kind cannot have.

    Raises:
        ValueError: in words of the form `found …; expected …`, which `config.messages` takes apart.
    """
    if joint is None and (limits is not None or name is not None):
        raise ValueError("found limits or joint_name without a joint; expected joint: revolute or prismatic")
    if joint == "prismatic" and limits is None:
        raise ValueError("found a prismatic joint without limits; expected limits: [lower, upper] in m")
    if limits is not None and limits[0] > limits[1]:
        raise ValueError(f"found limits [{limits[0]:g}, {limits[1]:g}]; expected lower <= upper")
