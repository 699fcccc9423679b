"""Simple YAML documents, read straight from libyaml's events: data and lines in one pass.

Simple is a document of mappings, lists, plain decimal numbers, text, true, false and null, without anchors, tags and
merged keys, in which nothing is wrong. Of anything else `read_simple` says nothing: `document` composes it, and judges.
"""

import re
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from ruamel.yaml.error import YAMLError
from ruamel.yaml.events import (
    DocumentEndEvent,
    DocumentStartEvent,
    MappingEndEvent,
    MappingStartEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
    StreamEndEvent,
)
from ruamel.yaml.resolver import VersionedResolver

try:
    from _ruamel_yaml import CParser  # type: ignore[import-not-found,unused-ignore]  # libyaml, of ruamel.yaml.clib
except ImportError:  # a platform that it has no wheel for
    CParser = None

Place = tuple[str | int, ...]
"""Where a value stands in a document: keys and list indices from the root."""

LARGEST = 1_000_000
"""Values allowed in one document, aliases expanded: stops a file that grows without end through its aliases."""

DEEPEST = 100
"""Values within values."""

LONGEST = 4096
"""Characters of one text or number: as many as a path can have."""

DIGITS = 40
"""Characters of one whole number."""

_ODD = re.compile(r"[^\n\x20-\x7e\xa0-\u2027\u202a-\ud7ff]|^%|\\", re.MULTILINE)
"""What libyaml takes for a blank, a line break or an escape where YAML 1.2 does not, or the other way round."""

_REAL = re.compile(r"[-+]?[0-9]+\.[0-9]*(?:[eE][-+]?[0-9]+)?")
_WHOLE = re.compile(rf"[-+]?(?:0|[1-9][0-9]{{0,{DIGITS - 2}}})")
_CONSTANTS = {
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys(("null", "Null", "NULL", "~", ""), None),
}
_PATTERNS = VersionedResolver().versioned_resolver
"""By their first character, what scalars that mean no text look like in YAML 1.2: tags with patterns."""


class _NotSimple(Exception):
    """Something that `read_simple` leaves to others."""


def libyaml_parser(text: str) -> Any | None:
    """Libyaml's parser of a text that it, which knows YAML 1.1, reads as YAML 1.2 means it; else, or without it, none.

    What characters tell is looked at, not what words and numbers mean.
    """
    return None if CParser is None or _ODD.search(text) else CParser(text)


def read_simple(text: str) -> tuple[Any, dict[Place, int]] | None:
    """Data of a simple document and the line (from 1) of every value, or nothing: the document is not simple."""
    if (parser := libyaml_parser(text)) is None:
        return None
    next_event: Callable[[], Any] = parser.get_event
    with suppress(YAMLError, ValueError, _NotSimple):
        next_event()  # the stream begins
        if isinstance(next_event(), DocumentStartEvent):
            lines: dict[Place, int] = {}
            first = next_event()
            data = _value(first, (), first.start_mark.line + 1, lines, next_event)
            if isinstance(next_event(), DocumentEndEvent) and isinstance(next_event(), StreamEndEvent):
                return data, lines
    return None


def _value(event: Any, place: Place, line: int, lines: dict[Place, int], next_event: Callable[[], Any]) -> Any:
    """What an event begins, read to its end; `lines` gets the line of all that is in it."""
    lines[place] = line
    if len(lines) > LARGEST or len(place) > DEEPEST or event.anchor is not None:
        raise _NotSimple
    kind = type(event)
    if kind is ScalarEvent:
        return _scalar(event)
    if event.tag is not None:
        raise _NotSimple
    if kind is SequenceStartEvent:
        items: list[Any] = []
        while type(event := next_event()) is not SequenceEndEvent:
            items.append(_value(event, (*place, len(items)), event.start_mark.line + 1, lines, next_event))
        return items
    if kind is not MappingStartEvent:
        raise _NotSimple
    values: dict[str, Any] = {}
    while type(event := next_event()) is not MappingEndEvent:
        key = _scalar(event) if type(event) is ScalarEvent and event.anchor is None else None
        if not isinstance(key, str) or key in values:
            raise _NotSimple
        values[key] = _value(next_event(), (*place, key), event.start_mark.line + 1, lines, next_event)
    return values


def _scalar(event: Any) -> Any:
    """The number, text, truth value or nothing that a scalar means in YAML 1.2."""
    text: str = event.value
    if event.tag is not None or len(text) > LONGEST:
        raise _NotSimple
    if not event.implicit[0]:  # quoted
        return text
    if _REAL.fullmatch(text):
        return float(text)
    if _WHOLE.fullmatch(text):
        return int(text)
    if text in _CONSTANTS:
        return _CONSTANTS[text]
    if any(pattern.match(text) for _, pattern in _PATTERNS.get(text[0], ())):
        raise _NotSimple
    return text
