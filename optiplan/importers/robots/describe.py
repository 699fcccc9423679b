"""The robot of a file or folder, whatever program it is of."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path

from optiplan.errors import InputError, Issue
from optiplan.files import is_file, is_folder, read_bytes
from optiplan.importers.robots.description import Description
from optiplan.robot.urdf.reader import read_urdf, with_found_meshes

USD_ENDINGS = (".usd", ".usda", ".usdc", ".usdz")

_ROOT = re.compile(rb"<\s*([A-Za-z_][\w.-]*)")
_SKIPPED = re.compile(rb"<\?.*?\?>|<!--.*?-->|<!DOCTYPE[^>]*>", re.DOTALL)


def describe(path: Path, arguments: Mapping[str, str] | None = None) -> Description:
    """Read the robot of a URDF, a xacro file, an MJCF file, a USD stage or a MoveIt configuration folder.

    Args:
        path: of the file or folder.
        arguments: of a xacro file, by name; None: its defaults.

    Raises:
        InputError: none of these, or one that cannot be used.
        OptiPlanError: a package that is needed for it is not installed; the message says which.
    """
    usd = path.suffix in USD_ENDINGS
    if path.suffix == ".xacro" or (not usd and b"<xacro:" in _markup(path)):
        return _expanded(path, arguments or {})
    if arguments:
        found = f"arguments ({', '.join(arguments)})"
        raise InputError([Issue(str(path), None, "xacro", found, "none, since this is no xacro file")])
    if is_folder(path):
        from optiplan.importers.robots.moveit_config import describe_moveit

        return describe_moveit(path)
    if usd:
        from optiplan.importers.robots.usd.to_urdf import describe_usd

        return describe_usd(path)
    if root_tag(path) == "mujoco":
        from optiplan.importers.robots.mjcf.to_urdf import describe_mjcf

        return describe_mjcf(path)
    name = ET.fromstring(read_urdf(path, path.parent).xml).get("name") or path.stem
    return Description(path, name, urdf=path)


def _expanded(path: Path, arguments: Mapping[str, str]) -> Description:
    from optiplan.importers.robots.xacro_files import Arguments, expand_xacro
    from optiplan.robot.urdf.ros_packages import RosPackages

    text = expand_xacro(path, RosPackages(path.parent), given := Arguments(arguments))
    given.refuse_unknown(path)
    name = ET.fromstring(read_urdf(path, path.parent, text).xml).get("name") or path.name.split(".")[0]
    text, notes = with_found_meshes(path, path.parent, text)
    stated = ", ".join(f"{name}={value}" for name, value in arguments.items())
    expanded = f"expanded by xacro, with {f'{stated} and the other' if stated else 'the'} defaults of {path.name}"
    return Description(path, name, text=text, notes=(expanded, *notes))


def root_tag(path: Path) -> str:
    """The tag of the root of an XML file; empty where it is none."""
    match = _ROOT.search(_markup(path))
    return "" if match is None else match[1].decode()


def _markup(path: Path) -> bytes:
    """An XML file without comments, declarations and processing instructions; empty where there is none."""
    return _SKIPPED.sub(b"", read_bytes(path)) if is_file(path) else b""
