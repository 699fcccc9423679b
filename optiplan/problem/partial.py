"""Valid parts of a problem file, so that they can be checked although another part is invalid."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Generic, TypeVar

from pydantic import BaseModel, TypeAdapter, ValidationError

from optiplan.config.document import Number
from optiplan.config.simple_yaml import Place
from optiplan.config.values import FileName, Name, NamePair, Vector
from optiplan.geometry.pose import PoseSpec
from optiplan.problem.constraints.statements import PathConstraintSpec
from optiplan.problem.schema.ends import AlternativeSpec, GoalSpec, StartSpec, ViaSpec
from optiplan.problem.schema.scene import AttachedSpec, ObstacleSpec
from optiplan.problem.schema.task import TaskStepSpec

T = TypeVar("T")


@dataclass(frozen=True)
class LocatedValue(Generic[T]):
    """A value of the schema and its place in the file."""

    place: Place
    value: T


@dataclass(frozen=True)
class Draft:
    """The valid parts of a problem file, each read by itself: none hides what is wrong with another."""

    robot: str | Mapping[str, Any] | None
    group: str | None
    locked: Mapping[str, float]
    base: PoseSpec | None
    gravity: tuple[float, ...] | None
    start: LocatedValue[StartSpec] | None
    goal: tuple[LocatedValue[AlternativeSpec], ...]
    task: tuple[LocatedValue[TaskStepSpec], ...]
    vias: tuple[LocatedValue[ViaSpec], ...]
    constraints: tuple[LocatedValue[PathConstraintSpec], ...]
    obstacles: tuple[LocatedValue[ObstacleSpec], ...]
    attached: tuple[LocatedValue[AttachedSpec], ...]
    allowed: tuple[LocatedValue[tuple[str, ...]], ...]

    @classmethod
    def of(cls, data: Any) -> "Draft":
        """Return the valid parts of a file's data, or all parts of a `ProblemSpec`."""
        root = _mapping(data)
        start = _fit(StartSpec, root.get("start"))
        scene = _mapping(root.get("scene"))
        return cls(
            robot=_fit(FileName | dict[str, Any], root.get("robot")),
            group=_fit(Name, root.get("group")),
            locked=_fit(dict[str, Number], root.get("locked", {})) or {},
            base=_fit(PoseSpec, root.get("base")),
            gravity=_fit(Vector, root.get("gravity")),
            start=None if start is None else LocatedValue(("start",), start),
            goal=_alternatives(root.get("goal")),
            task=_fits(("task",), TaskStepSpec, root.get("task")),
            vias=_fits(("via",), ViaSpec, root.get("via")),
            constraints=_fits(("path_constraints",), PathConstraintSpec, root.get("path_constraints")),
            obstacles=_fits(("scene", "obstacles"), ObstacleSpec, scene.get("obstacles")),
            attached=_fits(("scene", "attached"), AttachedSpec, scene.get("attached")),
            allowed=_fits(("scene", "allowed_collisions"), NamePair, scene.get("allowed_collisions")),
        )


def _mapping(value: Any) -> dict[Any, Any]:
    return dict(value) if isinstance(value, dict | BaseModel) else {}


def _alternatives(goal: Any) -> tuple[LocatedValue[AlternativeSpec], ...]:
    """The ends of `any_of`, or the only one."""
    whole: GoalSpec | None = _fit(GoalSpec, goal)
    if whole is not None and whole.any_of is None:
        return (LocatedValue(("goal",), whole),)
    return _fits(("goal", "any_of"), AlternativeSpec, _mapping(whole or goal).get("any_of"))


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def _fit(kind: Any, raw: Any) -> Any:
    try:
        return _adapter(kind).validate_python(raw)
    except ValidationError:
        return None


def _fits(place: Place, kind: Any, raw: Any) -> tuple[LocatedValue[Any], ...]:
    values = [_fit(kind, item) for item in raw] if isinstance(raw, list | tuple) else []
    return tuple(LocatedValue((*place, i), value) for i, value in enumerate(values) if value is not None)
