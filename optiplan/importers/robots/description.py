"""What an importer makes of another program's robot: a URDF, files beside it, keys of the robot.yaml, and remarks."""

from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

from optiplan.records import dataclass
from optiplan.robot.urdf.srdf import LinkPair


@dataclass(frozen=True)
class Description:
    """A robot of another program; what is empty is OptiPlan's default.

    Attributes:
        source: the file or folder that was read.
        name: of the robot.
        urdf: a URDF that is used where it lies; None: `text` is one.
        text: a URDF that was made, whose meshes are `files` or absolute paths.
        files: to be written beside the robot.yaml: relative path to content.
        keys: of the robot.yaml, as they are.
        limits: by quantity (`acceleration`, …) and joint, rad or m and seconds.
        states: named configurations, each a value by joint, rad or m.
        rest: positions of joints that are not planned, rad or m.
        allowed: pairs of links that need no check.
        notes: what was assumed and what was left out.
    """

    source: Path
    name: str
    urdf: Path | None = None
    text: str = ""
    files: Mapping[str, bytes] = field(default_factory=dict)
    keys: Mapping[str, Any] = field(default_factory=dict)
    limits: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    states: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    rest: Mapping[str, float] = field(default_factory=dict)
    allowed: tuple[LinkPair, ...] = ()
    notes: tuple[str, ...] = ()
