"""Packages of ROS by name, without ROS: those near files, and those of `ROS_PACKAGE_PATH` and `AMENT_PREFIX_PATH`."""

import os
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

from optiplan.files import is_file, read_bytes

MANIFEST = "package.xml"
UP = 3
"""Folders above a file in which packages are looked for."""


class RosPackages:
    """Folders of packages, by the name in their package.xml.

    Args:
        near: folders; packages are looked for in them, above them, and beside what is above them.

    Attributes:
        roots: these folders and those above them, the nearest first.
    """

    def __init__(self, *near: Path) -> None:
        folders = [folder.resolve() for folder in near]
        self.roots = list(dict.fromkeys([*folders, *(up for folder in folders for up in list(folder.parents)[:UP])]))

    def find(self, name: str) -> Path | None:
        """Return the folder of a package; None where there is none of that name."""
        return next((folder for folder, own in self._names.items() if own == name), None)

    def folders(self, name: str) -> list[Path]:
        """Return the folders whose package.xml has this name, then those that are called so."""
        stated = [folder for folder, own in self._names.items() if own == name]
        return [*stated, *(folder for folder in self._names if folder.name == name)]

    def name_of(self, folder: Path) -> str:
        """Return the name in the package.xml of a folder; empty where it has none."""
        return self._names.get(folder, "")

    def names(self) -> list[str]:
        """Return the names of all packages that were found."""
        return sorted({*self._names.values()} - {""})

    @cached_property
    def _names(self) -> dict[Path, str]:
        places = [Path(entry) for entry in _entries("ROS_PACKAGE_PATH")]
        places += [Path(entry, "share") for entry in _entries("AMENT_PREFIX_PATH")]
        folders = [each for place in (*self.roots, *places) for each in _with_children(place)]
        return {folder: _package_name(folder) for folder in dict.fromkeys(folders)}


def _entries(variable: str) -> Iterator[str]:
    return filter(None, os.environ.get(variable, "").split(os.pathsep))


def _with_children(folder: Path) -> list[Path]:
    """Return a folder and those in it; none where it cannot be read."""
    try:
        return [folder, *sorted(Path(child.path) for child in os.scandir(folder) if child.is_dir())]
    except OSError:
        return []


def _package_name(folder: Path) -> str:
    if not is_file(folder / MANIFEST):
        return ""
    try:
        return (ET.fromstring(read_bytes(folder / MANIFEST)).findtext("name") or "").strip()
    except (OSError, ET.ParseError, ValueError, LookupError):
        return ""
