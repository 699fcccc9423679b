"""Robots side by side in a problem file: `robots: {…}` is read as `robot: {robots: {…}}`, with lines of the file."""

from collections.abc import Iterable
from dataclasses import replace

from optiplan.config.document import Document
from optiplan.errors import Issue
from optiplan.robot.side_by_side import KEY

OWN = ("robot", KEY)
"""Where the arms stand when they are read."""


def with_one_robot(document: Document) -> tuple[Document, list[Issue]]:
    """Return a problem file with the key `robot` in place of `robots`; and what is wrong if it has both."""
    data = document.data
    if not isinstance(data, dict) or KEY not in data:
        return document, []
    wrong = [document.issue((KEY,), "`robots` beside `robot`", "one of them")] if "robot" in data else []
    rest = {key: value for key, value in data.items() if key != KEY}
    lines = {("robot", *place) if place[:1] == (KEY,) else place: line for place, line in document.lines.items()}
    return replace(document, data={**rest, "robot": {KEY: data[KEY]}}, lines=lines), wrong


def in_words_of(document: Document, issues: Iterable[Issue]) -> list[Issue]:
    """Return issues about a document of `with_one_robot` as issues about `document`, which has `robots`."""
    return [
        document.issue(issue.path[1:], issue.found, issue.expected) if issue.path[:2] == OWN else issue
        for issue in issues
    ]
