"""The schema of a problem file, `version: 1`; SI units and radians throughout.

These classes hold what the file says, after checks that need nothing but the file itself; `compile.py` checks it
against the robot and the scene.
"""

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, model_validator

from optiplan.config.document import Number, Strict, Whole
from optiplan.config.values import (
    Coordinate,
    Direction,
    ExactlyOne,
    FileName,
    Fraction,
    Length,
    Name,
    NamePair,
    NotNegative,
    Vector,
)
from optiplan.geometry.pose_schema import PoseSpec as PoseSpec
from optiplan.geometry.pose_schema import ToleranceSpec as ToleranceSpec
from optiplan.geometry.shapes import SHAPES, ShapeSpec
from optiplan.problem.constraints.schema import PathConstraintSpec as PathConstraintSpec
from optiplan.problem.regions.schema import RegionSpec as RegionSpec

LARGEST_MASS = 1e6
"""kg; nothing that an arm can hold."""


def _named(value: Any) -> Any:
    if not isinstance(value, str | Mapping | PlannerSpec):
        raise ValueError("the name of a planner, or {name: …} with its options")
    return {"name": value} if isinstance(value, str) else value


Polynomial = Annotated[tuple[Coordinate, ...], Field(min_length=1, max_length=10)]
"""Coefficients in ascending powers."""


class MotionSpec(Strict):
    """A displacement, added to the position of the pose: one polynomial of time for each of x, y and z of the world.

    `polynomial` has their coefficients in ascending powers, m/s^k; time counts from the start of the robot's motion.
    After `until`, s, the obstacle stands.
    """

    polynomial: Annotated[tuple[Polynomial, ...], Field(min_length=3, max_length=3)]
    until: Length | None = None


class ObstacleSpec(Strict):
    """A shape that stands still at `pose` in the world, or moves from there as stated."""

    name: Name
    shape: ShapeSpec
    pose: PoseSpec = PoseSpec()
    motion: MotionSpec | None = None

    @model_validator(mode="after")
    def _bounded_motion(self) -> Self:
        if self.motion is not None and SHAPES[self.shape.kind].endless:
            raise ValueError(f"found a {self.shape.kind} that moves; expected a shape that ends somewhere")
        return self


def _bounded(shape: ShapeSpec) -> ShapeSpec:
    if SHAPES[shape.kind].endless:
        raise ValueError(f"found a {shape.kind}; expected a shape that ends somewhere: no robot can carry a half-space")
    return shape


class AttachedSpec(Strict):
    """A shape held by `link`; `pose` in the link's frame; it may touch the links of `touch`, and `link`.

    `mass` in kg, none without; its `centre` (m) and `inertia` about that ([ixx, iyy, izz], kg m²) in the frame of the
    shape are those of the shape filled evenly, where they are not given.
    """

    name: Name
    shape: Annotated[ShapeSpec, AfterValidator(_bounded)]
    link: Name
    pose: PoseSpec = PoseSpec()
    touch: tuple[Name, ...] = ()
    mass: Annotated[NotNegative, Field(le=LARGEST_MASS)] | None = None
    centre: Vector | None = None
    inertia: Vector | None = None

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.mass is None and (self.centre is not None or self.inertia is not None):
            raise ValueError("found a centre or an inertia of what has no mass; expected `mass` too")
        if self.inertia is not None:
            x, y, z = self.inertia
            if min(x, y, z) < 0.0 or max(x, y, z) > 0.5 * (x + y + z) * (1.0 + 1e-9):
                expected = "moments, none larger than the other two together"
                raise ValueError(f"found inertia {list(self.inertia)}; expected {expected}")
        return self


class SceneSpec(Strict):
    """Obstacles, attached objects, and the pairs of bodies that may touch."""

    obstacles: tuple[ObstacleSpec, ...] = ()
    attached: tuple[AttachedSpec, ...] = ()
    allowed_collisions: tuple[NamePair, ...] = ()


class PoseGoalSpec(PoseSpec):
    """The pose of `frame` (default: the robot's tool frame) in the world."""

    frame: Name | None = None
    position: Vector
    tolerance: ToleranceSpec = ToleranceSpec()


Rates = Annotated[tuple[Number, ...] | None, AfterValidator(lambda rates: rates if rates and any(rates) else None)]
"""One value per planned joint; zeros are as good as nothing, so that rest is said in one way."""


