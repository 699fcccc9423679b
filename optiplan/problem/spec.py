"""The schema of a problem file, `version: 1`; SI units and radians throughout.

These classes hold what the file says, after checks that need nothing but the file itself; `compile.py` checks it
against the robot and the scene.
"""

from collections.abc import Callable
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, model_validator

from optiplan.geometry import unit
from optiplan.yaml_lines import Number, Strict, Whole

FARTHEST = 1e6
"""Largest length and coordinate, m: nothing that an arm can meet, and squares of it are still exact enough."""

Length = Annotated[float, Field(strict=True, gt=0.0, le=FARTHEST, allow_inf_nan=False)]
"""A number > 0, m."""

Coordinate = Annotated[float, Field(strict=True, ge=-FARTHEST, le=FARTHEST, allow_inf_nan=False)]
"""A number of either sign, m (or rad, or of a unit vector)."""

NotNegative = Annotated[float, Field(strict=True, ge=0.0, allow_inf_nan=False)]
Fraction = Annotated[float, Field(strict=True, ge=1e-6, le=1.0, allow_inf_nan=False)]


def _printable(text: str) -> str:
    if not text.isprintable():  # they would rule the terminal that the name is printed to
        raise ValueError(f"found {text[:60]!r}; expected text of one line without control characters")
    return text


Name = Annotated[str, Field(strict=True, min_length=1), AfterValidator(_printable)]


def _sized(count: int, words: str) -> AfterValidator:
    def check(values: tuple[Any, ...]) -> tuple[Any, ...]:
        if len(values) != count:
            raise ValueError(f"{count} values {words}")
        return values

    return AfterValidator(check)


def _unit_length(values: tuple[float, ...]) -> tuple[float, ...]:
    unit(values)
    return values


def _distinct(names: tuple[str, ...]) -> tuple[str, ...]:
    if len(set(names)) != len(names):
        raise ValueError(f"found '{names[0]}' twice; expected the names of two bodies")
    return names


def _empty(what: str) -> AfterValidator:
    def check(values: tuple[Any, ...]) -> tuple[Any, ...]:
        if values:
            raise ValueError(f"an empty list: {what} are not supported in this release")
        return values

    return AfterValidator(check)


def _repeated(value: Any) -> Any:
    return [value] * 3 if isinstance(value, int | float) and not isinstance(value, bool) else value


def _named(value: Any) -> Any:
    return {"name": value} if isinstance(value, str) else value


def _schema_size(count: int) -> Callable[[dict[str, Any]], None]:
    def add(schema: dict[str, Any]) -> None:
        schema.update(minItems=count, maxItems=count)

    return add


Vector = Annotated[tuple[Coordinate, ...], _sized(3, "[x, y, z]"), Field(json_schema_extra=_schema_size(3))]
Size = Annotated[tuple[Length, ...], _sized(3, "[x, y, z]"), Field(json_schema_extra=_schema_size(3))]
Scale = Annotated[Size, BeforeValidator(_repeated, json_schema_input_type=Length | Size)]
Direction = Annotated[Vector, AfterValidator(_unit_length)]
Quaternion = Annotated[
    tuple[Number, ...],
    _sized(4, "[x, y, z, w]"),
    AfterValidator(_unit_length),
    Field(json_schema_extra=_schema_size(4)),
]
NamePair = Annotated[
    tuple[Name, ...],
    _sized(2, "[name, name]"),
    AfterValidator(_distinct),
    Field(json_schema_extra=_schema_size(2)),
]


class ExactlyOne(Strict):
    """A mapping that has exactly one of its keys."""

    @model_validator(mode="after")
    def _one(self) -> Self:
        valid = f"exactly one of: {', '.join(type(self).model_fields)}"
        if len(self.model_fields_set) != 1:
            raise ValueError(valid)
        if getattr(self, self.kind) is None:
            raise ValueError(f"found '{self.kind}' without a value; expected {valid}")
        return self

    @property
    def kind(self) -> str:
        """The key that is there."""
        return next(iter(self.model_fields_set))


class PoseSpec(Strict):
    """`position`, m, and `rpy` about fixed axes, rad, or `quaternion` [x, y, z, w]; neither is the identity."""

    position: Vector = (0.0, 0.0, 0.0)
    rpy: Vector | None = None
    quaternion: Quaternion | None = None

    @model_validator(mode="after")
    def _one_rotation(self) -> Self:
        if self.rpy is not None and self.quaternion is not None:
            raise ValueError("found both rpy and quaternion; expected at most one of them")
        return self


class RoundSpec(Strict):
    """`radius` and `length` of a cylinder (whole length) or capsule (length between the round caps), m."""

    radius: Length
    length: Length


