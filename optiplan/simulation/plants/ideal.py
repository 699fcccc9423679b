"""The ideal plant: it moves with exactly the velocity it is told."""

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.simulation.plants.base import Input


class IdealPlant:
    """q' = v of the command; a step of the command is a step of the velocity.

    Attributes:
        step: s.
    """

    input: Input = "velocity"

    def __init__(self, q: Array, step: float) -> None:
        self.step = step
        self._q, self._v = np.array(q, float), np.zeros(len(q))

    @property
    def q(self) -> Array:
        """Positions (n,), rad or m."""
        return self._q

    @property
    def v(self) -> Array:
        """Velocities (n,)."""
        return self._v

    def holding(self) -> Array:
        """No velocity."""
        return np.zeros(len(self._q))

    def advance(self, command: Array, steps: int, wrench: pin.Force | None = None) -> Array:
        """Move with the velocity `command`; nothing disturbs it."""
        self._v = np.array(command, float)
        self._q = self._q + steps * self.step * self._v
        return self._v

    def contacts(self) -> list[tuple[str, str]]:
        """None: it has no bodies."""
        return []
