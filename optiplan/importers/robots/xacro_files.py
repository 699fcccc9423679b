"""Files of xacro macros as XML, by the package `xacro`, without ROS."""

import threading
from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from optiplan.errors import InputError, Issue, OptiPlanError
from optiplan.robot.urdf.ros_packages import RosPackages

_LOCK = threading.Lock()
"""The package keeps the files and arguments of one run in its module."""


def expand_xacro(path: Path, packages: RosPackages, arguments: Mapping[str, str] | None = None) -> str:
    """Return the XML that xacro makes of a file; `$(find NAME)` is looked for in `packages`.

    Raises:
        OptiPlanError: the package `xacro` is not installed.
        InputError: what xacro says of the file, or a package that is not found.
    """
    if find_spec("xacro") is None:
        raise OptiPlanError(f"{path.name} is xacro, which needs the package xacro: pip install 'optiplan[xacro]'")
    xacro = import_module("xacro")
    resolver: Any = import_module("xacro.substitution_args")

    def find(name: str) -> str:
        folder = packages.find(name)
        if folder is None:
            known = ", ".join(packages.names()) or "none"
            raise resolver.SubstitutionException(f"no package '{name}' (found near the file: {known})")
        return str(folder)

    with _LOCK:
        before, resolver._eval_find = resolver._eval_find, find
        try:
            return str(xacro.process_file(str(path), mappings=dict(arguments or {})).toxml())
        except Exception as error:  # xacro evaluates expressions: anything can come out of one
            told = " ".join(str(error).split()) or type(error).__name__
            raise InputError([Issue(str(path), None, "xacro", told, "a file that xacro expands")]) from error
        finally:
            resolver._eval_find = before
