"""The path constraint that keeps a robot from tipping over."""

from functools import cached_property
from typing import Annotated, Any, ClassVar

from pydantic import Field

from optiplan.arrays import Array
from optiplan.config.document import Number
from optiplan.config.values import Coordinate, NotNegative
from optiplan.geometry.support_polygon import SupportPolygon
from optiplan.problem.constraints.base import WHOLE, During, Key, Statement, array
from optiplan.records import dataclass

Corner = Annotated[tuple[Coordinate, Coordinate], Field()]


@dataclass(frozen=True, eq=False)
class TipOver(Statement):
    """The zero-moment point stays inside the polygon on which the robot stands, by a margin.

    With the wrench w of the ground on the base, every edge has R_i w = (n_i · p - offset_i - margin) F_z >= 0: see
    `SupportPolygon.rows`. Together they also say F_z >= 0. The base weighs what its robot file says.

    Attributes:
        corners: (k, 2) x and y in the world, m; their convex hull is the polygon.
        height: z of the ground in the world, m.
        margin: m.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "tip_over"

    corners: Annotated[Array, Key(Annotated[tuple[Corner, ...], Field(min_length=3, max_length=64)], array, list)]
    height: Annotated[float, Key(Number, default=0.0)] = 0.0
    margin: Annotated[float, Key(NotNegative, default=0.0)] = 0.0
    during: During = WHOLE

    @classmethod
    def consistent(cls, stated: Any) -> Any:
        """Return the data of a file, if the corners span an area that the margin leaves something of."""
        polygon = SupportPolygon.of(stated.corners, stated.height)
        if 2.0 * polygon.area <= stated.margin * polygon.perimeter:
            found = f"a margin of {stated.margin:g} m, which leaves nothing of the polygon"
            raise ValueError(f"found {found}; expected a smaller margin, or corners farther apart")
        return stated

    @cached_property
    def polygon(self) -> SupportPolygon:
        """The polygon.

        Raises:
            ValueError: corners on one line.
        """
        return SupportPolygon.of(self.corners, self.height)
