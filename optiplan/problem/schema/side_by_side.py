"""Robots side by side in a problem file: `robots: {…}` is read as `robot: {robots: {…}}`, with lines of the file."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from optiplan.config.document import Document
from optiplan.errors import Issue
from optiplan.robot.reference import ROBOTS

OWN = ("robot", ROBOTS)
"""Where the arms stand when they are read."""


def with_one_robot(document: Document) -> tuple[Document, list[Issue]]:
    """Return a problem file with the key `robot` in place of `robots`; and what is wrong if it has both."""
    data = document.data
    if not isinstance(data, dict) or ROBOTS not in data:
        return document, []
    wrong = [document.issue((ROBOTS,), "`robots` beside `robot`", "one of them")] if "robot" in data else []
    rest = {key: value for key, value in data.items() if key != ROBOTS}
    lines = {("robot", *place) if place[:1] == (ROBOTS,) else place: line for place, line in document.lines.items()}
    return replace(document, data={**rest, "robot": {ROBOTS: data[ROBOTS]}}, lines=lines), wrong


GROUPED = ("move", "line", "approach", "retreat")
"""Steps that move the joints of their arm, unless they name a group."""


def with_groups_of_arms(document: Document) -> tuple[Document, list[Issue]]:
    """Return a problem file in which steps of an arm name its group; nothing is wrong with that."""
    steps = document.data.get("task") if isinstance(document.data, dict) else None
    if not isinstance(steps, list) or not any(isinstance(step, dict) and "arm" in step for step in steps):
        return document, []
    return replace(document, data={**document.data, "task": [_with_group(step) for step in steps]}), []


def _with_group(step: Any) -> Any:
    if not isinstance(step, dict) or not isinstance(step.get("arm"), str):
        return step
    said = {key: {"group": step["arm"], **step[key]} for key in GROUPED if isinstance(step.get(key), dict)}
    return {**step, **said}


def in_words_of(document: Document, issues: Iterable[Issue]) -> list[Issue]:
    """Return issues about a document of `with_one_robot` as issues about `document`, which has `robots`."""
    return [
        document.issue(issue.path[1:], issue.found, issue.expected) if issue.path[:2] == OWN else issue
        for issue in issues
    ]