class StartSpec(ExactlyOne):
    """`joints`: one value per planned joint; or `configuration`: a name in the robot file.

    `velocity` (rad/s or m/s) and `acceleration` (rad/s² or m/s²), one value per planned joint: at rest without them.
    """

    BESIDE: ClassVar[frozenset[str]] = frozenset({"velocity", "acceleration"})

    joints: tuple[Number, ...] | None = None
    configuration: Name | None = None
    velocity: Rates = None
    acceleration: Rates = None

    @model_validator(mode="after")
    def _state(self) -> Self:
        for key in ("velocity", "acceleration"):
            if getattr(self, key) is not None and self.kind not in ("joints", "configuration"):
                raise ValueError(f"found {key} with {self.kind}; expected it with joints or configuration only")
        return self


class AlternativeSpec(StartSpec):
    """One end of the motion."""

    pose: PoseGoalSpec | None = None
    region: RegionSpec | None = None


class GoalSpec(AlternativeSpec):
    """One end of the motion, or `any_of` several."""

    any_of: Annotated[tuple[AlternativeSpec, ...], Field(min_length=1)] | None = None


class ViaPoseSpec(PoseSpec):
    """The pose of `frame` (default: the robot's tool frame) in the world, to be passed within `tolerance`."""

    frame: Name | None = None
    position: Vector
    tolerance: ToleranceSpec | None = None


class ViaSpec(Strict):
    """A point to be passed between start and goal.

    `tolerance` is of each joint or of both parts of a pose, rad or m; `velocity` (rad/s or m/s, one value per planned
    joint) and `time` (s from the start) are wishes, which the planner `spline` can grant.
    """

    joints: tuple[Number, ...] | None = None
    configuration: Name | None = None
    pose: ViaPoseSpec | None = None
    tolerance: Length | None = None
    velocity: tuple[Number, ...] | None = None
    time: Length | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        kinds = [key for key in ("joints", "configuration", "pose") if getattr(self, key) is not None]
        if len(kinds) != 1:
            found = " and ".join(kinds) or "none of them"
            raise ValueError(f"found {found}; expected exactly one of: joints, configuration, pose")
        if self.pose is not None and self.pose.tolerance is not None and self.tolerance is not None:
            raise ValueError("found a tolerance of the via and one of its pose; expected at most one of them")
        return self


def _timed(vias: tuple[ViaSpec, ...]) -> tuple[ViaSpec, ...]:
    times = [via.time for via in vias if via.time is not None]
    if times and len(times) != len(vias):
        raise ValueError(f"found a time at {len(times)} of {len(vias)} vias; expected one at each, or at none")
    for before, after in pairwise(times):
        if after <= before:
            raise ValueError(f"found time {after:g} after time {before:g}; expected increasing times")
    return vias


ENDS = ("joints", "configuration", "pose", "region")
"""What one end of a motion can be."""


class MoveSpec(Strict):
    """Go to one end, or any of several, past `via`, with the joints of `group` (default: that of the problem)."""

    joints: tuple[Number, ...] | None = None
    configuration: Name | None = None
    pose: PoseGoalSpec | None = None
    region: RegionSpec | None = None
    any_of: Annotated[tuple[AlternativeSpec, ...], Field(min_length=1)] | None = None
    via: Annotated[tuple[ViaSpec, ...], AfterValidator(_timed)] = ()
    group: Name | None = None

    @model_validator(mode="after")
    def _one_end(self) -> Self:
        _exactly_one(self, (*ENDS, "any_of"))
        return self


class StraightLineSpec(Strict):
    """The tool straight to `pose`, or `by` a vector, m, seen from the world or the tool (`in`).

    `speed` of the tool at most, m/s; `frame` is the robot's tool frame without one. `blend`, m: where a line follows,
    the corner may be rounded off within this distance of it; without one it is exact, and the arm stops there.
    """

    pose: PoseGoalSpec | None = None
    by: Vector | None = None
    in_: Annotated[Literal["world", "tool"], Field(alias="in")] = "world"
    frame: Name | None = None
    speed: Length | None = None
    blend: Length | None = None
    group: Name | None = None

    @model_validator(mode="after")
    def _one_end(self) -> Self:
        _exactly_one(self, ("pose", "by"))
        if self.pose is not None and (self.in_ != "world" or self.frame is not None):
            raise ValueError("found `in` or `frame` of the line; expected `frame` of the pose")
        return self


class ApproachSpec(Strict):
    """Anywhere to `distance`, m, before a pose, and from there straight `along` an axis of its frame.

    `blend` is as of a line.
    """

    pose: PoseGoalSpec | None = None
    any_of: Annotated[tuple[PoseGoalSpec, ...], Field(min_length=1)] | None = None
    distance: Length
    along: Direction = (0.0, 0.0, 1.0)
    speed: Length | None = None
    via: Annotated[tuple[ViaSpec, ...], AfterValidator(_timed)] = ()
    blend: Length | None = None
    group: Name | None = None

    @model_validator(mode="after")
    def _one_end(self) -> Self:
        _exactly_one(self, ("pose", "any_of"))
        return self


