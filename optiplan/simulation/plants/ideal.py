"""The ideal plant: it moves with exactly the velocity it is told."""

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.simulation.plants.base import Plant


class IdealPlant(Plant):
    """q' = v of the command; a step of the command is a step of the velocity."""

    input = "velocity"

    def __init__(self, q: Array, step: float) -> None:
        self.step = step
        self.q, self.v = np.array(q, float), np.zeros(len(q))

    def holding(self) -> Array:
        """No velocity."""
        return np.zeros(len(self.q))

    def advance(self, command: Array, steps: int, wrench: pin.Force | None = None) -> Array:
        """Move with the velocity `command`; nothing disturbs it."""
        self.v = np.array(command, float)
        self.q = self.q + steps * self.step * self.v
        return self.v
