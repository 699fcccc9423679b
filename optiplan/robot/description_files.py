"""A robot's URDF and SRDF: beside its robot.yaml, from the table in it, or in the data package example-robot-data."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from optiplan.config.document import Document
from optiplan.config.messages import choices
from optiplan.errors import InputError
from optiplan.robot.spec import RobotSpec
from optiplan.robot.urdf.reader import UrdfSource, read_urdf
from optiplan.robot.urdf.srdf import Srdf, read_srdf

PACKAGE_FOLDERS = ("cmeel.prefix/share/example-robot-data/robots", "share/example-robot-data/robots")


class DescriptionFiles(NamedTuple):
    """URDF and SRDF of a robot; `srdf` and `srdf_path` are None without an SRDF."""

    urdf: UrdfSource
    srdf: Srdf | None = None
    srdf_path: Path | None = None


def read_sources(spec: RobotSpec, document: Document) -> DescriptionFiles:
    """Read the URDF, or make it from the Denavit–Hartenberg table, and the SRDF.

    Raises:
        InputError: files that cannot be used, a robot that the data package does not have, or no data package.
    """
    folder = document.path.parent
    if spec.dh is not None:
        from optiplan.robot.dh.to_urdf import urdf_text

        urdf = read_urdf(document.path, folder, urdf_text(spec.name, spec.dh, document))
    else:
        with _named_by("urdf", spec.urdf, document):
            urdf = read_urdf(_urdf_path(spec, document), folder)
    if spec.srdf is None:
        return DescriptionFiles(urdf)
    path = folder / spec.srdf
    with _named_by("srdf", spec.srdf, document):
        return DescriptionFiles(urdf, read_srdf(path, urdf.renamed), path)


@contextmanager
def _named_by(key: str, value: object, document: Document) -> Iterator[None]:
    """Report a missing file at the key that names it."""
    try:
        yield
    except InputError as error:
        if not isinstance(error.__cause__, FileNotFoundError):
            raise
        (issue,) = error.issues
        found = f"{value!r}, but there is no file {issue.file}"
        raise InputError([document.issue((key,), found, issue.expected)]) from None


def _urdf_path(spec: RobotSpec, document: Document) -> Path:
    if isinstance(spec.urdf, str):
        return document.path.parent / spec.urdf
    assert spec.urdf is not None  # the schema holds urdf or dh
    robots = package_robots()
    if not robots:
        expected = "it to be installed: pip install example-robot-data"
        raise InputError([document.issue(("urdf", "package"), "example-robot-data, which is not installed", expected)])
    if spec.urdf.robot not in robots:
        found = f"unknown robot '{spec.urdf.robot}'"
        raise InputError([document.issue(("urdf", "robot"), found, choices(spec.urdf.robot, sorted(robots)))])
    return robots[spec.urdf.robot]


def package_robots() -> dict[str, Path]:
    """Return the URDFs of the installed example-robot-data by file name, with and without a trailing `_robot`."""
    roots = (Path(entry) / folder for entry in sys.path for folder in PACKAGE_FOLDERS)
    root = next((root for root in roots if root.is_dir()), None)
    if root is None:
        return {}
    files = sorted((*root.glob("*/urdf/*.urdf"), *root.glob("*/robots/*.urdf")))
    named = {path.stem: path for path in files}
    return {**{name.removesuffix("_robot"): path for name, path in named.items()}, **named}
