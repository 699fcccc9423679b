"""Packages of ROS by name, without ROS: those near a file, and those of `ROS_PACKAGE_PATH` and `AMENT_PREFIX_PATH`."""

import os
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

from optiplan.files import is_file, read_bytes

MANIFEST = "package.xml"
UP = 3
"""Folders above a file in which packages are looked for."""


class RosPackages:
    """Folders of packages by the name in their package.xml."""

    def __init__(self, near: Path) -> None:
        """Look above `near`, a file or folder, and beside what is above it."""
        self._near = near.resolve()
        self._found: dict[str, Path] | None = None

    def find(self, name: str) -> Path | None:
        """Return the folder of a package; None where there is none of that name."""
        return self._known().get(name)

    def names(self) -> list[str]:
        """Return the names of all packages that were found."""
        return sorted(self._known())

    def _known(self) -> dict[str, Path]:
        if self._found is None:
            self._found = {}
            for folder in self._folders():
                if is_file(folder / MANIFEST) and (name := _package_name(folder)):
                    self._found.setdefault(name, folder)
        return self._found

    def _folders(self) -> Iterator[Path]:
        above = [self._near, *list(self._near.parents)[:UP]]
        for folder in above:
            if folder.is_dir():
                yield folder
                yield from sorted(child for child in folder.iterdir() if child.is_dir())
        for variable, inside in (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share")):
            for entry in filter(None, os.environ.get(variable, "").split(os.pathsep)):
                folder = Path(entry) / inside
                if folder.is_dir():
                    yield folder
                    yield from sorted(child for child in folder.iterdir() if child.is_dir())


def _package_name(folder: Path) -> str:
    try:
        return (ET.fromstring(read_bytes(folder / MANIFEST)).findtext("name") or "").strip()
    except (OSError, ET.ParseError, ValueError, LookupError):
        return ""
