"""The words in which a value that does not fit its schema is told to a person."""

import difflib
import math
import types
import typing
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, get_args, get_origin

from pydantic import BaseModel
from pydantic_core import ErrorDetails

from optiplan.config.built_later import BuiltLater

EXPECTED = {
    "missing": "this key, which is required",
    "extra_forbidden": "no such key",
    "json_invalid": "JSON",
    "float_type": "a number",
    "float_parsing": "a number",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number",
    "finite_number": "a finite number",
    "string_type": "text",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "a mapping of keys to values",
    "model_type": "a mapping of keys to values",
    "model_attributes_type": "a mapping of keys to values",
    "greater_than": "a number > {gt}",
    "greater_than_equal": "a number ≥ {ge}",
    "less_than": "a number < {lt}",
    "less_than_equal": "a number ≤ {le}",
    "too_short": "at least {min_length} values",
    "too_long": "at most {max_length} values",
    "string_pattern_mismatch": "text that matches {pattern}",
    "string_too_short": "text that is not empty",
    "string_too_long": "text of at most {max_length} characters",
    "literal_error": "{expected}",
    "union_tag_invalid": "one of: {expected_tags}",
}
"""What pydantic's error types mean by "expected"; the braces are filled from the error's context."""


OWN = ("value_error", "assertion_error")
"""Error types of validators of ours, which have words of their own."""

FILES = (
    ("a problem file", {"robot", "start"}),
    ("a robot file", {"urdf"}),
    ("a robot file", {"dh"}),
    ("a suite file", {"problems", "planners"}),
)
"""Kinds of YAML files, and keys by which each is known."""


def mistaken(model_class: type[BaseModel], data: Any) -> tuple[str, str] | None:
    """Return what kind of file this is and what was expected, if its keys identify another kind than `model_class`."""
    if not isinstance(data, Mapping):
        return None
    own = [kind for kind, keys in FILES if keys <= set(model_class.model_fields)]
    found = [kind for kind, keys in FILES if keys <= set(data)]
    return (found[0], own[0]) if own and found and not set(own) & set(found) else None


def field_name(place: Iterable[str | int]) -> str:
    """`("goal", "pose", 2)` as `goal.pose[2]`; the root is `file`."""
    text = ""
    for key in place:
        text += f"[{key}]" if isinstance(key, int) else f".{key}" if text else str(key)
    return one_line(text) or "file"


def one_line(text: str) -> str:
    """Return a text with escapes for what would break the line of a message, or rule the terminal it is printed to."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def describe(value: Any) -> str:
    """A value of a YAML file, short enough for one line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if value is None:
        return "nothing"
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else "infinity" if value > 0 else "-infinity"
    if isinstance(value, Mapping):
        keys = f"key{'' if len(value) == 1 else 's'} {some(list(map(str, value)))}"
        return f"a mapping with the {keys}" if value else "an empty mapping"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)} value{'' if len(value) == 1 else 's'}"
    text = f"'{value}'" if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else text[:57] + "…"


def choices(found: str, valid: Sequence[str]) -> str:
    """`one of: a, b, c`, and the nearest of them when `found` looks like a slip of the pen."""
    if not valid:
        return "none, since there is none to choose"
    near = difflib.get_close_matches(str(found), valid, n=1)
    return f"one of: {', '.join(valid)}" + (f" (did you mean '{near[0]}'?)" if near else "")


def some(names: Sequence[str], most: int = 5) -> str:
    """Return the first names with commas between them, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def words_for(model_class: type[BaseModel], error: ErrorDetails) -> tuple[str, str]:
    """Return what was found and what was expected, for one error of pydantic on a `model_class`."""
    kind, loc = error["type"], error["loc"]
    if kind == "extra_forbidden":
        return f"unknown key '{loc[-1]}'", choices(str(loc[-1]), _keys_at(model_class, loc[:-1]))
    if kind == "missing":
        return "nothing", expected_by(error)
    if kind in OWN:
        return _own_words(error)
    keys = f": {', '.join(_keys_at(model_class, loc))}" if kind.startswith("model_") else ""
    return describe(error["input"]), expected_by(error) + keys


def expected_by(error: ErrorDetails) -> str:
    """Return what was expected, for one error of pydantic, which need not be of a schema of ours."""
    if error["type"] in OWN:
        return _own_words(error)[1]
    if error["type"] in EXPECTED:
        return EXPECTED[error["type"]].format_map({"expected": "", **error.get("ctx", {})})
    message = error["msg"].removeprefix("Input should be ")
    return message[:1].lower() + message[1:]


def _own_words(error: ErrorDetails) -> tuple[str, str]:
    """A validator of ours raises ValueError("found …; expected …") or just ValueError("what is expected")."""
    message = str(error.get("ctx", {}).get("error", error["msg"]))
    found, separator, expected = message.partition("; expected ")
    return (found.removeprefix("found "), expected) if separator else (describe(error["input"]), message)


def _keys_at(model_class: type[BaseModel], loc: Iterable[str | int]) -> list[str]:
    """Keys that are valid at a location: walks the annotations of the models, through unions and containers."""
    models = [model_class]
    for key in loc:
        named = [model for model in models if model.__name__ == key]
        inner = [found for model in models for found in _models_in(_annotation(model, key))]
        models = named or inner or models
    return [key for model in models for key in _keys_of(model)]


def _keys_of(model: type[BaseModel]) -> list[str]:
    fields = [field.alias or name for name, field in model.model_fields.items()]
    return [*fields, *getattr(model, "written_out", ())]


def _annotation(model: type[BaseModel], key: str | int) -> Any:
    for name, field in model.model_fields.items():
        if key in (name, field.alias):
            later = [mark.kind for mark in field.metadata if isinstance(mark, BuiltLater) and mark.kind is not None]
            return later[0]() if later else field.annotation
    return None


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and not isinstance(annotation, types.GenericAlias):
        return [annotation] if issubclass(annotation, BaseModel) else []
    if isinstance(annotation, typing.TypeAliasType if hasattr(typing, "TypeAliasType") else ()):
        annotation = annotation.__value__
    return [found for part in get_args(annotation) for found in _models_in(part)] if get_origin(annotation) else []
