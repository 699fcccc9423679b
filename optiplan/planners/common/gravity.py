"""Gravity torques against the torque limits."""

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.robot.robot import Robot

_RESERVE = 1e-3  # share of the limit reserved for the motion between samples


class Gravity:
    """Compare the gravity torques with the limits (n,), N·m or N; one object per thread.

    Attributes:
        allowed: the limits (n,), less the reserve; None where no joint has one.
    """

    def __init__(self, robot: Robot, limit: Array, reserve: float = _RESERVE) -> None:
        self.joint_names, self.limit = robot.joint_names, limit
        self.allowed: Array | None = limit * (1.0 - reserve) if np.isfinite(limit).any() else None
        self._model, self._data = robot.model, robot.model.createData()

    def too_much(self, q: Array) -> bool:
        """Return whether |g(q)| at q (n,) exceeds the limits, less the reserve (a share of them)."""
        return self.allowed is not None and bool((self.torque(q) > self.allowed).any())

    def torque(self, q: Array) -> Array:
        """Return |g(q)|, (n,), at q (n,)."""
        torque: Array = np.abs(pin.computeGeneralizedGravity(self._model, self._data, q))
        return torque
