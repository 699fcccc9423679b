"""A MoveIt configuration folder as a robot: URDF, SRDF, joint_limits.yaml.

URDF, SRDF          those that `.setup_assistant` names, else those in `config/`; xacro files are expanded
groups              of joints, links, chains and groups; the tool frame is the tip of the chain
group states        configurations, by the SRDF itself
disabled pairs      not checked, with the words of the SRDF
joint_limits.yaml   positions go into the URDF; velocities, accelerations and jerks into `limits`
all others          left out with a remark: kinematics, controllers, planners, sensors
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from optiplan.config.messages import describe
from optiplan.errors import InputError, Issue
from optiplan.files import is_file, read_bytes
from optiplan.importers.robots.description import Description
from optiplan.importers.robots.srdf_groups import read_groups
from optiplan.importers.robots.xacro_files import expand_xacro
from optiplan.records import dataclass
from optiplan.robot.urdf.elements import parsed_xml, xml_text
from optiplan.robot.urdf.reader import UrdfSource, read_urdf, with_found_meshes
from optiplan.robot.urdf.ros_packages import RosPackages

SRDF_FILE = "moveit.srdf"
"""Beside the robot.yaml: the SRDF of the configuration, with xacro expanded."""

LIMITS_FILE = "joint_limits.yaml"

NOT_READ = {
    "kinematics.yaml": "OptiPlan solves inverse kinematics itself",
    "initial_positions.yaml": "joints that are not planned stand at zero, moved into their limits (--lock)",
}
"""Files of the folder that are left out for a reason of their own."""

RATES = ("velocity", "acceleration", "jerk")


@dataclass(frozen=True)
class _Named:
    """The files that a configuration consists of."""

    urdf: Path
    srdf: Path
    arguments: Mapping[str, str]


def describe_moveit(folder: Path) -> Description:
    """Read a MoveIt configuration folder.

    Raises:
        InputError: no such folder, no URDF or SRDF in it, or one of its files cannot be used.
        OptiPlanError: a xacro file without the package `xacro`.
    """
    packages = RosPackages(folder)
    named = _named_files(folder, packages)
    text = _xml(named.urdf, packages, named.arguments)
    srdf_text = _xml(named.srdf, packages, {})
    urdf = read_urdf(named.urdf, folder, text)
    srdf = parsed_xml(named.srdf, "srdf", srdf_text)
    groups = read_groups(srdf, named.srdf, urdf)
    limits, positions, notes = _joint_limits(folder, urdf)
    text, guessed = with_found_meshes(named.urdf, folder, text)
    root = ET.fromstring(text)
    notes += _narrow(root, positions)
    keys: dict[str, Any] = {"srdf": SRDF_FILE}
    if groups.groups:
        keys["groups"] = groups.groups
    if groups.tools:
        keys["tool_frames"] = groups.tools
    left_out = [f"left out: {name}, {why}" for name, why in NOT_READ.items() if (folder / "config" / name).exists()]
    others = sorted(
        path.name for path in (folder / "config").glob("*.yaml") if path.name not in (*NOT_READ, LIMITS_FILE)
    )
    if others:
        left_out.append(f"left out: {', '.join(others)}")
    return Description(
        source=folder,
        name=srdf.get("name") or root.get("name") or folder.name,
        text=xml_text(root),
        files={SRDF_FILE: srdf_text.encode()},
        keys=keys,
        limits=limits,
        notes=(*guessed, *groups.notes, *notes, *left_out),
    )


def _named_files(folder: Path, packages: RosPackages) -> _Named:
    if not folder.is_dir():
        raise InputError([Issue(str(folder), None, "robots init", "no folder", "a MoveIt configuration folder")])
    file = folder / ".setup_assistant"
    setup = _part(file, _yaml(file), "moveit_setup_assistant_config")
    parts = {str(key).lower(): value for key, value in setup.items() if isinstance(value, Mapping)}
    urdf, srdf = _stated_urdf(parts.get("urdf") or {}, packages, folder), None
    relative = str((parts.get("srdf") or {}).get("relative_path") or "")
    if relative and is_file(folder / relative):
        srdf = folder / relative
    urdf = urdf or _only(folder, "urdf")
    srdf = srdf or _only(folder, "srdf")
    words = str((parts.get("urdf") or {}).get("xacro_args") or "").split()
    arguments = dict(word.split(":=", 1) for word in words if ":=" in word)
    return _Named(urdf, srdf, arguments)


def _stated_urdf(stated: Mapping[str, Any], packages: RosPackages, folder: Path) -> Path | None:
    """The URDF that the setup assistant wrote down, in a package that may not be here."""
    name, relative = str(stated.get("package") or ""), str(stated.get("relative_path") or "")
    package = packages.find(name) if name else folder
    if not relative or package is None or not is_file(package / relative):
        return None
    return package / relative


def _only(folder: Path, kind: str) -> Path:
    """The one file of a kind in `config/`, a plain one before one of xacro.

    Raises:
        InputError: there is none, or there are several.
    """
    for ending in (f".{kind}", f".{kind}.xacro"):
        found = sorted(path for path in (folder / "config").glob(f"*{ending}"))
        if len(found) == 1:
            return found[0]
        if found:
            names = ", ".join(path.name for path in found)
            expected = f"one, or a .setup_assistant that names it and a package that is near ({kind})"
            raise InputError([Issue(str(folder / "config"), None, kind, f"several files: {names}", expected)])
    expected = f"config/NAME.{kind}, config/NAME.{kind}.xacro, or a .setup_assistant that names one in a package near"
    raise InputError([Issue(str(folder), None, kind, f"no {kind.upper()}", expected)])


def _xml(path: Path, packages: RosPackages, arguments: Mapping[str, str]) -> str:
    if path.suffix == ".xacro":
        return expand_xacro(path, packages, dict(arguments))
    return read_bytes(path).decode("utf-8", errors="replace")


def _yaml(path: Path) -> dict[str, Any]:
    """A YAML file that may be missing, as a mapping."""
    if not is_file(path):
        return {}
    try:
        data = YAML(typ="safe", pure=True).load(read_bytes(path))
    except (YAMLError, OSError, ValueError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        line = None if mark is None else int(mark.line) + 1
        found = " ".join(str(error).split())
        raise InputError([Issue(str(path), line, "yaml", found, "a YAML file")]) from error
    return data if isinstance(data, dict) else {}


def _part(path: Path, data: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    """A mapping inside a YAML file; an empty one where it is missing or nothing stands behind its key.

    Raises:
        InputError: it is something else.
    """
    part = data.get(key)
    if part is not None and not isinstance(part, Mapping):
        raise InputError([Issue(str(path), _line(path, key), key, describe(part), "keys with values, or nothing")])
    return part or {}


def _line(path: Path, key: str) -> int | None:
    """The line of a YAML file on which a key stands first."""
    lines = read_bytes(path).decode("utf-8", errors="replace").splitlines()
    return next((number for number, line in enumerate(lines, 1) if line.strip().startswith(f"{key}:")), None)


def _joint_limits(
    folder: Path, urdf: UrdfSource
) -> tuple[dict[str, dict[str, float]], dict[str, tuple[float | None, float | None]], list[str]]:
    """Rates by quantity and joint, [lower, upper] by joint, and remarks.

    Raises:
        InputError: a value that is no number above 0, or positions whose lower one is not below the upper one.
    """
    path = folder / "config" / LIMITS_FILE
    data = _yaml(path)
    notes = [
        f"left out: {key} of {LIMITS_FILE}; `limits:` of a problem scales them"
        for key in ("default_velocity_scaling_factor", "default_acceleration_scaling_factor")
        if (data.get(key) or 1.0) != 1.0
    ]
    rates: dict[str, dict[str, float]] = {key: {} for key in RATES}
    positions: dict[str, tuple[float | None, float | None]] = {}
    listed = _part(path, data, "joint_limits")
    for joint in listed:
        if joint not in urdf.joint_types:
            notes.append(f"left out: limits of {joint}, which the robot does not have")
            continue
        stated = _part(path, listed, joint)
        for key in RATES:
            if stated.get(f"has_{key}_limits", False):
                rates[key][joint] = _number(path, joint, f"max_{key}", stated.get(f"max_{key}"))
        if stated.get("has_position_limits", "min_position" in stated or "max_position" in stated):
            low, high = (
                None if stated.get(key) is None else _number(path, joint, key, stated[key], signed=True)
                for key in ("min_position", "max_position")
            )
            if low is not None and high is not None and low >= high:
                found = f"{low:g}, which is not below max_position, {high:g}"
                where = _line(path, joint)
                raise InputError([Issue(str(path), where, f"{joint}.min_position", found, "a number below it")])
            positions[joint] = (low, high)
    return {key: values for key, values in rates.items() if values}, positions, notes


def _number(path: Path, joint: str, key: str, value: object, signed: bool = False) -> float:
    good = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e12
    if not good or (not signed and not float(value) > 0.0):  # type: ignore[arg-type]  # a number, by `good`
        expected = "a number" if signed else "a number > 0, rad or m and seconds"
        raise InputError([Issue(str(path), _line(path, joint), f"{joint}.{key}", f"{value!r}", expected)])
    return float(value)  # type: ignore[arg-type]


def _narrow(root: ET.Element, positions: Mapping[str, tuple[float | None, float | None]]) -> Iterator[str]:
    """Put position limits into the URDF; note those of one end of a joint that turns without end."""
    for joint in root.findall("joint"):
        name, limit = joint.get("name", ""), joint.find("limit")
        ends = positions.get(name, (None, None))
        if joint.get("type") == "continuous" and any(end is not None for end in ends):
            if None in ends:
                yield f"left out: the position limit of {name}, which turns without end and has one end only"
                continue
            joint.set("type", "revolute")
            limit = ET.SubElement(joint, "limit") if limit is None else limit
        for key, value in zip(("lower", "upper"), ends, strict=True):
            if limit is not None and value is not None:
                limit.set(key, repr(value))
