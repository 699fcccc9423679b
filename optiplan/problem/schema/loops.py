"""Steps of a task that a file writes once: repeated over a grid, or named and done with other values.

    task:
      - for: {i: 0..3, j: [0, 2]}                         # every i with every j, the last one changes first
        steps:
          - approach: {pose: {in: tray, position: ["=0.05 * i", "=0.06 * j", 0.1]}, distance: 0.05}
          - attach: {object: "cube_{i}_{j}", link: panda_hand}
      - do: put
        with: {what: cup, height: 0.2}
    tasks:
      put: [{line: {by: [0, 0, "=-height"]}}, {detach: {object: "{what}"}}]

Of `either`, a list of lists of steps, one list is done; here each of their steps gets an `option`: its choice and its
alternative.

A text that begins with `=` is an expression of the values, of names only where there are any; in other texts `{name}`
stands for one. Here the steps are written out, each with the line that it has in the file, before anything else is
read.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

from optiplan.config.document import Document
from optiplan.config.messages import choices, describe
from optiplan.errors import Issue
from optiplan.problem.partial import mapping

MOST = 10_000
"""Steps of a task that is written out."""
_WIDEST = 10**12
"""Values of a range that are counted."""
DEEPEST = 20
"""Tasks that do each other, one within another."""
RANGE = re.compile(r"(-?\d+)\.\.(-?\d+)")
NAMED = re.compile(r"\{([A-Za-z_]\w*)\}")
NAMES = frozenset(
    {"name", "arm", "wait_for", "wait_until", "group", "hand", "frame", "configuration", "rides", "in", "from", "to"}
    | {"object", "link", "touch", "tool", "allowed_collisions", "pairs"}
    | {"do", "after", "cluster", "first", "last", "carried_by"}
)
"""Keys of names: of these a text that begins with `=` is one, too, outside of `for` and `do`, which give values."""
Place = tuple[str | int, ...]
Values = Mapping[str, Any]


class _Written(NamedTuple):
    """A step as it is written out, and where it stands in the file."""

    step: Any
    place: Place


class LoopReader:
    """The steps of a document.

    Attributes:
        issues: what is wrong with loops, named steps and expressions.
    """

    def __init__(self, document: Document) -> None:
        self._document, self.issues = document, list[Issue]()
        self._tasks = mapping(mapping(document.data).get("tasks"))
        self._count = 0
        self._choices = 0

    def steps(
        self, given: Sequence[Any], place: Place, values: Values, way: tuple[str, ...] = ()
    ) -> Iterator[_Written]:
        """The steps of a list, written out; `way` has the names that led to it."""
        for k, step in enumerate(given):
            here = (*place, k)
            if len(way) > DEEPEST:
                self.report(here, f"tasks that do tasks, {len(way)} deep", f"at most {DEEPEST}")
                return
            if self._count > MOST:
                return
            if isinstance(step, Mapping) and "for" in step:
                yield from self._repeated(step, here, values, way)
            elif isinstance(step, Mapping) and "do" in step:
                yield from self._named(step, here, values, way)
            elif isinstance(step, Mapping) and "either" in step:
                yield from self._alternatives(step, here, values, way)
            else:
                self._count += 1
                if self._count > MOST:
                    self.report(here, "more steps than that when they are written out", f"at most {MOST} steps")
                    return
                yield _Written(self._filled(step, here, values), here)

    def _alternatives(self, step: Values, place: Place, values: Values, way: tuple[str, ...]) -> Iterator[_Written]:
        self._check_keys(step, place, ("either",))
        said, inner = step["either"], (*place, "either")
        if not isinstance(said, list) or len(said) < 2 or not all(isinstance(one, list) and one for one in said):
            self.report(inner, describe(said), "two or more lists of steps, one of which is done")
            return
        choice, self._choices = self._choices, self._choices + 1
        for k, steps in enumerate(said):
            for one in self.steps(steps, (*inner, k), values, way):
                if isinstance(one.step, dict) and "option" in one.step:
                    self.report(inner, "alternatives within alternatives", "a list for each way through them")
                    return
                told = {**one.step, "option": [choice, k]} if isinstance(one.step, dict) else one.step
                yield one._replace(step=told)

    def _repeated(self, step: Values, place: Place, values: Values, way: tuple[str, ...]) -> Iterator[_Written]:
        self._check_keys(step, place, ("for", "steps"))
        loops, steps = step["for"], step.get("steps")
        if not isinstance(loops, Mapping) or not loops:
            self.report((*place, "for"), describe(loops), "values by name, such as {i: 0..3}")
            return
        if not isinstance(steps, list):
            self.report((*place, "steps"), describe(steps), "a list of steps")
            return
        ranges = [self._range(value, (*place, "for", name), values) for name, value in loops.items()]
        if (count := math.prod(map(len, ranges)) * max(1, len(steps))) > MOST:
            self.report((*place, "for"), f"{count} steps when they are written out", f"at most {MOST}")
            return
        for found in product(*ranges):
            yield from self.steps(steps, (*place, "steps"), {**values, **dict(zip(loops, found, strict=True))}, way)

    def _range(self, value: Any, place: Place, values: Values) -> Sequence[Any]:
        value = self._filled(value, place, values)
        if isinstance(value, str) and (found := RANGE.fullmatch(value)):
            low, high = map(int, found.groups())
            high = min(max(high, low - _WIDEST), low + _WIDEST)
            return range(low, high + 1) if high >= low else range(low, high - 1, -1)
        if not isinstance(value, list):
            self.report(place, describe(value), "a range such as 0..3, both ends included, or a list of values")
            return []
        return value

    def _named(self, step: Values, place: Place, values: Values, way: tuple[str, ...]) -> Iterator[_Written]:
        self._check_keys(step, place, ("do", "with"))
        name, steps = step["do"], self._tasks.get(str(step["do"]))
        if steps is None:
            self.report((*place, "do"), f"unknown task {describe(name)}", choices(str(name), list(self._tasks)))
        elif not isinstance(steps, list):
            self.report(("tasks", name), describe(steps), "a list of steps")
        elif name in way:
            self.report(
                (*place, "do"), f"a circle of tasks: {' does '.join([*way, name])}", "steps that come to an end"
            )
        else:
            said = step.get("with")
            if said is not None and not isinstance(said, Mapping):
                self.report((*place, "with"), describe(said), "values by name, such as {height: 0.2}")
            given = self._filled(mapping(said), (*place, "with"), values)
            yield from self.steps(steps, ("tasks", name), {**values, **given}, (*way, name))

    def _filled(self, data: Any, place: Place, values: Values) -> Any:
        """Return data with values in place of their names."""
        from optiplan.config.expressions import FUNCTIONS, NO_ARITHMETIC, arithmetic

        if isinstance(data, Mapping):
            return {key: self._filled(value, (*place, key), values) for key, value in data.items()}
        if isinstance(data, list):
            return [self._filled(value, (*place, k), values) for k, value in enumerate(data)]
        if not isinstance(data, str):
            return data
        if not data.startswith("=") or (not values and _is_name(place)):
            return NAMED.sub(lambda name: str(values.get(name[1], name[0])), data)
        try:
            found = arithmetic(data[1:], values)
        except KeyError as error:
            names = [*values, "pi", *FUNCTIONS]
            self.report(place, f"an unknown name in '{data}'", choices(str(error.args[0]), names))
        except NO_ARITHMETIC:
            self.report(place, f"'{data}'", "an expression such as '=0.1 + 0.05 * i'")
        else:
            return found
        return data

    def _check_keys(self, step: Values, place: Place, keys: tuple[str, ...]) -> None:
        for key in step:
            if key not in keys:
                self.report((*place, key), f"a key that does not go with `{keys[0]}`", choices(str(key), keys))

    def report(self, place: Place, found: str, expected: str) -> None:
        """Record one issue, each once."""
        issue = self._document.issue(place, found, expected)
        if issue not in self.issues:
            self.issues.append(issue)


def written_out(document: Document) -> tuple[Document, list[Issue]]:
    """Return a problem file whose task has each step by itself, without `tasks`; and what is wrong with loops."""
    root = document.data
    if not isinstance(root, Mapping) or not isinstance(root.get("task"), list):
        return document, []
    if "tasks" not in root and not any(
        (isinstance(step, Mapping) and {"for", "do", "either"} & step.keys()) or _computes(step, ("task", k))
        for k, step in enumerate(root["task"])
    ):
        return document, []
    reader = LoopReader(document)
    if not isinstance(root.get("tasks", {}), Mapping):
        reader.report(("tasks",), describe(root["tasks"]), "lists of steps by name")
    written = list(reader.steps(root["task"], ("task",), {}))
    data = {key: value for key, value in root.items() if key != "tasks"} | {"task": [one.step for one in written]}
    return replace(document, data=data, lines=_lines(document, written)), reader.issues


def _computes(data: Any, place: Place) -> bool:
    """Whether there is an expression in the data."""
    if isinstance(data, str):
        return data.startswith("=") and not _is_name(place)
    items = data.items() if isinstance(data, Mapping) else enumerate(data) if isinstance(data, list) else ()
    return any(_computes(value, (*place, key)) for key, value in items)


def _is_name(place: Place) -> bool:
    """Whether a name stands there, by itself or in a list; values of `for` and `with` are called as one likes.

    `from` and `to` are names by themselves alone: a list of theirs is a point.
    """
    last = next((key for key in reversed(place) if isinstance(key, str)), None)
    if last in ("from", "to") and place[-1] != last:
        return False
    return last in NAMES and not {"for", "with"} & set(place)


def _lines(document: Document, written: Sequence[_Written]) -> dict[Place, int]:
    """The lines of values, those of steps where these are now."""
    below: dict[Place, list[tuple[Place, int]]] = {one.place: [] for one in written}
    found = {}
    for place, line in document.lines.items():
        if place[:1] not in (("task",), ("tasks",)):
            found[place] = line
        for length in range(1, len(place) + 1):
            if place[:length] in below:
                below[place[:length]].append((place[length:], line))
    if ("task",) in document.lines:
        found["task",] = document.lines["task",]
    for k, one in enumerate(written):
        found |= {("task", k, *rest): line for rest, line in below[one.place]}
    return found
