"""Joint values by name in the data of a problem: `{joint: value}` stands wherever a list of them may stand."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

from optiplan.config.document import Document
from optiplan.config.simple_yaml import Place
from optiplan.errors import Issue

KEYS = ("joints", "joints_deg", "velocity", "acceleration")
"""Keys of an end or a via whose value is one number a planned joint."""

Orders: TypeAlias = dict[Place, tuple[str, ...]]
"""Names of the joints of each value, by the place of the values in the data."""


def joint_orders(data: Any) -> Orders:
    """Return the names of all joint values that are given by name, in the order in which they are written."""
    return {
        (*place, key): tuple(end[key])
        for place, end in ends_of(data, ("move", "approach", "gripper"))
        for key in KEYS
        if isinstance(end.get(key), Mapping)
    }


def with_lists(document: Document, orders: Orders) -> Document:
    """Return the document with lists in place of values by name, each in its order of names."""
    return replace(document, data=_listed(document.data, (), orders))


def with_names(document: Document, issues: Sequence[Issue], orders: Orders) -> list[Issue]:
    """Return issues about a document of `with_lists` as issues about `document`: with names in place of indices."""
    return [_named(document, issue, orders) for issue in issues]


def lists_of(data: Any) -> Any:
    """Return the data with lists in the order as written in place of values by name, for checks of their numbers."""
    return _listed(data, (), joint_orders(data))


def ends_of(data: Any, kinds: Sequence[str]) -> Iterator[tuple[Place, Mapping[str, Any]]]:
    """Return every mapping of a problem that says an end or a via, with its place; of a task those of such steps."""
    if not isinstance(data, Mapping):
        return
    ends = [(("start",), data.get("start")), *_goal(("goal",), data.get("goal")), *_vias((), data)]
    for k, step in _items(data.get("task")):
        for kind in kinds:
            if isinstance(step, Mapping) and isinstance(step.get(kind), Mapping):
                place = ("task", k, kind)
                ends += [*_goal(place, step[kind]), *_vias(place, step[kind])]
    yield from ((place, end) for place, end in ends if isinstance(end, Mapping))


def _goal(place: Place, goal: Any) -> Iterator[tuple[Place, Any]]:
    yield place, goal
    if isinstance(goal, Mapping):
        yield from (((*place, "any_of", k), end) for k, end in _items(goal.get("any_of")))


def _vias(place: Place, data: Mapping[str, Any]) -> Iterator[tuple[Place, Any]]:
    yield from (((*place, "via", k), via) for k, via in _items(data.get("via")))


def _items(value: Any) -> Iterator[tuple[int, Any]]:
    return enumerate(value if isinstance(value, list | tuple) else ())


def _listed(value: Any, place: Place, orders: Orders) -> Any:
    if place in orders:
        return [value[name] for name in orders[place]]
    if not any(other[: len(place)] == place for other in orders):
        return value
    if isinstance(value, Mapping):
        return {key: _listed(item, (*place, key), orders) for key, item in value.items()}
    return [_listed(item, (*place, k), orders) for k, item in enumerate(value)]


def _named(document: Document, issue: Issue, orders: Orders) -> Issue:
    for size in range(1, len(issue.path)):
        names, at = orders.get(issue.path[:size]), issue.path[size]
        if names is not None and isinstance(at, int) and at < len(names):
            place = (*issue.path[:size], names[at], *issue.path[size + 1 :])
            return document.issue(place, issue.found, issue.expected)
    return issue
