"""The schema of the steps of a task in a problem file."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from optiplan.config.document import Strict, Whole
from optiplan.config.values import Direction, Length, Name, NamePair, NotNegative, Vector, listed
from optiplan.geometry.pose import PoseGoalSpec
from optiplan.problem.constraints.statements import PathConstraintSpec
from optiplan.problem.regions.schema import RegionSpec
from optiplan.problem.schema.ends import (
    CONFIGURATIONS,
    ENDS,
    AlternativeSpec,
    ConfigurationSpec,
    PlacedFrameSpec,
    ViaSpec,
    exactly_one,
    timed,
)
from optiplan.problem.schema.scene import LARGEST_MASS, TOOL, WORLD, check_weight
from optiplan.problem.schema.seam import SeamSpec
from optiplan.problem.schema.tour import TourSpec


class MoveSpec(ConfigurationSpec):
    """Go to one end, or any of several, past `via`, with the joints of `group` (default: that of the problem).

    With poses in what moves, the tool meets them with the velocity that they have; see `rides`.
    """

    pose: PoseGoalSpec | None = None
    region: RegionSpec | None = None
    all_of: Annotated[tuple[PlacedFrameSpec, ...], Field(min_length=2)] | None = None
    any_of: Annotated[tuple[AlternativeSpec, ...], Field(min_length=1)] | None = None
    via: Annotated[tuple[ViaSpec, ...], AfterValidator(timed)] = ()
    rides: Name | None = None
    group: Name | None = None

    @model_validator(mode="after")
    def _one_end(self) -> Self:
        exactly_one(self, (*ENDS, "any_of"))
        return self


class StraightLineSpec(Strict):
    """The tool straight to `pose`, or `by` a vector, m, seen from the world, the tool, or what moves (`in`).

    `speed` of the tool at most, m/s; `frame` is the robot's tool frame without one. `blend`, m: where a line follows,
    the corner may be rounded off within this distance of it; without one it is exact, and the arm stops there.
    """

    pose: PoseGoalSpec | None = None
    by: Vector | None = None
    in_: Annotated[Name, Field(alias="in")] = WORLD
    frame: Name | None = None
    speed: Length | None = None
    blend: Length | None = None
    rides: Name | None = None
    group: Name | None = None

    @model_validator(mode="after")
    def _one_end(self) -> Self:
        exactly_one(self, ("pose", "by"))
        if self.pose is not None and (self.in_ != WORLD or self.frame is not None):
            raise ValueError("found `in` or `frame` of the line; expected `frame` of the pose")
        return self


class GraspsSpec(Strict):
    """Every grasp of an `object`, a box or a cylinder, by two parallel fingers that open to `opening`, m.

    The fingers close along the axis `closing` of `frame` (default: the tool frame), whose origin is between their tips.
    It goes `depth`, m, below the surface, to the middle of the object without it, at most 30 mm. `turns` directions are
    tried about the axis of a cylinder.
    """

    object: Name
    opening: Length
    closing: Literal["x", "y", "z"] = "y"
    depth: Length | None = None
    turns: Annotated[Whole, Field(ge=1, le=72)] = 8
    frame: Name | None = None


class ApproachSpec(Strict):
    """Anywhere to `distance`, m, before a pose, and from there straight `along` an axis of its frame.

    The pose is one of several (`any_of`), any of the `grasps` of an object, or of a `region` that is bounded along its
    axes. `blend` is as of a line.
    """

    pose: PoseGoalSpec | None = None
    any_of: Annotated[tuple[PoseGoalSpec, ...], Field(min_length=1)] | None = None
    grasps: GraspsSpec | None = None
    region: RegionSpec | None = None
    distance: Length
    along: Direction = (0.0, 0.0, 1.0)
    speed: Length | None = None
    via: Annotated[tuple[ViaSpec, ...], AfterValidator(timed)] = ()
    blend: Length | None = None
    rides: Name | None = None
    group: Name | None = None

    @model_validator(mode="before")
    @classmethod
    def _poses_only(cls, said: Any) -> Any:
        """Say what leads to ends that are no poses: where a line along the tool would begin is not known of them."""
        several = said.get("any_of") if isinstance(said, Mapping) else None
        for one in (said, *(several if isinstance(several, list | tuple) else ())):
            for kind in sorted(set(ENDS) - {"pose"} - ({"region"} if one is said else set())):
                if isinstance(one, Mapping) and kind in one:
                    expected = (
                        "pose, any_of poses, grasps or region, to which a line leads "
                        "(elsewhere: a move, and a line by a vector)"
                    )
                    raise ValueError(f"found {kind}; expected {expected}")
        return said

    @model_validator(mode="after")
    def _one_end(self) -> Self:
        exactly_one(self, ("pose", "any_of", "grasps", "region"))
        return self


class RetreatSpec(Strict):
    """The tool straight by `distance`, m, `along` an axis of the tool, the world or what moves (`in`).

    Without `along` it goes back along z of the tool, and up along z of the world or of what moves. `blend` is as of a
    line.
    """

    distance: Length
    along: Direction | None = None
    in_: Annotated[Name, Field(alias="in")] = TOOL
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

    @model_validator(mode="after")
    def _possible(self) -> Self:
        check_weight(self.mass, self.centre, self.inertia)
        return self


class DetachSpec(Strict):
    """What is held becomes an obstacle where it is."""

    object: Name


class OfGroup(Strict):
    """A group of joints."""

    group: Name


class GripperSpec(ConfigurationSpec, OfGroup):
    """Joints of a `group` move to `joints`, rad or m, to `joints_deg`, or to their values in a named configuration."""

    @model_validator(mode="after")
    def _one_end(self) -> Self:
        exactly_one(self, CONFIGURATIONS)
        return self


Option = Annotated[tuple[Annotated[Whole, Field(ge=0)], ...], Field(min_length=2, max_length=2)]
"""A choice and one of its alternatives, both from 0: where `either` is written out."""


class TaskStepSpec(Strict):
    """One step of a task: one of the keys from `move` to `wait_until`, and what holds during this step.

    `allowed_collisions` of an approach are for its line alone. With `arm`, the steps of each arm follow each other,
    beside those of other arms; `wait_for` names steps of others that are done before.
    """

    written_out: ClassVar = ("pick", "place", "for", "do", "either")

    move: MoveSpec | None = None
    line: StraightLineSpec | None = None
    approach: ApproachSpec | None = None
    retreat: RetreatSpec | None = None
    attach: AttachSpec | None = None
    detach: DetachSpec | None = None
    gripper: GripperSpec | None = None
    dwell: Length | None = None
    tour: TourSpec | None = None
    tool: Name | None = None
    path: SeamSpec | None = None
    wait_until: Name | None = None
    option: Option | None = None
    name: Name | None = None
    arm: Name | None = None
    wait_for: Annotated[tuple[Name, ...] | None, BeforeValidator(listed, json_schema_input_type=str | list[str])] = None
    allowed_collisions: tuple[NamePair, ...] = ()
    path_constraints: tuple[PathConstraintSpec, ...] = ()

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        exactly_one(self, STEP_KINDS)
        return self

    @property
    def kind(self) -> str:
        """The key of what is done."""
        return next(kind for kind in STEP_KINDS if getattr(self, kind) is not None)


STEP_KINDS = (
    *("move", "line", "approach", "retreat", "attach", "detach", "gripper", "dwell", "tour", "tool", "path"),
    "wait_until",
)
"""What a step of a task can be."""
