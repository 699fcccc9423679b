"""YAML files read with the line of every value, and pydantic errors told with file, line, found and expected.

Used by every reader of a YAML file (robots, problems): `read_yaml` → `Document` → `validate` → a pydantic model.
Every way in which a file can be unusable ends in `InputError` holding `Issue`s, never in a foreign exception.
"""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import CollectionEndEvent, CollectionStartEvent, StreamEndEvent
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from optiplan.config.messages import describe, field_name, mistaken, one_line, words_for
from optiplan.config.simple_yaml import DEEPEST, DIGITS, LARGEST, LONGEST, Place, libyaml_parser, read_simple
from optiplan.errors import InputError, Issue
from optiplan.files import read_bytes
from optiplan.records import dataclass

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
"""A finite number: no text such as "1.0", no true or false."""

Whole = Annotated[int, Field(strict=True)]
"""A whole number: no text, no true or false."""

WHOLE_TAG = "tag:yaml.org,2002:int"

TEXT_TAGS = ("tag:yaml.org,2002:str", "tag:yaml.org,2002:merge")
"""What a key can be: text, or `<<`."""

XML = re.compile(r"\s*<[?!A-Za-z]")
"""How an XML file begins; robots come as such."""

MOST = 16 * 2**20
"""Largest file, bytes."""

HUGE = float(2**64)
"""Largest number: of what has a unit nothing is as large, and seeds have at most 64 bits."""


