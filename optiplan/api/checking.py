"""`check`: everything that is wrong with a problem file; the planner that it names, with lines of the file."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from optiplan.config.document import Document, read_yaml
from optiplan.config.messages import choices
from optiplan.errors import InputError, Issue, UnknownChoiceError, described, wrong_argument
from optiplan.planners.base import Budget
from optiplan.planners.registry import make_planner
from optiplan.problem.examples import find_problem
from optiplan.problem.load import check_file, load_problem
from optiplan.problem.problem import Problem
from optiplan.runs.pipeline import chosen

_LOOK = 2.0  # s, for goal configurations


def check(file: Path | str) -> list[Issue]:
    """Find everything that is wrong with a problem file.

    Checked are keys, units and sizes, that robots and meshes exist, limits, that the start touches nothing, and that
    the planner's options go with start and goal. A part that is wrong hides no other.

    Args:
        file: a problem file, or the name of an example.

    Returns:
        The issues, in the order of the file, each with `file`, `line`, `field`, `found` and `expected`; its text is one
        line. None: the problem can be planned.

    Raises:
        InputError: the argument is no path. What is wrong with the file, that it is not there included, is returned.

    Example:
        >>> import optiplan as op
        >>> op.check("01_reach")
        []
    """
    if not isinstance(file, str | Path):
        expected = "the path of a problem file, or the name of an example"
        raise wrong_argument("check", "file", described(file), expected)
    try:
        path = find_problem(str(file))
    except InputError as error:
        return list(error.issues)
    found = check_file(path)
    told = {issue.path for issue in found}
    found += [issue for issue in planner_issues(path) if issue.path not in told]
    found = found or fitting_issues(path)
    return sorted(found, key=lambda issue: issue.line or 0)


def planner_issues(path: Path) -> list[Issue]:
    """Return the issues with the planner and options named in the file, except those its schema reports."""
    try:
        document = read_yaml(path)
    except InputError:
        return []
    name, options = _stated(document.data)
    try:
        if name is not None:
            make_planner(name, options)
    except UnknownChoiceError as error:
        if error.kind == "planner":
            return [
                document.issue(("planner",), f"unknown planner '{error.found}'", choices(error.found, error.choices))
            ]
        known = ["name", *(choice.partition(" (")[0] for choice in error.choices)]
        found = f"unknown option '{error.found}' of planner '{name}'"
        return [document.issue(("planner", error.found), found, choices(error.found, known))]
    except InputError as error:
        return _placed(document, error)
    return []


def fitting_issues(path: Path) -> list[Issue]:
    """Return the issues of valid options with the start and goal of the file, as far as planners check ahead."""
    problem = load_problem(path)
    planner = make_planner(problem.planner, problem.options)
    try:
        planner.check(problem, Budget(_LOOK))
    except InputError as error:
        return list(placed(path, error).issues)
    return []


def choose(path: Path, problem: Problem, planner: str | None) -> tuple[str, Mapping[str, Any]]:
    """Return the planner's name and options: those given, else the file's.

    Raises:
        InputError: the file's planner is used, and its name or options are invalid.
    """
    if planner in (None, problem.planner):
        issues = planner_issues(path)
        if issues:
            raise InputError(issues)
    return chosen(problem, planner)


def placed(path: Path, error: InputError) -> InputError:
    """Return the same error with issues of planner options at their lines of the file."""
    return InputError(_placed(read_yaml(path), error))


def _placed(document: Document, error: InputError) -> list[Issue]:
    return [
        document.issue(("planner", issue.field), issue.found, issue.expected) if issue.planner is not None else issue
        for issue in error.issues
    ]


def _stated(data: Any) -> tuple[str | None, dict[str, Any]]:
    """Return name and options as in the file; None for a missing name or one that is not text."""
    stated = data.get("planner") if isinstance(data, dict) else None
    if isinstance(stated, dict):
        name = stated.get("name", "trajopt")
        return name if isinstance(name, str) and name else None, {key: stated[key] for key in stated if key != "name"}
    return stated if isinstance(stated, str) and stated else None, {}
