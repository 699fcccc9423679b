"""The schema of starts, goals and via points in a problem file."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator

from optiplan.config.built_later import BuiltLater
from optiplan.config.document import Strict
from optiplan.config.values import ExactlyOne, JointValues, Length, Name, Vector
from optiplan.geometry.pose import PoseGoalSpec, PoseSpec, ToleranceSpec
from optiplan.problem.regions.schema import RegionSpec

CONFIGURATIONS = ("joints", "joints_deg", "configuration")
"""How a configuration can be said."""

RATES = ("velocity", "acceleration")
"""What an end has beside where it is."""

_NAMED = f"{', '.join(CONFIGURATIONS[:-1])} or {CONFIGURATIONS[-1]}"


class ConfigurationSpec(Strict):
    """`joints`, in the robot's order, rad or m; `joints_deg`; or `configuration`, a name in the robot file."""

    joints: JointValues | None = None
    joints_deg: JointValues | None = None
    configuration: Name | None = None

    @property
    def way(self) -> str:
        """The one of `CONFIGURATIONS` that is there."""
        return next(key for key in CONFIGURATIONS if getattr(self, key) is not None)


class StartSpec(ConfigurationSpec, ExactlyOne):
    """`joints`: one value per planned joint, or `joints_deg`; or `configuration`: a name in the robot file.

    In `joints_deg` turning joints are in degrees, sliding ones in m.
    `velocity` (rad/s or m/s) and `acceleration` (rad/s² or m/s²), one value per planned joint: at rest without them.
    """

    BESIDE: ClassVar[frozenset[str]] = frozenset(RATES)

    velocity: JointValues | None = None
    acceleration: JointValues | None = None

    @model_validator(mode="after")
    def _state(self) -> Self:
        for key in RATES:
            if self.rates(key) is not None and self.kind not in CONFIGURATIONS:
                raise ValueError(f"found {key} with {self.kind}; expected it with {_NAMED} only")
        return self

    def rates(self, key: str) -> tuple[float, ...] | None:
        """Return one of `RATES`; None at rest, which zeros say as nothing does."""
        said: tuple[float, ...] | None = getattr(self, key)
        return said if said and any(said) else None


class PlacedFrameSpec(Strict):
    """Where one of several frames is at the end: in a `pose` or a `region`; `frame` may stand here or in that."""

    frame: Name | None = None
    pose: PoseGoalSpec | None = None
    region: RegionSpec | None = None

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        exactly_one(self, ("pose", "region"))
        own = self.pose or self.region
        if self.frame is not None and own is not None and own.frame not in (None, self.frame):
            raise ValueError(f"found frame {self.frame} and frame {own.frame}; expected one of them")
        return self


class AlternativeSpec(StartSpec):
    """One end of the motion; `all_of` holds several frames in their places at once."""

    pose: PoseGoalSpec | None = None
    region: Annotated[RegionSpec | None, BuiltLater()] = None
    all_of: Annotated[Annotated[tuple[PlacedFrameSpec, ...], Field(min_length=2)] | None, BuiltLater()] = None


class GoalSpec(AlternativeSpec):
    """One end of the motion, or `any_of` several."""

    any_of: Annotated[Annotated[tuple[AlternativeSpec, ...], Field(min_length=1)] | None, BuiltLater()] = None


def exactly_one(spec: Strict, keys: Sequence[str]) -> None:
    """Require one of these keys, and not two of them.

    Raises:
        ValueError: what was found and expected.
    """
    given = [key for key in keys if getattr(spec, key) is not None]
    if len(given) != 1:
        raise ValueError(f"found {' and '.join(given) or 'none of them'}; expected exactly one of: {', '.join(keys)}")


class ViaPoseSpec(PoseSpec):
    """The pose of `frame` (default: the robot's tool frame) in the world, to be passed within `tolerance`."""

    frame: Name | None = None
    position: Vector
    tolerance: ToleranceSpec | None = None


class ViaSpec(ConfigurationSpec):
    """A point to be passed between start and goal.

    `tolerance` is of each joint or of both parts of a pose, rad or m; `velocity` (rad/s or m/s, one value per planned
    joint) and `time` (s from the start) are wishes, which the planner `spline` can grant.
    """

    pose: ViaPoseSpec | None = None
    tolerance: Length | None = None
    velocity: JointValues | None = None
    time: Length | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        exactly_one(self, (*CONFIGURATIONS, "pose"))
        if self.pose is not None and self.pose.tolerance is not None and self.tolerance is not None:
            raise ValueError("found a tolerance of the via and one of its pose; expected at most one of them")
        return self


def timed(vias: tuple[ViaSpec, ...]) -> tuple[ViaSpec, ...]:
    """Require times at all vias or at none, increasing."""
    times = [via.time for via in vias if via.time is not None]
    if times and len(times) != len(vias):
        raise ValueError(f"found a time at {len(times)} of {len(vias)} vias; expected one at each, or at none")
    for before, after in pairwise(times):
        if after <= before:
            raise ValueError(f"found time {after:g} after time {before:g}; expected increasing times")
    return vias


ENDS = (*CONFIGURATIONS, "pose", "region", "all_of")
"""What one end of a motion can be."""
