"""Valid parts of a problem file, each read by itself, so that they can be checked although another part is invalid."""

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from pydantic import BaseModel, TypeAdapter, ValidationError

from optiplan.config.simple_yaml import Place
from optiplan.problem.schema.ends import AlternativeSpec, GoalSpec

if TYPE_CHECKING:
    from optiplan.problem.constraints.statements import PathConstraintSpec
    from optiplan.problem.schema.task import TaskStepSpec
    from optiplan.problem.schema.tools import ToolSpec

T = TypeVar("T")


class LocatedValue(NamedTuple, Generic[T]):
    """A value and its place in the file."""

    place: Place
    value: T


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def fit(kind: Any, raw: Any) -> Any:
    """Return data as a type of pydantic's; None where it does not fit; values of that class as they are."""
    if raw is None or (isinstance(kind, type) and isinstance(raw, kind) and issubclass(kind, BaseModel)):
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


def stated_tools(root: Mapping[Any, Any]) -> "list[tuple[Place, str, ToolSpec]]":
    """Return the valid tools of `tools`, and the one that `tool` states itself: place, name and content."""
    if not root.get("tools") and root.get("tool") is None:
        return []
    from optiplan.problem.schema.tools import FirstToolSpec, ToolSpec

    named = mapping(root.get("tools")).items()
    stated: list[tuple[Place, str, ToolSpec | None]]
    stated = [(("tools", name), str(name), fit(ToolSpec, one)) for name, one in named]
    first = None if isinstance(root.get("tool"), str) else fit(FirstToolSpec, root.get("tool"))
    stated += [] if first is None else [(("tool",), first.name, first)]
    return [(place, name, spec) for place, name, spec in stated if spec is not None]


def stated_steps(raw: Any) -> "list[LocatedValue[TaskStepSpec]]":
    """Return the valid steps of a task."""
    if not raw:
        return []
    from optiplan.problem.schema.task import TaskStepSpec

    return fits(("task",), TaskStepSpec, raw)


def stated_constraints(raw: Any) -> "list[LocatedValue[PathConstraintSpec]]":
    """Return the valid path constraints of the whole motion."""
    if not raw:
        return []
    from optiplan.problem.constraints.statements import PathConstraintSpec

    return fits(("path_constraints",), PathConstraintSpec, raw)
