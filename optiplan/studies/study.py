"""Read a design study, and make robots of its parameters."""

import copy
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from optiplan.arrays import Array, is_finite
from optiplan.config.document import Document, plain, read_yaml, validate
from optiplan.config.expressions import FUNCTIONS, NO_ARITHMETIC, arithmetic
from optiplan.config.messages import choices, describe
from optiplan.errors import InputError, Issue, UnknownChoiceError
from optiplan.geometry.support_polygon import SupportPolygon
from optiplan.problem.examples import find_problem
from optiplan.records import dataclass
from optiplan.robot.reference import robot_file
from optiplan.robot.robot import Robot, load_robot
from optiplan.studies.schema import Amount, Change, StudySpec

STUDY = "<study>"
"""Stands for the file of a study that has none."""

Values = Mapping[str, float]
"""A value for each parameter, by name."""


@dataclass(frozen=True, eq=False)
class TaskSource:
    """A task of a study: the content of a problem file, and the folder that its paths are relative to."""

    name: str
    data: Mapping[str, Any]
    base: Path

    def for_robot(self, robot: Robot) -> dict[str, Any]:
        """The content with this robot in place of its own."""
        return {**self.data, "robot": robot.reference.robot}


@dataclass(frozen=True, eq=False)
class DesignStudy:
    """A design study whose robots load.

    Attributes:
        names: of the parameters.
        lower, upper, given: (p,) of the parameters.
        description: content of the robot file before it is changed.
        folder: where its paths start.
    """

    spec: StudySpec
    document: Document
    names: tuple[str, ...]
    lower: Array
    upper: Array
    given: Array
    description: Mapping[str, Any]
    folder: Path
    tasks: tuple[TaskSource, ...]

    def values(self, x: Array) -> dict[str, float]:
        """The parameters (p,) by name."""
        return dict(zip(self.names, map(float, x), strict=True))

    def robot_data(self, values: Values) -> dict[str, Any]:
        """The content of the robot file for these parameters.

        Raises:
            InputError: an expression that has no value there, such as a division by 0.
        """
        data = copy.deepcopy(dict(self.description))
        issues: list[Issue] = []
        for path, change in self.spec.changes.items():
            holder, key = place_in(data, path)
            amounts = [_amount(amount, values, self.document, ("changes", path), issues) for amount in _listed(change)]
            holder[key] = amounts if isinstance(change, list) else amounts[0]
        if issues:
            raise InputError(issues)
        return data

    def robot(self, values: Values, whole: bool = False) -> Robot:
        """Return the robot for these parameters, at the origin; without `whole` it has no bodies, and loads at once.

        Raises:
            InputError: the parameters do not make a robot.
        """
        data = self.robot_data(values)
        return load_robot(data if whole else {**data, "collision": "none", "allowed_collisions": []}, self.folder)

    def support(self, values: Values) -> SupportPolygon | None:
        """The polygon on which the robot stands for these parameters; None: the study has none.

        Raises:
            InputError: corners on one line.
        """
        spec = self.spec.support
        if spec is None:
            return None
        issues: list[Issue] = []

        def number(amount: Amount, *place: str | int) -> float:
            return _amount(amount, values, self.document, ("support", *place), issues)

        height = number(spec.height, "height")
        corners = [[number(x, "corners", k, i) for i, x in enumerate(pair)] for k, pair in enumerate(spec.corners)]
        if issues:
            raise InputError(issues)
        try:
            return SupportPolygon.of(corners, height)
        except ValueError as error:
            found, _, expected = str(error).removeprefix("found ").partition("; expected ")
            raise InputError([self.document.issue(("support", "corners"), found, expected)]) from None