class HalfSpaceSpec(Strict):
    """All points p with normal . p <= offset are solid; `normal` has unit length, `offset` in m."""

    normal: Direction
    offset: Coordinate = 0.0


class MeshSpec(Strict):
    """`file` (STL, OBJ, DAE) beside the problem file, times `scale` (one number or [x, y, z]); `convex`: its hull."""

    file: Name
    scale: Scale = (1.0, 1.0, 1.0)
    convex: Annotated[bool, Field(strict=True)] = False


class ShapeSpec(ExactlyOne):
    """One shape, such as `box: [x, y, z]` or `sphere: radius`."""

    box: Size | None = None
    sphere: Length | None = None
    cylinder: RoundSpec | None = None
    capsule: RoundSpec | None = None
    half_space: HalfSpaceSpec | None = None
    mesh: MeshSpec | None = None


class ObstacleSpec(Strict):
    """A shape that stands still; `pose` in the world."""

    name: Name
    shape: ShapeSpec
    pose: PoseSpec = PoseSpec()


def _bounded(shape: ShapeSpec) -> ShapeSpec:
    if shape.half_space is not None:
        raise ValueError("found a half_space; expected a shape that ends somewhere: no robot can carry a half-space")
    return shape


class AttachedSpec(Strict):
    """A shape held by `link`; `pose` in the link's frame; it may touch the links of `touch`, and `link`."""

    name: Name
    shape: Annotated[ShapeSpec, AfterValidator(_bounded)]
    link: Name
    pose: PoseSpec = PoseSpec()
    touch: tuple[Name, ...] = ()


class SceneSpec(Strict):
    """What stands around the robot, what it holds, and which bodies may touch."""

    obstacles: tuple[ObstacleSpec, ...] = ()
    attached: tuple[AttachedSpec, ...] = ()
    allowed_collisions: tuple[NamePair, ...] = ()


class ToleranceSpec(Strict):
    """Of a pose: `position` in m, `orientation` in rad."""

    position: Length = 1e-4
    orientation: Length = 1e-3


class PoseGoalSpec(PoseSpec):
    """The pose of `frame` (default: the robot's tool frame) in the world."""

    frame: Name | None = None
    position: Vector
    tolerance: ToleranceSpec = ToleranceSpec()


class StartSpec(ExactlyOne):
    """`joints`: one value per planned joint; or `configuration`: a name in the robot file."""

    joints: tuple[Number, ...] | None = None
    configuration: Name | None = None


class AlternativeSpec(StartSpec):
    """One end of the motion."""

    pose: PoseGoalSpec | None = None


class GoalSpec(AlternativeSpec):
    """One end of the motion, or `any_of` several."""

    any_of: Annotated[tuple[AlternativeSpec, ...], Field(min_length=1)] | None = None


class LimitsSpec(Strict):
    """Fractions of the robot's own limits; `jerk: none` lifts the jerk limits, so that the acceleration may jump."""

    velocity: Fraction = 1.0
    acceleration: Fraction = 1.0
    jerk: Fraction | Literal["none"] = 1.0
    torque: Fraction = 1.0


class ObjectiveSpec(Strict):
    """Weights of duration (1/s) and of the integral of squared jerk."""

    time: NotNegative = 1.0
    jerk: NotNegative = 0.0

    @model_validator(mode="after")
    def _something(self) -> Self:
        if self.time == 0.0 and self.jerk == 0.0:
            raise ValueError("found all weights 0; expected at least one weight > 0")
        return self


class PlannerSpec(Strict):
    """`name` of a planner, and options of that planner beside it."""

    model_config = ConfigDict(extra="allow", frozen=True)

    name: Name = "trajopt"


class ProblemSpec(Strict):
    """A problem file.

    `group` names the planned joints among the robot file's `groups`; `locked` holds values of joints that are not
    planned (fingers), over those of the robot file.
    """

    version: Literal[1]
    name: Name | None = None
    robot: Name
    group: Name | None = None
    locked: dict[Name, Number] = Field(default_factory=dict)
    start: StartSpec
    goal: GoalSpec
    scene: SceneSpec = SceneSpec()
    via: Annotated[tuple[Any, ...], _empty("via points")] = ()
    path_constraints: Annotated[tuple[Any, ...], _empty("path constraints")] = ()
    limits: LimitsSpec = LimitsSpec()
    objective: ObjectiveSpec = ObjectiveSpec()
    planner: Annotated[PlannerSpec, BeforeValidator(_named, json_schema_input_type=str | PlannerSpec)] = PlannerSpec()
    seed: Annotated[Whole, Field(ge=0)] = 0


def problem_schema() -> dict[str, Any]:
    """JSON schema of a problem file, for editors that complete and check YAML."""
    schema = ProblemSpec.model_json_schema(mode="validation")
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
