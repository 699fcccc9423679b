"""Valid parts of a problem file, so that they can be checked although another part is invalid."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from pydantic import TypeAdapter, ValidationError

from optiplan.config.document import Number
from optiplan.config.simple_yaml import Place
from optiplan.config.values import Name, NamePair, Vector
from optiplan.geometry.pose import PoseSpec
from optiplan.problem.constraints.schema import PathConstraintSpec
from optiplan.problem.schema.ends import AlternativeSpec, GoalSpec, StartSpec, ViaSpec
from optiplan.problem.schema.problem import ProblemSpec
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
    """A problem file without its missing or invalid parts."""

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
    def of_spec(cls, spec: ProblemSpec) -> "Draft":
        """Return every part of a valid file."""
        scene = spec.scene
        return cls(
            robot=spec.robot,
            group=spec.group,
            locked=spec.locked,
            base=spec.base,
            gravity=spec.gravity,
            start=LocatedValue(("start",), spec.start),
            goal=() if spec.goal is None else _alternatives(spec.goal),
            task=_parts(("task",), spec.task or ()),
            vias=_parts(("via",), spec.via),
            constraints=_parts(("path_constraints",), spec.path_constraints),
            obstacles=_parts(("scene", "obstacles"), scene.obstacles),
            attached=_parts(("scene", "attached"), scene.attached),
            allowed=_parts(("scene", "allowed_collisions"), scene.allowed_collisions),
        )

    @classmethod
    def of_data(cls, data: Any) -> "Draft":
        """Read the valid parts of a file that does not fit the schema."""
        root = _mapping(data)
        start = _fit(StartSpec, root.get("start"))
        goal = root.get("goal")
        whole = _fit(GoalSpec, goal)
        ends = _mapping(goal).get("any_of")
        scene = _mapping(root.get("scene"))
        return cls(
            robot=_fit(Name | dict[str, Any], root.get("robot")),
            group=_fit(Name, root.get("group")),
            locked=_fit(dict[str, Number], root.get("locked", {})) or {},
            base=_fit(PoseSpec, root.get("base")),
            gravity=_fit(Vector, root.get("gravity")),
            start=None if start is None else LocatedValue(("start",), start),
            goal=_alternatives(whole) if whole else _fits(("goal", "any_of"), AlternativeSpec, ends),
            task=_fits(("task",), TaskStepSpec, root.get("task")),
            vias=_fits(("via",), ViaSpec, root.get("via")),
            constraints=_fits(("path_constraints",), PathConstraintSpec, root.get("path_constraints")),
            obstacles=_fits(("scene", "obstacles"), ObstacleSpec, scene.get("obstacles")),
            attached=_fits(("scene", "attached"), AttachedSpec, scene.get("attached")),
            allowed=_fits(("scene", "allowed_collisions"), NamePair, scene.get("allowed_collisions")),
        )


def _mapping(value: Any) -> dict[Any, Any]:
    return value if isinstance(value, dict) else {}


def _alternatives(goal: GoalSpec) -> tuple[LocatedValue[AlternativeSpec], ...]:
    if goal.any_of is None:
        return (LocatedValue(("goal",), goal),)
    return _parts(("goal", "any_of"), goal.any_of)


def _parts(place: Place, values: tuple[T, ...]) -> tuple[LocatedValue[T], ...]:
    return tuple(LocatedValue((*place, i), value) for i, value in enumerate(values))


def _fit(kind: Any, raw: Any) -> Any:
    try:
        return TypeAdapter(kind).validate_python(raw)
    except ValidationError:
        return None


def _fits(place: Place, kind: Any, raw: Any) -> tuple[LocatedValue[Any], ...]:
    values = [_fit(kind, item) for item in raw] if isinstance(raw, list) else []
    return tuple(LocatedValue((*place, i), value) for i, value in enumerate(values) if value is not None)
