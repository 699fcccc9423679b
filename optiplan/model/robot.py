"""The robot: kinematics, collision geometry and limits of the planned joints, loaded once and never changed."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import pinocchio as pin

from optiplan.arrays import Array


@dataclass(frozen=True, eq=False)
class Limits:
    """Bounds of the planned joints, each of shape (n,), in rad or m and seconds; torque in N·m or N.

    `lower` and `upper` are -inf and inf for joints that turn without end.
    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    jerk: Array
    torque: Array


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot reduced to its planned joints; a configuration q is of shape (n,), in the order of `joint_names`."""

    name: str
    source: Path
    model: pin.Model
    geometry: pin.GeometryModel
    visual: pin.GeometryModel
    limits: Limits
    joint_names: tuple[str, ...]
    tool_frame: str
    configurations: Mapping[str, Array]
    link_geometry: Mapping[str, str]
    notes: tuple[str, ...] = ()

    @property
    def n(self) -> int:
        """Number of planned joints."""
        return len(self.joint_names)
