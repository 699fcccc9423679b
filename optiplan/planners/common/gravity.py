"""Joint torques: can the motors hold the arm?"""

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.robot.robot import Robot

_RESERVE = 1e-3  # share of the limit kept free for what happens between samples


class Gravity:
    """Can the motors hold the arm still? The limits (n,) are in N·m or N; one object a thread."""

    def __init__(self, robot: Robot, limit: Array, reserve: float = _RESERVE) -> None:
        self.joint_names, self.limit, self._allowed = robot.joint_names, limit, limit * (1.0 - reserve)
        self._model, self._data = robot.model, robot.model.createData()
        self._limited = bool(np.isfinite(limit).any())

    def too_much(self, q: Array) -> bool:
        """Whether holding the arm at q (n,) takes more than the limits, less the reserve (a share of them)."""
        return self._limited and bool((self.torque(q) > self._allowed).any())

    def torque(self, q: Array) -> Array:
        """|g(q)|, (n,), at q (n,)."""
        torque: Array = np.abs(pin.computeGeneralizedGravity(self._model, self._data, q))
        return torque
