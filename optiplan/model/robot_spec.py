"""The keys of a `robot.yaml`."""

from typing import Annotated, Literal

from pydantic import Field, field_validator

from optiplan.yaml_lines import Number, Strict

Name = Annotated[str, Field(min_length=1)]
Treatment = Literal["hull", "mesh", "convex_pieces"]
PerJoint = Number | list[Number]
"""One value for each planned joint, or one for all of them."""


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
    """What is checked for the mesh of each link; links that are not named take the default."""

    default: Treatment = "hull"
    hull: list[Name] = Field(default_factory=list)
    mesh: list[Name] = Field(default_factory=list)
    convex_pieces: list[Name] = Field(default_factory=list)


class RobotSpec(Strict):
    """A robot.yaml: only the first three keys are required."""

    version: Literal[1]
    name: Name
    urdf: Name | PackageSource
    srdf: Name | None = None
    group: list[Name] | Name | None = None
    groups: dict[Name, list[Name]] = Field(default_factory=dict)
    locked: dict[Name, Number] = Field(default_factory=dict)
    tool_frame: Name | None = None
    configurations: dict[Name, list[Number]] = Field(default_factory=dict)
    limits: LimitsSpec = LimitsSpec()
    collision: Treatment | CollisionSpec = "hull"

    @field_validator("version", mode="before")
    @classmethod
    def _whole_number(cls, value: object) -> object:
        if isinstance(value, bool | float):
            raise ValueError("1")
        return value
