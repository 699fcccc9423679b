"""Options of planners: fields of a dataclass that state what they mean and which values they take."""

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from math import inf, isfinite
from types import NoneType
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from pydantic import ConfigDict, TypeAdapter, ValidationError

from optiplan.config.messages import describe
from optiplan.errors import InputError, Issue, OptiPlanError, UnknownChoiceError

Value = TypeVar("Value")

_KEY = "optiplan"
_KINDS = {"float": "a number", "int": "a whole number", "bool": "true or false", "str": "text"}


class OptionError(OptiPlanError, ValueError):
    """A value that an option cannot have, or that does not go with the others.

    Attributes:
        option: its name.
        found: what it is.
        expected: what it may be.
    """

    def __init__(self, option: str, found: str, expected: str) -> None:
        self.option, self.found, self.expected = option, found, expected
        super().__init__(f"{option} = {found}; expected {expected}")


@dataclass(frozen=True)
class Meaning:
    """What the metadata of a field hold.

    Attributes:
        text: what it means, with the unit.
        least: the smallest value.
        most: the largest value; infinity itself is never one.
        above: the value is larger than this.
        size: how many numbers a list has; None: any number of them.
    """

    text: str = ""
    least: float = -inf
    most: float = inf
    above: float = -inf
    size: int | None = None

    def holds(self, value: Any) -> bool:
        """Whether a value is within the range; None, which stands for "not given", and text are."""
        if isinstance(value, tuple):
            return self.size in (None, len(value)) and all(map(self.holds, value))
        if isinstance(value, str | NoneType):
            return True
        return isfinite(value) and self.least <= value <= self.most and value > self.above

    def __str__(self) -> str:
        """The values that it may have, in words."""
        if self.size is not None:
            return f"{self.size} numbers"
        if self.above > -inf:
            return f"a number > {self.above:g}" + (f" and ≤ {self.most:g}" if self.most < inf else "")
        if self.most < inf:
            return f"a number from {self.least:g} to {self.most:g}"
        return f"a number ≥ {self.least:g}" if self.least > -inf else "a finite number"


def option(default: Value, text: str, **bounds: Any) -> Value:
    """A field of an options dataclass: its default, what it means, and the bounds of `Meaning`."""
    return field(default=default, metadata={_KEY: Meaning(text, **bounds)})


@dataclass(frozen=True)
class PlannerOptions:
    """What the options of planners derive from: values are held against the ranges that their fields state.

    A dataclass derived from it that has more to refuse than ranges raises `OptionError` in a `__post_init__` of its
    own, after that of this one.

    Raises:
        OptionError: a value out of range.
    """

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            meaning = meanings(type(self))[name]
            if not meaning.holds(value):
                raise OptionError(name, _shown(value), str(meaning))


@dataclass(frozen=True)
class Option:
    """One setting of a planner: its type in words (`float`, `list of float`, `a | b`), its default and its meaning."""

    name: str
    kind: str
    default: Any
    meaning: str = ""


def options_of(cls: type[Any]) -> tuple[Option, ...]:
    """What can be set by a dataclass of options."""
    types, texts = get_type_hints(cls), meanings(cls)
    return tuple(
        Option(f.name, kind_of(types[f.name]), f.default, texts[f.name].text)
        for f in fields(cls)
        if f.default is not MISSING
    )


def meanings(cls: type[Any]) -> dict[str, Meaning]:
    """What the fields of a dataclass state, by name; those of a class from outside may state nothing."""
    return {f.name: f.metadata.get(_KEY, Meaning()) for f in fields(cls)}


def make_options(planner: str, cls: type[Any], given: Mapping[str, Any]) -> Any:
    """A dataclass of options with the values given, as plain data, and defaults for the others.

    Raises:
        UnknownChoiceError: no such option; lists the valid ones with their types.
        InputError: values of the wrong type or out of range; holds all of the wrong type.
    """
    valid, types = {one.name: one for one in options_of(cls)}, get_type_hints(cls)
    values: dict[str, Any] = {}
    issues = []
    for key, value in given.items():
        if key not in valid:
            described = [f"{o.name} ({o.kind}, default {o.default})" for o in valid.values()]
            raise UnknownChoiceError(f"option of planner '{planner}'", key, described)
        try:
            values[key] = TypeAdapter(types[key], config=ConfigDict(strict=True)).validate_python(_frozen(value))
        except ValidationError:
            issues.append(Issue.of_option(planner, key, describe(value), in_words(valid[key].kind)))
    if issues:
        raise InputError(issues)
    try:
        return cls(**values)
    except OptionError as error:
        raise InputError([Issue.of_option(planner, error.option, error.found, error.expected)]) from None
    except ValueError as error:  # a class from outside
        expected = "options as `optiplan planners` describes them"
        raise InputError([Issue.of_option(planner, "options", str(error), expected)]) from None


def kind_of(hint: Any) -> str:
    """An option's type in words; None, which stands for "not given", is left out."""
    if get_origin(hint) is Literal:
        return " | ".join(map(str, get_args(hint)))
    if get_origin(hint) is tuple:
        return f"list of {kind_of(get_args(hint)[0])}"
    parts = [part for part in get_args(hint) if part is not NoneType]
    return " | ".join(map(kind_of, parts)) if parts else str(hint.__name__)


def in_words(kind: str) -> str:
    """What a value of that kind is: `list of float` is "a list of numbers", `a | b` is "one of: a, b"."""
    if " | " in kind:
        return f"one of: {kind.replace(' | ', ', ')}"
    inner = kind.removeprefix("list of ")
    if inner == kind:
        return _KINDS.get(kind, kind)
    words = in_words(inner)
    return f"a list of {words.removeprefix('a ')}s" if inner in ("float", "int") else f"a list, each {words}"


def _frozen(value: Any) -> Any:
    """Lists of YAML as tuples, at any depth."""
    return tuple(map(_frozen, value)) if isinstance(value, list) else value


def _shown(value: Any) -> str:
    return str(list(value)) if isinstance(value, tuple) else str(value)
