"""Schema of planner options: dataclass fields with descriptions and ranges."""

from collections.abc import Mapping
from dataclasses import MISSING, Field, field, fields
from math import inf
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from pydantic import ConfigDict, PydanticUserError, ValidationError, create_model
from pydantic_core import SchemaError

from optiplan.arrays import is_finite
from optiplan.config.messages import describe
from optiplan.errors import InputError, Issue, OptiPlanError, UnknownChoiceError
from optiplan.records import dataclass

Value = TypeVar("Value")

_KEY = "optiplan"
_TYPES = ConfigDict(strict=True, arbitrary_types_allowed=True)  # of a third-party class: an array, say
_KINDS = {"float": "a number", "int": "a whole number", "bool": "true or false", "str": "text", "list": "a list"}


class OptionError(OptiPlanError, ValueError):
    """Invalid value of an option, by itself or together with the others.

    Attributes:
        option: name of the option.
        found: the value found.
        expected: the values allowed.
    """

    def __init__(self, option: str, found: str, expected: str) -> None:
        self.option, self.found, self.expected = option, found, expected
        super().__init__(f"{option} = {found}; expected {expected}")


@dataclass(frozen=True)
class Meaning:
    """Metadata of an option: description and range.

    Attributes:
        text: description with the unit.
        least: the smallest value allowed.
        most: the largest value allowed; infinity itself never is.
        above: exclusive lower bound.
        size: length of a list; None: any length.
    """

    text: str = ""
    least: float = -inf
    most: float = inf
    above: float = -inf
    size: int | None = None

    def holds(self, value: Any) -> bool:
        """Return whether a value is within the range; what is neither a number nor a list of them always is."""
        if isinstance(value, tuple | list):
            return self.size in (None, len(value)) and all(map(self.holds, value))
        if isinstance(value, bool) or not isinstance(value, int | float | np.number):
            return True
        return is_finite(value) and self.least <= value <= self.most and value > self.above

    def __str__(self) -> str:
        """Return the allowed values in words."""
        if self.size is not None:
            return f"{self.size} numbers"
        if self.above > -inf:
            return f"a number > {self.above:g}" + (f" and ≤ {self.most:g}" if self.most < inf else "")
        if self.most < inf:
            return f"a number from {self.least:g} to {self.most:g}"
        return f"a number ≥ {self.least:g}" if self.least > -inf else "a finite number"


def option(default: Value, text: str, **bounds: Any) -> Value:
    """Return a field of an options dataclass with its default, description and the bounds of `Meaning`."""
    return field(default=default, metadata={_KEY: Meaning(text, **bounds)})


@dataclass(frozen=True)
class PlannerOptions:
    """Base class of planner options: check values against the ranges of their fields.

    A derived dataclass with further conditions raises `OptionError` in a `__post_init__` of its
    own, after that of this one.

    Raises:
        OptionError: a value out of range.
    """

    def __post_init__(self) -> None:
        known = meanings(type(self))
        for name, value in vars(self).items():
            meaning = known[name]
            if not meaning.holds(value):
                raise OptionError(name, _shown(value), str(meaning))


@dataclass(frozen=True)
class Option:
    """One option of a planner: its type in words (`float`, `list of float`, `a | b`), default and description.

    The default of an option that has none, which only a third-party planner may have, is `required`.
    """

    name: str
    kind: str
    default: Any
    meaning: str = ""


def options_of(cls: type[Any]) -> tuple[Option, ...]:
    """Return the options of an options dataclass."""
    types, texts = get_type_hints(cls), meanings(cls)
    given = [f for f in fields(cls) if f.init]
    return tuple(Option(f.name, kind_of(types[f.name]), default_of(f), texts[f.name].text) for f in given)


def default_of(of: Field[Any]) -> Any:
    """Return the default of an option, also one made by a factory; `required` without one."""
    if of.default_factory is not MISSING:
        return of.default_factory()
    return "required" if of.default is MISSING else of.default


def meanings(cls: type[Any]) -> dict[str, Meaning]:
    """Return the metadata of a dataclass's fields by name; fields of a third-party class may have none."""
    return {f.name: f.metadata.get(_KEY, Meaning()) for f in fields(cls)}


def make_options(planner: str, cls: type[Any], given: Mapping[str, Any]) -> Any:
    """Build an options dataclass from plain data, with defaults for the options not given.

    Raises:
        UnknownChoiceError: no such option; lists the valid ones with their types.
        InputError: values of the wrong type or out of range; holds all of the wrong type.
    """
    valid = {one.name: one for one in options_of(cls)} if given else {}
    types = get_type_hints(cls) if given else {}
    values: dict[str, Any] = {}
    issues = []
    for key, value in given.items():
        if key not in valid:
            described = [f"{o.name} ({o.kind}, default {o.default})" for o in valid.values()]
            raise UnknownChoiceError(f"option of planner '{planner}'", key, described)
        try:
            values[key] = _checked(types[key], value)
        except ValidationError:
            issues.append(Issue.of_option(planner, key, describe(value), in_words(valid[key].kind)))
    if issues:
        raise InputError(issues)
    try:
        return cls(**values)
    except OptionError as error:
        raise option_error(planner, error.option, error.found, error.expected) from None
    except (TypeError, ValueError) as error:  # a third-party class; TypeError where a required option is not given
        expected = "options as `optiplan planners NAME` describes them"
        raise option_error(planner, "options", str(error), expected) from None


def option_error(planner: str, option: str, found: str, expected: str) -> InputError:
    """Return the error about one option of a planner."""
    return InputError([Issue.of_option(planner, option, found, expected)])


def kind_of(hint: Any) -> str:
    """Return an option's type in words, without None ("not given")."""
    if get_origin(hint) is Literal:
        return " | ".join(map(str, get_args(hint)))
    parts = [part for part in get_args(hint) if part is not NoneType]
    if get_origin(hint) in (tuple, list):
        return f"list of {kind_of(parts[0])}"
    return " | ".join(map(kind_of, parts)) if get_origin(hint) in (Union, UnionType) else str(hint.__name__)


def in_words(kind: str) -> str:
    """Describe values of a type: `list of float` is "a list of numbers", `a | b` is "one of: a, b"."""
    if " | " in kind:
        return f"one of: {kind.replace(' | ', ', ')}"
    inner = kind.removeprefix("list of ")
    if inner == kind:
        return _KINDS.get(kind, kind)
    words = in_words(inner)
    return f"a list of {words.removeprefix('a ')}s" if inner in ("float", "int") else f"a list, each {words}"


def _checked(hint: Any, value: Any) -> Any:
    """Return a value as the type of an option has it: a list as it is where it fits, else as a tuple.

    A value of a type that pydantic cannot check, as third-party classes may have, is returned as it is.

    Raises:
        ValidationError: it is not of the type.
    """
    try:
        one = create_model("Option", __config__=_TYPES, value=(hint, ...))
    except (PydanticUserError, SchemaError):
        return value
    try:
        return vars(one.model_validate({"value": value}))["value"]
    except ValidationError:
        return vars(one.model_validate({"value": _frozen(value)}))["value"]


def _frozen(value: Any) -> Any:
    """Convert YAML lists to tuples, at any depth."""
    return tuple(map(_frozen, value)) if isinstance(value, list) else value


def _shown(value: Any) -> str:
    return str(list(value)) if isinstance(value, tuple | list) else describe(value)
