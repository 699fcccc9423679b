"""Files of xacro macros as XML, by the package `xacro`, without ROS."""

import threading
from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from optiplan.config.messages import choices
from optiplan.errors import InputError, Issue, OptiPlanError
from optiplan.robot.urdf.ros_packages import RosPackages

_LOCK = threading.Lock()
"""The package keeps the files and arguments of one run in its module."""


class Arguments(dict[str, str]):
    """Arguments of a xacro file, which remember the names that it asked for."""

    def __init__(self, given: Mapping[str, str]) -> None:
        super().__init__(given)
        self._given, self._asked = tuple(given), set[str]()

    def __contains__(self, name: object) -> bool:
        """Return whether there is a value of that name."""
        self._asked.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        """Return the value of that name."""
        self._asked.add(name)
        return super().__getitem__(name)

    def refuse_unknown(self, path: Path) -> None:
        """Raise an InputError for what was given and not asked for."""
        asked = sorted(self._asked)
        wrong = [(f"unknown argument '{name}'", choices(name, asked)) for name in self._given if name not in asked]
        if wrong:
            raise InputError([Issue(str(path), None, "xacro", *words) for words in wrong])


def expand_xacro(path: Path, packages: RosPackages, arguments: dict[str, str]) -> str:
    """Return the XML that xacro makes of a file; `$(find NAME)` is looked for in `packages`.

    Args:
        path: of the file.
        packages: of ROS.
        arguments: values by name; the defaults of the file are added.

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
            return str(xacro.process_file(str(path), mappings=arguments).toxml())
        except Exception as error:  # xacro evaluates expressions: anything can come out of one
            file, line = (xacro.filestack or [path])[-1], getattr(error, "lineno", None)
            found, expected = _told(error), "a file that xacro expands"
            if isinstance(getattr(error, "exc", None), resolver.ArgException):
                found, expected = f"no value of the argument '{found}'", "one (--arg NAME=VALUE)"
            raise InputError([Issue(str(file), line, "xacro", found, expected)]) from error
        finally:
            resolver._eval_find = before


def _told(error: BaseException) -> str:
    """What an error of xacro says, once: each repeats the words of the one that it wraps, and adds a suffix."""
    inner: BaseException | None = getattr(error, "exc", None)
    told = (str(error) or type(error).__name__) if inner is None else _told(inner)
    return " ".join(f"{told} {getattr(error, 'suffix', None) or ''}".split())
