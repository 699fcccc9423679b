"""Where a robot's URDF and SRDF lie: beside its robot.yaml, or in the data package example-robot-data."""

import sys
from pathlib import Path

from optiplan.errors import InputError
from optiplan.model.robot_spec import RobotSpec
from optiplan.yaml_lines import Document
from optiplan.yaml_words import choices

PACKAGE_FOLDERS = ("cmeel.prefix/share/example-robot-data/robots", "share/example-robot-data/robots")


def find_sources(spec: RobotSpec, document: Document) -> tuple[Path, Path | None]:
    """Paths of the URDF and of the SRDF, if there is one.

    Raises:
        InputError: a robot that the data package does not have, or no data package.
    """
    folder = document.path.parent
    srdf = None if spec.srdf is None else folder / spec.srdf
    if isinstance(spec.urdf, str):
        return folder / spec.urdf, srdf
    robots = package_robots()
    if not robots:
        expected = "it to be installed: pip install example-robot-data"
        raise InputError([document.issue(("urdf", "package"), "example-robot-data, which is not installed", expected)])
    if spec.urdf.robot not in robots:
        found = f"unknown robot '{spec.urdf.robot}'"
        raise InputError([document.issue(("urdf", "robot"), found, choices(spec.urdf.robot, sorted(robots)))])
    return robots[spec.urdf.robot], srdf


def package_robots() -> dict[str, Path]:
    """URDFs of the installed example-robot-data by name: the file's, with and without a trailing `_robot`."""
    roots = (Path(entry) / folder for entry in sys.path for folder in PACKAGE_FOLDERS)
    root = next((root for root in roots if root.is_dir()), None)
    if root is None:
        return {}
    files = sorted((*root.glob("*/urdf/*.urdf"), *root.glob("*/robots/*.urdf")))
    named = {path.stem: path for path in files}
    return {**{name.removesuffix("_robot"): path for name, path in named.items()}, **named}
