"""The words in which an option's value that does not fit is told to a person."""

import re
from collections.abc import Iterable

from optiplan.errors import Issue

_KINDS = {"float": "a number", "int": "a whole number", "bool": "true or false", "str": "text"}
_RANGES = {
    "not positive and finite": "a finite number > 0",
    "not positive": "a number > 0",
    "negative": "a number ≥ 0",
    "not within ": "a number from ",
    "not in ": "a number in ",
    "not ": "",
}
"""What an options dataclass says is wrong, by its first words, and what is expected instead."""


def in_words(kind: str) -> str:
    """What a value of that kind is: `list of float` is "a list of numbers", `a | b` is "one of: a, b"."""
    if " | " in kind:
        return f"one of: {kind.replace(' | ', ', ')}"
    inner = kind.removeprefix("list of ")
    if inner == kind:
        return _KINDS.get(kind, kind)
    words = in_words(inner)
    return f"a list of {words.removeprefix('a ')}s" if inner in ("float", "int") else f"a list, each {words}"


def out_of_range(planner: str, options: Iterable[str], text: str) -> Issue:
    """What a dataclass of options says of its values: `reach = -1 is not positive`, or words that name an option."""
    file = f"planner '{planner}'"
    said = re.fullmatch(r"(\w+) = (.+) is (not .+|negative)", text, re.DOTALL)
    if said is not None and said[1] in options:
        expected = next(
            (words + said[3].removeprefix(key) for key, words in _RANGES.items() if said[3].startswith(key)), said[3]
        )
        return Issue(file, None, said[1], said[2], expected)
    named = next((key for key in options if key in re.findall(r"\w+", text)), "options")
    return Issue(file, None, named, text, "options as `optiplan planners` describes them")
