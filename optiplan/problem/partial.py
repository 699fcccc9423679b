"""Valid parts of a problem file, each read by itself, so that they can be checked although another part is invalid."""

from dataclasses import dataclass
from functools import cache
from typing import Any, Generic, TypeVar

from pydantic import BaseModel, TypeAdapter, ValidationError

from optiplan.config.simple_yaml import Place
from optiplan.problem.schema.ends import AlternativeSpec, GoalSpec

T = TypeVar("T")


@dataclass(frozen=True)
class LocatedValue(Generic[T]):
    """A value and its place in the file."""

    place: Place
    value: T


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def fit(kind: Any, raw: Any) -> Any:
    """Return data as a type of pydantic's; None where it does not fit; values of that class as they are."""
    if isinstance(kind, type) and isinstance(raw, kind) and issubclass(kind, BaseModel):
        return raw
    try:
        return _adapter(kind).validate_python(raw)
    except ValidationError:
        return None


def fits(place: Place, kind: Any, raw: Any) -> list[LocatedValue[Any]]:
    """Return the items of a list that fit a type."""
    values = [fit(kind, item) for item in raw] if isinstance(raw, list | tuple) else []
    return [LocatedValue((*place, i), value) for i, value in enumerate(values) if value is not None]


def mapping(value: Any) -> dict[Any, Any]:
    """Return a mapping, or the fields of a model, by key; of anything else none."""
    return dict(value) if isinstance(value, dict | BaseModel) else {}


def alternatives(goal: Any) -> list[LocatedValue[AlternativeSpec]]:
    """Return the ends of `any_of` that fit, or the only one."""
    whole: GoalSpec | None = fit(GoalSpec, goal)
    if whole is not None and whole.any_of is None:
        return [LocatedValue(("goal",), whole)]
    return fits(("goal", "any_of"), AlternativeSpec, mapping(whole or goal).get("any_of"))
