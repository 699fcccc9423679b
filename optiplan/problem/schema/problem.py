"""The schema of a problem file, `version: 1`; SI units and radians throughout.

These classes hold what the file says, after checks that need nothing but the file itself; `problem/builder.py` checks
it against the robot and the scene.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, model_validator

from optiplan.config.built_later import BuiltLater
from optiplan.config.document import Number, Strict, Whole
from optiplan.config.values import FileName, FileVersion, Fraction, Name, NotNegative, Vector
from optiplan.geometry.pose import PoseSpec
from optiplan.problem.schema.ends import GoalSpec, StartSpec, ViaSpec, timed
from optiplan.problem.schema.safety import ClearanceSpec
from optiplan.problem.schema.scene import MovingFrameSpec, SceneSpec


class LimitScalesSpec(Strict):
    """Fractions of the robot's own limits; `jerk: none` lifts the jerk limits, so that the acceleration may jump."""

    velocity: Fraction = 1.0
    acceleration: Fraction = 1.0
    jerk: Fraction | Literal["none"] = 1.0
    torque: Fraction = 1.0


class ObjectiveSpec(Strict):
    """Weights of the parts of the cost; see `objectives.objective.Objective`."""

    time: NotNegative = 1.0
    jerk: NotNegative = 0.0
    energy: NotNegative | None = None
    joint_path: NotNegative | None = None
    tool_path: NotNegative | None = None
    tool_smoothness: NotNegative | None = None
    clearance: NotNegative | None = None
    manipulability: NotNegative | None = None
    centring: NotNegative | None = None

    @model_validator(mode="after")
    def _something(self) -> Self:
        if not any(dict(self).values()):
            raise ValueError("found all weights 0; expected at least one weight > 0")
        return self


def _named(value: Any) -> Any:
    if not isinstance(value, str | Mapping | PlannerSpec):
        raise ValueError("the name of a planner, or {name: …} with its options")
    return {"name": value} if isinstance(value, str) else value


class PlannerSpec(Strict):
    """`name` of a planner, and options of that planner beside it."""

    model_config = ConfigDict(extra="allow", frozen=True)

    name: Name = "trajopt"


def _steps() -> Any:
    from optiplan.problem.schema.task import TaskStepSpec

    return Annotated[tuple[TaskStepSpec, ...], Field(min_length=1)] | None


def _tools() -> Any:
    from optiplan.problem.schema.tools import Tools

    return Tools | None


def _tool() -> Any:
    from optiplan.problem.schema.tools import FirstToolSpec

    return Name | FirstToolSpec | None


def _constraints() -> Any:
    from optiplan.problem.constraints.statements import PathConstraintSpec

    return tuple[PathConstraintSpec, ...]


class ProblemSpec(Strict):
    """A problem file.

    `robot` is the name of a bundled one, the path of a robot.yaml, or what would stand in one (`{urdf: …}`).
    `group` names the planned joints among the robot file's `groups`; `locked` holds values of joints that are not
    planned (fingers), over those of the robot file. `base` is the pose of the robot's root in the world, the identity
    without one, and `gravity` the acceleration of free fall in the world, m/s², [0, 0, -9.81] without one. There is
    either a `goal` or a `task` of several steps. `tools` are tools by name; `tool` is the one that is mounted at the
    start, or states it itself. `tracking_error` says how far joints may be from the motion, rad or m: one number, a
    list, or values by joint. `clearance` says how far bodies stay apart, m. A file may also have `frames`, loops and
    `robots`, which `frames.py`, `loops.py` and `side_by_side.py` take out before anything is read here; of the `frames`
    those that move are left.
    """

    version: FileVersion
    name: Name | None = None
    robot: FileName | dict[str, Any]
    group: Name | None = None
    locked: dict[Name, Number] = Field(default={})
    base: PoseSpec | None = None
    gravity: Vector | None = None
    start: StartSpec
    goal: GoalSpec | None = None
    task: Annotated[Any, BuiltLater(_steps)] = None
    scene: SceneSpec = SceneSpec.model_construct()
    frames: Annotated[dict[Name, MovingFrameSpec] | None, BuiltLater()] = None
    tools: Annotated[Any, BuiltLater(_tools)] = None
    tool: Annotated[Any, BuiltLater(_tool)] = None
    via: Annotated[tuple[ViaSpec, ...], BuiltLater(), AfterValidator(timed)] = ()
    path_constraints: Annotated[Any, BuiltLater(_constraints)] = ()
    tracking_error: NotNegative | tuple[NotNegative, ...] | dict[Name, NotNegative] | None = None
    clearance: ClearanceSpec | None = None
    limits: LimitScalesSpec = LimitScalesSpec.model_construct()
    objective: ObjectiveSpec = ObjectiveSpec.model_construct()
    planner: Annotated[PlannerSpec, BeforeValidator(_named, json_schema_input_type=str | PlannerSpec)] = (
        PlannerSpec.model_construct()
    )
    seed: Annotated[Whole, Field(ge=0)] = 0


def problem_schema() -> dict[str, Any]:
    """JSON schema of a problem file, for editors that complete, explain and check YAML."""
    from optiplan.problem.schema.json_schema import as_written
    from optiplan.problem.schema.meanings import with_meanings

    schema = as_written(ProblemSpec.model_json_schema(mode="validation"))
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **with_meanings(schema)}