def read_study(source: Path | str | Mapping[str, Any], measures: Mapping[str, Any]) -> DesignStudy:
    """Read a study file, or its content.

    Args:
        source: path, or the keys of a file with paths relative to the working directory.
        measures: what `maximise`, `minimise` and `require` may name besides parameters.

    Raises:
        InputError: with every issue found, with file and line.
    """
    document = Document(Path(STUDY), plain(source), {}) if isinstance(source, Mapping) else read_yaml(source)
    spec = validate(StudySpec, document)
    folder = document.path.resolve().parent
    description, robot_folder = _description(spec, document, folder)
    names = tuple(spec.parameters)
    ranges = np.array([parameter.range for parameter in spec.parameters.values()])
    given = [p.range[0] / 2 + p.range[1] / 2 if p.given is None else p.given for p in spec.parameters.values()]
    issues = [*_wrong_places(spec, document, description), *_wrong_wishes(spec, document, measures)]
    tasks = _tasks(spec, document, folder, issues)
    if issues:
        raise InputError(issues)
    study = DesignStudy(
        spec, document, names, ranges[:, 0], ranges[:, 1], np.array(given), description, robot_folder, tuple(tasks)
    )
    for what, x in (("as given", study.given), ("at the lower ends", study.lower), ("at the upper ends", study.upper)):
        _check_robot(study, what, study.values(x))
    return study


def _check_robot(study: DesignStudy, what: str, values: Values) -> None:
    """Refuse a study whose parameters make no robot, or no support, at this point of their ranges."""
    study.support(values)
    try:
        study.robot(values)
    except InputError as error:
        if any(issue.file == str(study.document.path) for issue in error.issues):
            raise
        found = "; ".join(f"{issue.field}: {issue.found}; expected {issue.expected}" for issue in error.issues[:3])
        words = f"with the parameters {what}: {found}"
        raise InputError([study.document.issue(("changes",), words, "a robot at every end of the ranges")]) from None


def _description(spec: StudySpec, document: Document, folder: Path) -> tuple[dict[str, Any], Path]:
    """The content of the robot file, and its folder."""
    if isinstance(spec.robot, dict):
        data, base = spec.robot, folder
    else:
        try:
            file = robot_file(spec.robot, folder).resolve()
        except UnknownChoiceError as error:
            found, expected = f"unknown robot '{spec.robot}'", choices(spec.robot, error.choices)
            raise InputError([document.issue(("robot",), found, expected)]) from None
        data, base = read_yaml(file).data, file.parent
    if not isinstance(data, Mapping) or not isinstance(data.get("dh"), Mapping):
        found = f"{describe(spec.robot)}, which is not given by a Denavit–Hartenberg table"
        raise InputError([document.issue(("robot",), found, "a robot with `dh:`, such as srra, delbot or puma560")])
    return dict(data), base


def place_in(data: Any, path: str) -> tuple[Any, Any]:
    """Return what holds the place `path`, keys and numbers joined by dots, and its key there.

    Members of a list go by number from 0, or by their `name`. The last key of a mapping need not exist.

    Raises:
        KeyError: the first part that is not there, and what is.
    """
    *way, last = path.split(".")
    for key in way:
        data = data[_key(data, key, must_exist=True)]
    return data, _key(data, last, must_exist=False)


def _key(data: Any, key: str, must_exist: bool) -> Any:
    if isinstance(data, Mapping):
        if must_exist and key not in data:
            raise KeyError(key, [str(known) for known in data])
        return key
    if isinstance(data, list):
        named = [entry.get("name") if isinstance(entry, Mapping) else None for entry in data]
        if key in named:
            return named.index(key)
        if key.isdigit() and int(key) < len(data):
            return int(key)
        raise KeyError(key, [*(str(name) for name in named if name), f"a number from 0 to {len(data) - 1}"])
    raise KeyError(key, [])


