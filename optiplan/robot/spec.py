"""The keys of a `robot.yaml`."""

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from optiplan.config.built_later import BuiltLater
from optiplan.config.document import Number, Strict
from optiplan.config.values import FileName, FileVersion, Length, Name

Treatment = Literal["auto", "hull", "mesh", "convex_pieces"]
PerJoint = Number | list[Number] | dict[Name, Number]
"""One value for each planned joint, one for all of them, or values of some by name."""


class PackageSource(Strict):
    """A robot of the optional data package example-robot-data."""

    package: Literal["example-robot-data"]
    robot: Name


class LimitsSpec(Strict):
    """Limits that replace those of the URDF: rad/s (m/s), rad/s², rad/s³ and N·m (N)."""

    velocity: PerJoint | None = None
    acceleration: PerJoint | None = None
    jerk: PerJoint | None = None
    torque: PerJoint | None = None


class CollisionSpec(Strict):
    """Treatment of each link's mesh; links that are not named take the default."""

    default: Treatment = "auto"
    auto: list[Name] = Field(default=[])
    hull: list[Name] = Field(default=[])
    mesh: list[Name] = Field(default=[])
    convex_pieces: list[Name] = Field(default=[])


class MecanumSpec(Strict):
    """The mecanum wheels, of alternating hand, that three planned joints stand for; see `kinematics.mecanum`.

    `joints` slide along x and y and turn about z, in this order; the rest in m.
    """

    joints: Annotated[list[Name], Field(min_length=3, max_length=3)]
    radius: Length
    half_wheelbase: Length
    half_track: Length


def _dh() -> Any:
    from optiplan.robot.dh.spec import DhSpec

    return DhSpec | None


class RobotSpec(Strict):
    """A robot.yaml: required are the first two keys, and one of `urdf` and `dh`."""

    version: FileVersion
    name: Name
    urdf: FileName | PackageSource | None = None
    dh: Annotated[Any, BuiltLater(_dh)] = None
    srdf: FileName | None = None
    group: list[Name] | Name | None = None
    groups: dict[Name, list[Name]] = Field(default={})
    locked: dict[Name, Number] = Field(default={})
    tool_frame: Name | None = None
    tool_frames: dict[Name, Name] = Field(default={})
    configurations: dict[Name, list[Number] | dict[Name, Number]] = Field(default={})
    configurations_deg: dict[Name, list[Number] | dict[Name, Number]] = Field(default={})
    mecanum: MecanumSpec | None = None
    limits: LimitsSpec = LimitsSpec.model_construct()
    collision: Treatment | Literal["none"] | CollisionSpec = "auto"
    allowed_collisions: list[Annotated[list[Name], Field(min_length=2, max_length=2)]] = Field(default=[])

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.urdf is None) == (self.dh is None):
            found = "neither urdf nor dh" if self.urdf is None else "both urdf and dh"
            raise ValueError(f"found {found}; expected exactly one of: urdf, dh")
        return self
