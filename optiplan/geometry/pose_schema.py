"""The schema of poses and their tolerances in a problem file."""

from typing import Self

from pydantic import model_validator

from optiplan.config.document import Strict
from optiplan.config.values import Length, Quaternion, Vector


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


class ToleranceSpec(Strict):
    """Tolerance of a pose: `position` in m, `orientation` in rad."""

    position: Length = 1e-4
    orientation: Length = 1e-3
