"""Packages of ROS by name, without ROS: those near files, and those of `ROS_PACKAGE_PATH` and `AMENT_PREFIX_PATH`."""

import os
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator
from functools import cached_property
from itertools import chain
from pathlib import Path

from optiplan.files import is_file, is_folder, read_bytes

MANIFEST = "package.xml"
UP = 3
"""Folders above a file in which packages are looked for."""


class RosPackages:
    """Folders of packages, by the name in their package.xml; each is read when a search comes to it.

    Args:
        near: folders, the likeliest first; packages are looked for in them, above them, and beside what is above them.

    Attributes:
        roots: these folders and those above them, the nearest first.
    """

    def __init__(self, *near: Path) -> None:
        folders = [folder.resolve() for folder in near]
        self.roots = list(dict.fromkeys([*folders, *(up for folder in folders for up in list(folder.parents)[:UP])]))
        self._names: dict[Path, str] = {}

    def find(self, name: str) -> Path | None:
        """Return the folder of a package; None where there is none of that name."""
        found = (folder for folders in self._searched() for folder in folders if self.name_of(folder) == name)
        return next(found, None)

    def folders(self, name: str) -> Iterator[Path]:
        """Yield the folders near whose package.xml has this name, those called so without one, and then the others.

        The packages that hold the folders near come before all others: another copy of one may lie beside it. Those
        called so with another name in it come last, such as example-robot-data: its package.xml has a name of its own,
        and its meshes name the folder.
        """
        for folders in self._searched():
            yield from (folder for folder in folders if self.name_of(folder) == name)
            yield from (folder for folder in folders if folder.name == name and not self.name_of(folder))
        for folders in self._searched():
            yield from (folder for folder in folders if folder.name == name and self.name_of(folder) not in ("", name))

    def copies(self, name: str, inside: str) -> list[Path]:
        """Return the folders near that are called like a package, are it, and have this file."""
        called = (folder for folder in self._near if folder.name == name and self.name_of(folder) in ("", name))
        return [folder for folder in called if is_file(folder / inside)]

    def name_of(self, folder: Path) -> str:
        """Return the name in the package.xml of a folder; empty where it has none."""
        if folder not in self._names:
            self._names[folder] = _package_name(folder)
        return self._names[folder]

    def names(self) -> list[str]:
        """Return the names of all packages that were found."""
        return sorted({self.name_of(folder) for folder in chain(*self._searched())} - {""})

    def _searched(self) -> Iterator[list[Path]]:
        """Yield the folders near and those above them, what is in these, and then those of the environment."""
        yield self.roots
        yield self._near
        yield self._installed

    @cached_property
    def _near(self) -> list[Path]:
        return _with_children(self.roots)

    @cached_property
    def _installed(self) -> list[Path]:
        places = [Path(entry) for entry in _entries("ROS_PACKAGE_PATH")]
        return _with_children([*places, *(Path(entry, "share") for entry in _entries("AMENT_PREFIX_PATH"))])


def _entries(variable: str) -> Iterator[str]:
    return filter(None, os.environ.get(variable, "").split(os.pathsep))


def _with_children(places: Iterable[Path]) -> list[Path]:
    """Return folders, each with those in it; alone where it cannot be read."""
    found: list[Path] = []
    for place in places:
        try:
            names = sorted(os.listdir(place))
        except OSError:
            names = []
        found += [place, *(child for name in names if is_folder(child := place / name))]
    return list(dict.fromkeys(found))


def _package_name(folder: Path) -> str:
    if not is_file(folder / MANIFEST):
        return ""
    try:
        return (ET.fromstring(read_bytes(folder / MANIFEST)).findtext("name") or "").strip()
    except (OSError, ET.ParseError, ValueError, LookupError):
        return ""