def _wrong_places(spec: StudySpec, document: Document, description: Mapping[str, Any]) -> list[Issue]:
    issues = []
    changed = copy.deepcopy(dict(description))
    for path, change in spec.changes.items():
        try:
            holder, last = place_in(changed, path)
            holder[last] = copy.copy(change)
        except KeyError as error:
            key, known = error.args
            found = f"a place that the robot file does not have, or that another change replaces: no '{key}' there"
            issues.append(document.issue(("changes", path), found, choices(key, known)))
    used = " ".join(str(amount) for amount in _amounts(spec))
    for name in spec.parameters:
        if name in ("pi", *FUNCTIONS):
            issues.append(document.issue(("parameters", name), f"'{name}', which expressions know", "another name"))
        elif not _mentions(used, name):
            expected = f'an expression with it in `changes` or `support`, such as "={name}"'
            issues.append(document.issue(("parameters", name), "a parameter that changes nothing", expected))
    return issues


def _listed(change: Change) -> list[Amount]:
    return change if isinstance(change, list) else [change]


def _amounts(spec: StudySpec) -> list[Amount]:
    support = spec.support
    changes = [amount for change in spec.changes.values() for amount in _listed(change)]
    return changes if support is None else [*changes, support.height, *chain.from_iterable(support.corners)]


def _mentions(text: str, name: str) -> bool:
    return name in "".join(c if c.isalnum() or c == "_" else " " for c in text).split()


def _wrong_wishes(spec: StudySpec, document: Document, measures: Mapping[str, Any]) -> list[Issue]:
    """Issues of `maximise`, `minimise`, `require`."""
    issues = []
    seen: list[str] = []
    for key, wishes in (("maximise", spec.maximise), ("minimise", spec.minimise)):
        for k, name in enumerate(wishes):
            if name not in measures and name not in spec.parameters:
                found = f"unknown measure '{name}'"
                issues.append(document.issue((key, k), found, choices(name, [*measures, *spec.parameters])))
            elif name in seen:
                issues.append(document.issue((key, k), f"{name} a second time", "each measure once"))
            seen.append(name)
    for name in spec.require:
        if name not in measures:
            issues.append(document.issue(("require", name), f"unknown measure '{name}'", choices(name, list(measures))))
    if not seen:
        issues.append(document.issue((), "neither maximise nor minimise", "at least one measure in one of them"))
    wanted = [*seen, *spec.require]
    for name, key, present in (("tip_over", "support", spec.support is not None), ("cycle_time", "tasks", spec.tasks)):
        if name in wanted and not present:
            issues.append(document.issue((), f"{name} without {key}", f"the key `{key}`"))
    return issues


def _tasks(spec: StudySpec, document: Document, folder: Path, issues: list[Issue]) -> list[TaskSource]:
    tasks = []
    for k, task in enumerate(spec.tasks):
        if isinstance(task, dict):
            if "robot" in task:
                words = "a robot in a task", "no robot: the design takes its place"
                issues.append(document.issue(("tasks", k, "robot"), *words))
                continue
            data, base = {"version": 1, "name": f"task {k + 1}", **task}, folder
        else:
            try:
                file = find_problem(str(folder / task) if (folder / task).is_file() else task)
                read = read_yaml(file).data
            except InputError as error:
                issues += [document.issue(("tasks", k), issue.found, issue.expected) for issue in error.issues]
                continue
            if not isinstance(read, Mapping):
                issues.append(document.issue(("tasks", k), describe(read), "a problem file"))
                continue
            data, base = dict(read), file.resolve().parent
        tasks.append(TaskSource(str(data.get("name", f"task {k + 1}")), data, base))
    return tasks


def _amount(
    amount: Amount, values: Values, document: Document, place: Sequence[str | int], issues: list[Issue]
) -> float:
    """The number of a place of the study; NaN and an issue where the expression has none."""
    if not isinstance(amount, str):
        return float(amount)
    try:
        found = arithmetic(amount[1:], values)
        if is_finite(found):
            return float(found)
    except KeyError as error:
        name = str(error.args[0])
        expected = choices(name, [*values, "pi", *FUNCTIONS])
        issues.append(document.issue(place, f"an unknown name in '{amount}'", expected))
        return float("nan")
    except NO_ARITHMETIC:
        pass
    issues.append(document.issue(place, f"'{amount}'", "an expression with a finite value, such as '=0.5 * length'"))
    return float("nan")
