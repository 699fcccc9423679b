"""The schema of a tool path in a problem file: points, the curve through them, its speed, and the tool's axis."""

from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from optiplan.config.document import Strict
from optiplan.config.values import Coordinate, Direction, FileName, Fraction, Length, Name, NotNegative, Vector, listed
from optiplan.geometry.pose import PoseSpec, ToleranceSpec
from optiplan.problem.schema.ends import exactly_one
from optiplan.problem.schema.tour import Axis
from optiplan.problem.seams.coverage import CoverSpec

Tilt = Annotated[Coordinate, Field(gt=-1.4, lt=1.4)]
"""An angle well below a right one, rad."""

Cone = Annotated[Length, Field(lt=1.4)]
"""Half of the opening of a cone, rad."""


class SeamPointSpec(PoseSpec):
    """A point of the path, with the `axis` along which the tool's z axis points there, or a rotation, or neither.

    `through`: the way to this point is the arc from the point before through that one.
    """

    position: Vector
    axis: Direction | None = None
    through: Vector | None = None

    @model_validator(mode="after")
    def _one_direction(self) -> Self:
        if self.axis is not None and (self.rpy is not None or self.quaternion is not None):
            raise ValueError("found both an axis and a rotation; expected at most one of them")
        return self


class SeamEventSpec(Strict):
    """`do` names what happens when the tool passes the length `path`, m, without a stop."""

    path: NotNegative
    do: Name


class WeaveSpec(Strict):
    """The tool swings sideways by `amplitude`, m, once to and fro every `length`, m, of the path."""

    amplitude: Length
    length: Length

    @model_validator(mode="after")
    def _no_wider_than_long(self) -> Self:
        if self.amplitude > self.length:
            found = f"an amplitude of {self.amplitude:g} m with a length of {self.length:g} m"
            raise ValueError(f"found {found}; expected an amplitude of at most the length of a swing")
        return self


class SeamSpec(Strict):
    """The tool follows a path through `points`, a list or a CSV file, at a constant `speed`, m/s, that is held.

    Or they `cover` a patch of a surface, in one smooth curve.
    `curve`: straight and round parts (`line`), or one smooth `spline` through all points. In a corner of straight parts
    the tool leaves them within `blend`, m; without it the corner is exact, the tool stops there, and is slower than
    `speed` within `ramp`, m, of it. The speed is held within a share `speed_within` from the first point to the last;
    with a `ramp` but within it of both ends, where the tool then begins and ends at rest.
    The tool's z axis points along `axis`, or along the axes of the points, and may turn about it; a rotation of points
    fixes that turn unless `free_axis: z`. It may tilt within `cone`, rad. `lead` turns it ahead, `side` to the left,
    rad. `at`: events on the way.
    """

    points: FileName | Annotated[tuple[SeamPointSpec, ...], Field(min_length=2)] | None = None
    cover: CoverSpec | None = None
    curve: Literal["line", "spline"] = "line"
    blend: Length | None = None
    ramp: NotNegative = 0.0
    speed: Length
    speed_within: Annotated[Fraction, Field(lt=1.0)] = 0.01
    axis: Direction | None = None
    free_axis: Axis | None = None
    cone: Cone | None = None
    lead: Tilt = 0.0
    side: Tilt = 0.0
    weave: WeaveSpec | None = None
    at: Annotated[
        tuple[SeamEventSpec, ...],
        BeforeValidator(listed, json_schema_input_type=SeamEventSpec | tuple[SeamEventSpec, ...]),
    ] = ()
    tolerance: ToleranceSpec = ToleranceSpec(position=5e-4, orientation=1e-2)
    frame: Name | None = None
    group: Name | None = None

    @model_validator(mode="after")
    def _sensible(self) -> Self:
        exactly_one(self, ("points", "cover"))
        if self.free_axis not in (None, "z"):
            raise ValueError(f"found free_axis {self.free_axis}; expected z, the axis of a path's tool")
        if self.cover is not None and (beside := {"blend", "curve"} & self.model_fields_set):
            raise ValueError(f"found {min(beside)} beside cover, whose path is one spline; expected it with points")
        if self.curve == "spline" and self.blend is not None:
            raise ValueError("found blend of a spline, which has no corners; expected it with `curve: line`")
        return self


POINT_COLUMNS = {
    "position": ("x", "y", "z"),
    "axis": ("nx", "ny", "nz"),
    "quaternion": ("qx", "qy", "qz", "qw"),
    "through": ("via_x", "via_y", "via_z"),
}
"""Columns of a CSV file of points, by the key whose values they hold; those of `position` are required."""
