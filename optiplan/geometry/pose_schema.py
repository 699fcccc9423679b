"""The schema of poses and their tolerances in a problem file."""

from typing import Annotated, Any, Self

from pydantic import AfterValidator, model_validator

from optiplan.config.document import Strict
from optiplan.config.values import Length, Quaternion, Vector
from optiplan.geometry.poses import check_angles, in_radians


def _angles(values: tuple[float, ...]) -> tuple[float, ...]:
    check_angles(values)
    return values


Angles = Annotated[Vector, AfterValidator(_angles)]
"""Roll, pitch and yaw, rad, each within a turn."""


class PoseSpec(Strict):
    """`position`, m, and `rpy` about fixed axes, rad, `rpy_deg` or `quaternion` [x, y, z, w]; none is the identity.

    What is read from `rpy_deg` stands in `rpy`.
    """

    position: Vector = (0.0, 0.0, 0.0)
    rpy: Angles | None = None
    rpy_deg: Vector | None = None
    quaternion: Quaternion | None = None

    @model_validator(mode="before")
    @classmethod
    def _radians(cls, data: Any) -> Any:
        return in_radians(data)

    @model_validator(mode="after")
    def _one_rotation(self) -> Self:
        if self.rpy is not None and self.quaternion is not None:
            raise ValueError("found both rpy and quaternion; expected at most one of them")
        return self


class ToleranceSpec(Strict):
    """Tolerance of a pose: `position` in m, `orientation` in rad."""

    position: Length = 1e-4
    orientation: Length = 1e-3
