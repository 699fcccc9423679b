"""`TorqueLimit`: torques of the joints through the mass matrix."""

from typing import ClassVar

import numpy as np

from optiplan._core import core
from optiplan.control.arguments import positive_vector, robot_with_masses
from optiplan.control.configuration import Configuration
from optiplan.control.limits.row_limit import LimitRows, RowLimit
from optiplan.robot.robot import Robot
from optiplan.trajectory.state import State


class TorqueLimit(RowLimit):
    """|M (v' - v) / dt + h| <= torque, N·m or N: what the motion itself takes, without payload and friction.

    Holds at: the beginning of each step.

    Args:
        torque: (n,) or one number; None: the robot's limits.
    """

    name: ClassVar[str] = "torque"

    def __init__(self, torque: object = None) -> None:
        self._given = torque

    def bind(self, robot: Robot) -> None:
        """Take the robot's own values where none are given."""
        robot_with_masses(self, robot)
        own = robot.limits.torque
        self.torque = own if self._given is None else positive_vector(self, "torque", self._given, robot.n)
        self._labels = tuple(f"torque of {name}" for name in robot.joint_names)

    def rows(self, c: Configuration, state: State, dt: float) -> LimitRows:
        """A row a joint."""
        M, h = c.dynamics()
        if core is not None:
            return core.torque_rows(M, h, state.v, self.torque, dt, self._labels)
        unit = np.maximum(M.diagonal(), 1e-9) / dt
        G = M / (dt * unit[:, None])
        still = h - (M @ state.v) / dt
        return LimitRows(G, (-self.torque - still) / unit, (self.torque - still) / unit, unit, self._labels)
