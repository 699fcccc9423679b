"""Load problem files and problem data as a `Problem`, or report every issue."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from optiplan.config.document import Document, plain, read_yaml
from optiplan.errors import InputError, Issue
from optiplan.files import reading
from optiplan.problem.builder import RobotLoader
from optiplan.problem.from_data import read_problem
from optiplan.problem.from_python import NO_FILE
from optiplan.problem.problem import Problem
from optiplan.resources import robots_dir
from optiplan.robot.robot import load_robot


def load_problem(path: Path | str, folders: Iterable[Path | str] | None = None, **overrides: Any) -> Problem:
    """Read a problem file.

    Args:
        path: the YAML file; meshes and robot files are looked for beside it.
        folders: the only ones from which any file is read, that of the problem, robots and meshes included, besides
            the robots shipped with OptiPlan; None allows all. Symbolic links are resolved first.
        overrides: values that replace the file's at the top level, such as `seed=3` or `planner="quintic"`.

    Raises:
        InputError: the file cannot be used; holds every issue found, in file order.
    """
    with reading(_with_robots(folders)):
        document = read_yaml(path)
        if overrides and isinstance(document.data, dict):
            document = replace(document, data=document.data | overrides)
        return Problem.of(read_problem(document, Path(path).resolve().parent))


def problem_from_dict(
    data: Mapping[str, Any],
    base: Path | str = ".",
    robots: RobotLoader = load_robot,
    folders: Iterable[Path | str] | None = None,
) -> Problem:
    """Build a problem from the content of a problem file; numpy arrays and paths may stand for lists and text.

    Also the inverse of `Problem.source`.

    Args:
        data: as in a file.
        base: folder that meshes and robot files are relative to.
        robots: loads a robot; for callers that cache them.
        folders: as of `load_problem`.

    Raises:
        InputError: as `load_problem`, without lines.
    """
    with reading(_with_robots(folders)):
        document = Document(Path(NO_FILE), plain(data), {})
        return Problem.of(read_problem(document, Path(base).resolve(), robots))


def check_file(path: Path | str, folders: Iterable[Path | str] | None = None) -> list[Issue]:
    """Return every issue of a problem file, in file order; an invalid part hides no other."""
    with reading(_with_robots(folders)):
        try:
            read_problem(read_yaml(path), Path(path).resolve().parent)
        except InputError as error:
            return list(error.issues)
    return []


def _with_robots(folders: Iterable[Path | str] | None) -> list[Path | str] | None:
    return None if folders is None else [*folders, robots_dir()]