class RetreatSpec(Strict):
    """The tool straight by `distance`, m, `along` an axis of the tool or the world (`in`); `blend` as of a line."""

    distance: Length
    along: Direction = (0.0, 0.0, -1.0)
    in_: Annotated[Literal["world", "tool"], Field(alias="in")] = "tool"
    frame: Name | None = None
    speed: Length | None = None
    blend: Length | None = None
    group: Name | None = None


class AttachSpec(Strict):
    """`link` takes an obstacle where it stands; it may touch the links of `touch`, and `link`.

    `mass`, `centre` and `inertia` are as of an attached object.
    """

    object: Name
    link: Name
    touch: tuple[Name, ...] = ()
    mass: Annotated[NotNegative, Field(le=LARGEST_MASS)] | None = None
    centre: Vector | None = None
    inertia: Vector | None = None


class DetachSpec(Strict):
    """What is held becomes an obstacle where it is."""

    object: Name


class GripperSpec(Strict):
    """Joints of a `group` move to `joints`, rad or m, or to their values in a named configuration."""

    group: Name
    joints: tuple[Number, ...] | None = None
    configuration: Name | None = None

    @model_validator(mode="after")
    def _one_end(self) -> Self:
        _exactly_one(self, ("joints", "configuration"))
        return self


def _exactly_one(spec: Strict, keys: tuple[str, ...]) -> None:
    given = [key for key in keys if getattr(spec, key) is not None]
    if len(given) != 1:
        raise ValueError(f"found {' and '.join(given) or 'none of them'}; expected exactly one of: {', '.join(keys)}")


class TaskStepSpec(Strict):
    """One step of a task: one of the keys from `move` to `dwell` (s), and what holds during this step.

    `allowed_collisions` of an approach are for its line alone.
    """

    move: MoveSpec | None = None
    line: StraightLineSpec | None = None
    approach: ApproachSpec | None = None
    retreat: RetreatSpec | None = None
    attach: AttachSpec | None = None
    detach: DetachSpec | None = None
    gripper: GripperSpec | None = None
    dwell: Length | None = None
    name: Name | None = None
    allowed_collisions: tuple[NamePair, ...] = ()
    path_constraints: tuple[PathConstraintSpec, ...] = ()

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        _exactly_one(self, STEP_KINDS)
        return self

    @property
    def kind(self) -> str:
        """The key of what is done."""
        return next(kind for kind in STEP_KINDS if getattr(self, kind) is not None)


STEP_KINDS = ("move", "line", "approach", "retreat", "attach", "detach", "gripper", "dwell")
"""What a step of a task can be."""


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
        if not any(self.model_dump().values()):
            raise ValueError("found all weights 0; expected at least one weight > 0")
        return self


class PlannerSpec(Strict):
    """`name` of a planner, and options of that planner beside it."""

    model_config = ConfigDict(extra="allow", frozen=True)

    name: Name = "trajopt"


class ProblemSpec(Strict):
    """A problem file.

    `robot` is the name of one that comes along, the path of a robot.yaml, or what would stand in one (`{urdf: …}`).
    `group` names the planned joints among the robot file's `groups`; `locked` holds values of joints that are not
    planned (fingers), over those of the robot file. `base` is the pose of the robot's root in the world, the identity
    without one, and `gravity` the acceleration of free fall in the world, m/s², [0, 0, -9.81] without one. There is
    either a `goal` or a `task` of several steps.
    """

    version: Literal[1]
    name: Name | None = None
    robot: FileName | dict[str, Any]
    group: Name | None = None
    locked: dict[Name, Number] = Field(default_factory=dict)
    base: PoseSpec | None = None
    gravity: Vector | None = None
    start: StartSpec
    goal: GoalSpec | None = None
    task: Annotated[tuple[TaskStepSpec, ...], Field(min_length=1)] | None = None
    scene: SceneSpec = SceneSpec()
    via: Annotated[tuple[ViaSpec, ...], AfterValidator(_timed)] = ()
    path_constraints: tuple[PathConstraintSpec, ...] = ()
    limits: LimitScalesSpec = LimitScalesSpec()
    objective: ObjectiveSpec = ObjectiveSpec()
    planner: Annotated[PlannerSpec, BeforeValidator(_named, json_schema_input_type=str | PlannerSpec)] = PlannerSpec()
    seed: Annotated[Whole, Field(ge=0)] = 0


def problem_schema() -> dict[str, Any]:
    """JSON schema of a problem file, for editors that complete and check YAML."""
    schema = ProblemSpec.model_json_schema(mode="validation")
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
