"""The schema of a tour in a problem file: targets that are visited, in an order that may be free."""

from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from optiplan.config.document import Strict
from optiplan.config.values import Direction, FileName, Length, Name, NotNegative, Vector, listed
from optiplan.geometry.pose import PoseSpec, ToleranceSpec

Axis = Literal["x", "y", "z"]


class TargetSpec(PoseSpec):
    """A pose of the tool, or a `position` with an `axis` along which the tool's z axis points.

    `after` names targets visited before this one, `cluster` a set visited in one go. `window` is the time of the
    arrival, s from the start of the tour: [earliest, latest]; the robot waits for the earliest.
    """

    name: Name | None = None
    position: Vector
    axis: Direction | None = None
    after: Annotated[tuple[Name, ...], BeforeValidator(listed, json_schema_input_type=Name | tuple[Name, ...])] = ()
    cluster: Name | None = None
    window: tuple[NotNegative, NotNegative] | None = None

    @model_validator(mode="after")
    def _sensible(self) -> Self:
        if self.axis is not None and (self.rpy is not None or self.quaternion is not None):
            raise ValueError("found both an axis and a rotation; expected at most one of them")
        if self.window is not None and not self.window[0] <= self.window[1]:
            raise ValueError(f"found the window {list(self.window)}; expected [earliest, latest], s")
        return self


class ProcessSpec(Strict):
    """The robot rests for `dwell`, s; `do` names what is done meanwhile: an event of the motion's files."""

    dwell: Length
    do: Name | None = None


class TourSpec(Strict):
    """The tool visits all `targets` and rests at each: a list, or a CSV file.

    `order` is free, or that of the list (`given`). About `free_axis` of a target the tool may turn as it likes.
    `standoff`, m: it stops so far before the target, back along that axis (z without one). `first` and `last` name
    targets; `closed`: back to the configuration in which the tour began. The `tolerance` is as of a pose. `carried_by`
    is a link of the robot in whose frame the targets are given: that of a positioner, whose joints move with the arm's.
    """

    targets: FileName | Annotated[tuple[TargetSpec, ...], Field(min_length=1)]
    order: Literal["free", "given"] = "free"
    free_axis: Axis | None = None
    standoff: NotNegative = 0.0
    tolerance: ToleranceSpec = ToleranceSpec.model_construct()
    first: Name | None = None
    last: Name | None = None
    closed: bool = False
    at_each: tuple[ProcessSpec, ...] = ()
    frame: Name | None = None
    group: Name | None = None
    carried_by: Name | None = None


TARGET_COLUMNS = {
    "name": ("name",),
    "position": ("x", "y", "z"),
    "axis": ("nx", "ny", "nz"),
    "quaternion": ("qx", "qy", "qz", "qw"),
    "cluster": ("cluster",),
    "after": ("after",),
    "window": ("from", "to"),
}
"""Columns of a CSV file of targets, by the key whose values they hold; those of `position` are required."""