class Strict(BaseModel):
    """Base of every schema class: unknown keys are refused, the value cannot be changed.

    Defaults of such a class are made by `model_construct()`, which builds no validator.
    """

    written_out: ClassVar[tuple[str, ...]] = ()
    """Keys that a file may have besides, in whose place others stand by the time that it is read as this class."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)  # built by the first value


Model = TypeVar("Model", bound=BaseModel)


@dataclass(frozen=True)
class Document:
    """A YAML file as plain Python data, with the line of every value."""

    path: Path
    data: Any
    lines: Mapping[Place, int]

    def line(self, path: Sequence[str | int]) -> int | None:
        """Line (from 1) of the value at `path`, or of its nearest ancestor that stands in the file."""
        place = tuple(path)
        while place not in self.lines:
            if not place:
                return None
            place = place[:-1]
        return self.lines[place]

    def place(self, loc: Iterable[str | int]) -> Place:
        """Path in the data that a pydantic location means: names of union members in it are left out."""
        value, place = self.data, []
        for key in loc:
            listed = isinstance(value, list) and isinstance(key, int) and 0 <= key < len(value)
            if listed or (isinstance(value, dict) and key in value):
                value = value[key]
                place.append(key)
        return tuple(place)

    def issue(self, path: Sequence[str | int], found: str, expected: str) -> Issue:
        """An `Issue` about the value at `path`, with its line."""
        return Issue(str(self.path), self.line(path), field_name(path), one_line(found), expected, tuple(path))


_DEEPEST = 64
"""Lists and mappings within each other; deeper ones may hold themselves."""


def plain(value: Any, depth: int = _DEEPEST) -> Any:
    """Lists, mappings, numbers and text, as a YAML file would give them, of numpy arrays, tuples and paths.

    What is deeper than `depth` becomes the text `…`, which nothing takes.
    """
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping | list | tuple) and depth == 0:
        return "…"
    if isinstance(value, Mapping):
        return {str(key): plain(item, depth - 1) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, depth - 1) for item in value]
    return str(value) if isinstance(value, Path) else value


def read_yaml(path: Path | str) -> Document:
    """Read one YAML 1.2 document.

    Raises:
        InputError: the file is missing, unreadable, not text, empty, no valid YAML, or has a key twice.
    """
    return parse_yaml(_read_text(Path(path)), Path(path))


def parse_yaml(text: str, path: Path) -> Document:
    """Return the YAML 1.2 document in a text; `path` names it in errors.

    Raises:
        InputError: as `read_yaml`.
    """
    if "\0" in text:
        raise InputError([Issue(str(path), None, "file", "a binary file", "a YAML document")])
    if XML.match(text):
        expected = f"YAML; `optiplan robots init {path.name}` makes a robot.yaml of a URDF, xacro or MJCF"
        raise InputError([Issue(str(path), None, "file", "XML", expected)])
    try:
        data, lines = read_simple(text) or _read_any(text, path)
    except MarkedYAMLError as error:
        raise InputError([_syntax_issue(path, error)]) from error
    except (YAMLError, ValueError, RecursionError) as error:
        reason = "nested too deeply" if isinstance(error, RecursionError) else str(error).split("\n")[0]
        raise InputError([Issue(str(path), None, "file", reason, "a YAML document")]) from error
    if data is None:
        raise InputError([Issue(str(path), None, "file", "an empty file", "a YAML document of keys and values")])
    return Document(path, data, lines)


def validate(model_class: type[Model], document: Document) -> Model:
    """The document as a `model_class`.

    Raises:
        InputError: with one `Issue` for every value that does not fit, in file order; NaN, infinity and numbers beyond
            `HUGE` never fit.
    """
    unfit = [(document.issue(place, describe(value), _fitting(value)), value) for place, value in _unfit(document.data)]
    try:
        model, cause = model_class.model_validate(document.data), None
    except ValidationError as error:
        if (words := mistaken(model_class, document.data)) is not None:
            raise InputError([document.issue((), *words)]) from error
        model, cause = None, error
    errors = [] if cause is None else cause.errors(include_url=False)
    known = {item.field: item for item in pydantic_issues(model_class, document, errors)}
    for issue, value in unfit:  # a field that has a range says so itself
        if issue.field not in known or not _finite(value):
            known[issue.field] = issue
    if model is None or known:
        raise InputError(_in_file_order(list(known.values()))) from cause
    return model


def pydantic_issues(model_class: type[BaseModel], document: Document, errors: Iterable[ErrorDetails]) -> list[Issue]:
    """One `Issue` for each field of `document` in which pydantic found errors."""
    issues: dict[Place, Issue] = {}
    for item in errors:
        found, expected = words_for(model_class, item)
        place = document.place(item["loc"])
        name = (*place, item["loc"][-1]) if item["type"] == "missing" else place
        line = document.line(place)
        if name in issues:  # members of a union each say what they would have taken
            known = issues[name]
            expected = known.expected if expected in known.expected else f"{known.expected}, or {expected}"
        issues[name] = Issue(str(document.path), line, field_name(name), one_line(found), expected, name)
    deepest = [name for name in issues if not any(len(o) > len(name) and o[: len(name)] == name for o in issues)]
    return [issues[name] for name in deepest]


def _read_any(text: str, path: Path) -> tuple[Any, dict[Place, int]]:
    """Data of a document and the line of every value, whatever stands in it."""
    reader, root = _compose(text)
    lines = _lines(root, path)
    return None if root is None else reader.constructor.construct_document(root), lines


def _compose(text: str) -> tuple[YAML, Node | None]:
    """The node of a text, with the reader that makes data of it: libyaml where it is installed, ten times as quick.

    What libyaml refuses, understands otherwise (YAML 1.1), or what is nested so deeply that it would run out of stack,
    the parser in Python judges.
    """
    with suppress(YAMLError, ValueError):
        if (parser := libyaml_parser(text)) is not None and _is_shallow(parser):
            quick = YAML(typ="safe")
            return quick, quick.compose(text)
    reader = YAML(typ="safe", pure=True)
    return reader, reader.compose(text)


def _is_shallow(parser: Any) -> bool:
    """Whether no value is nested deeper than `DEEPEST`, and a bit."""
    depth = 0
    while not isinstance(event := parser.get_event(), StreamEndEvent):
        depth += isinstance(event, CollectionStartEvent) - isinstance(event, CollectionEndEvent)
        if depth > DEEPEST + 2:
            return False
    return True


def _in_file_order(issues: list[Issue]) -> list[Issue]:
    return sorted(issues, key=lambda issue: issue.line or 0)


def _read_text(path: Path) -> str:
    try:
        text = read_bytes(path, MOST).decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(
            [Issue(str(path), None, "file", "bytes that are not UTF-8 text", "a YAML document")]
        ) from error
    except (OSError, ValueError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or str(error)
        raise InputError([Issue(str(path), None, "file", reason, "a readable YAML file")]) from error
    return text


def _lines(root: Node | None, path: Path) -> dict[Place, int]:
    """Line of every value: that of its key in a mapping, its own in a list."""
    lines: dict[Place, int] = {}
    stack: list[tuple[Place, Node, int]] = [] if root is None else [((), root, root.start_mark.line)]
    while stack:
        place, node, line = stack.pop()
        lines[place] = line + 1
        if len(lines) > LARGEST or len(place) > DEEPEST:
            raise InputError([Issue(str(path), line + 1, "file", "a document that is too large", "fewer values")])
        if isinstance(node, ScalarNode):
            most = DIGITS if node.tag == WHOLE_TAG else LONGEST
            if len(node.value) > most:
                found, expected = f"a value of {len(node.value)} characters", f"at most {most}"
                raise InputError([Issue(str(path), line + 1, field_name(place), found, expected)])
        if isinstance(node, MappingNode):
            seen: dict[str, int] = {}
            for key, value in node.value:
                name, at = _key(key, path), key.start_mark.line + 1
                if name in seen:
                    found = one_line(f"a duplicate key: '{name[:60]}' is on line {seen[name]} too")
                    raise InputError([Issue(str(path), at, field_name((*place, name)), found, "each key once")])
                seen[name] = at
                stack.append(((*place, name), value, at - 1))
        elif isinstance(node, SequenceNode):
            stack.extend(((*place, i), value, value.start_mark.line) for i, value in enumerate(node.value))
    return lines


def _key(node: Node, path: Path) -> str:
    """The text of a key.

    Raises:
        InputError: a key that is a number, a list, nothing or the like, which no file of ours has.
    """
    if isinstance(node, ScalarNode) and node.tag in TEXT_TAGS:
        return str(node.value)
    found = f"the key {describe(node.value)}, which is no text" if isinstance(node, ScalarNode) else "a key of keys"
    raise InputError([Issue(str(path), node.start_mark.line + 1, "file", found, "keys that are text")])


def _syntax_issue(path: Path, error: MarkedYAMLError) -> Issue:
    mark = error.problem_mark or error.context_mark
    line = None if mark is None else mark.line + 1
    problem = " ".join(str(error.problem or error.context or "a syntax error").split())
    return Issue(str(path), line, "file", problem, "valid YAML")


def _fitting(value: float) -> str:
    return f"a number in [-{HUGE:.3g}, {HUGE:.3g}]" if _finite(value) else "a finite number"


def _finite(value: float) -> bool:
    return isinstance(value, int) or math.isfinite(value)


def _unfit(data: Any, place: Place = ()) -> list[tuple[Place, float]]:
    """Numbers that no field takes, with their places."""
    if isinstance(data, float | int) and not abs(data) <= HUGE:  # written so that NaN is found too
        return [(place, data)]
    children: Iterable[tuple[Any, Any]] = ()
    if isinstance(data, dict):
        children = data.items()
    elif isinstance(data, list):
        children = enumerate(data)
    return [hit for key, value in children for hit in _unfit(value, (*place, key))]
