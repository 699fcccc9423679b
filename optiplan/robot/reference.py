"""References to robots: a name, the path of a robot.yaml, or its content."""

import functools
import json
import os
from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any

from optiplan.config.document import Document, read_yaml
from optiplan.errors import UnknownChoiceError
from optiplan.files import is_folder
from optiplan.records import dataclass
from optiplan.resources import robots_dir

DESCRIPTION = "<robot>"
"""Stands for the robot.yaml of a robot that has none."""

ROBOTS = "robots"
"""Key of several robots side by side."""


@dataclass(frozen=True)
class Reference:
    """The arguments by which `load_robot` loads a robot again, and by which a problem file names it.

    Attributes:
        robot: a name of `robot_names()`, the path of a robot.yaml, or its content.
        group: the requested group of joints; None: that of the robot file.
        locked: requested positions of joints, rad or m.
        tool_frame: of the robot as it was loaded.
    """

    robot: str | Mapping[str, Any]
    group: str | None = None
    locked: Mapping[str, float] = field(default_factory=dict)
    tool_frame: str = ""


UNKNOWN = Reference("")
"""The reference of a robot that was not loaded."""


def robot_names() -> list[str]:
    """Return the names of the robots that come with OptiPlan."""
    return list(_names(robots_dir()))


@functools.cache
def _names(folder: Path) -> tuple[str, ...]:
    return tuple(sorted(path.parent.name for path in folder.glob("*/robot.yaml")))


def robot_file(ref: str, base: Path | None = None) -> Path:
    """Return the robot.yaml of `ref`: a name of `robot_names()`, or a path relative to `base`.

    Raises:
        UnknownChoiceError: `ref` is neither a name nor a path.
    """
    if ref in robot_names():
        return robots_dir() / ref / "robot.yaml"
    path = Path(base or ".") / ref
    if is_folder(path):
        return path / "robot.yaml"
    if path.suffix not in (".yaml", ".yml") and not os.path.isfile(path):
        raise UnknownChoiceError("robot", ref, [*robot_names(), "a path to a robot.yaml"])
    return path


def description(keys: Mapping[str, Any], base: Path | None) -> Document:
    """Return a robot.yaml that is not a file, with absolute paths."""
    folder = (base or Path()).resolve()
    data = dict(keys)
    for key in ("urdf", "srdf"):
        if isinstance(data.get(key), str):
            data[key] = str((folder / data[key]).resolve())
    name = Path(data["urdf"]).stem if isinstance(data.get("urdf"), str) else "robot"
    return Document(folder / DESCRIPTION, {"version": 1, "name": name, **data}, {})


def inline_content(document: Document, ref: str | Mapping[str, Any]) -> list[bytes]:
    """Return the content of a robot.yaml that is not a file, without paths, for the fingerprint."""
    if not isinstance(ref, Mapping):
        return []
    keys = {
        key: value for key, value in document.data.items() if key not in ("urdf", "srdf") or not isinstance(value, str)
    }
    return [json.dumps(keys, sort_keys=True).encode()]


def referred(document: Document, ref: str | Mapping[str, Any]) -> str | Mapping[str, Any]:
    """Return a reference to the same robot that is valid from any folder."""
    if isinstance(ref, Mapping):
        return dict(document.data)
    return ref if ref in robot_names() else str(document.path)


def several_robots(ref: str | Mapping[str, Any], base: Path | None) -> Document | None:
    """Return the robot.yaml of `ref` if it has several robots; None for one robot."""
    if isinstance(ref, Mapping):
        made = description(ref, base)  # which gives it the name that an inline robot has
        return replace(made, data={"version": 1, **ref}) if ROBOTS in ref else None
    document = read_yaml(robot_file(ref, base).resolve())
    return document if isinstance(document.data, dict) and ROBOTS in document.data else None
