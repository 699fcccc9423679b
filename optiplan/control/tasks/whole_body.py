"""Tasks of the whole arm: centre of mass, manipulability."""

from typing import ClassVar

import numpy as np

from optiplan.arrays import Array
from optiplan.control.arguments import checked_number, checked_vector, frame_index, robot_with_masses
from optiplan.control.configuration import Configuration
from optiplan.control.tasks.base import ControlTask, Weight
from optiplan.errors import choice_argument
from optiplan.kinematics.manipulability import (
    ROWS,
    JacobianRows,
    ToolKinematics,
    manipulability_measures,
    measure_gradients,
    scaled,
)
from optiplan.robot.robot import Robot


class CentreOfMassTask(ControlTask):
    """The robot's centre of mass at a point: e = c - target, metres along the axes of the world.

    Args:
        target: [x, y, z], m; None: where it is in the first step.
        cost: per metre, one or three; [1, 1, 0] leaves the height free.
        gain: 1/s.
        priority: see `ControlTask`.
    """

    name: ClassVar[str] = "centre of mass"
    components = ("x", "y", "z")

    def __init__(self, target: object = None, cost: Weight = 1.0, gain: float = 5.0, priority: int = 0) -> None:
        super().__init__(3, cost, gain, priority)
        self._target: Array | None = None
        if target is not None:
            self.target = target

    @property
    def target(self) -> Array | None:
        """(3,), m."""
        return self._target

    @target.setter
    def target(self, value: object) -> None:
        self._target = checked_vector(self, "target", value, 3)

    def bind(self, robot: Robot) -> None:
        """Ask whether the robot has masses."""
        robot_with_masses(self, robot)

    def error(self, c: Configuration) -> Array:
        """(3,), m."""
        return self.evaluate(c)[0]

    def jacobian(self, c: Configuration) -> Array:
        """(3, n)."""
        return self.evaluate(c)[1]

    def evaluate(self, c: Configuration) -> tuple[Array, Array]:
        """Error and Jacobian."""
        centre, J = c.centre_of_mass()
        if self._target is None:
            self._target = centre
        return centre - self._target, J


class ManipulabilityTask(ControlTask):
    """A frame's manipulability at least as large as given: e = min(0, m(q) - at_least), J the gradient of m.

    m is the product of the singular values of the Jacobian (Yoshikawa). Far from singularities the task is silent.

    Args:
        at_least: of m, in the units of the Jacobian.
        frame: its name; None: the robot's tool frame.
        part: rows of the Jacobian that are measured.
        cost: per unit of m.
        gain: 1/s.
        priority: see `ControlTask`.
    """

    name: ClassVar[str] = "manipulability"

    def __init__(
        self,
        at_least: float,
        frame: str | None = None,
        part: JacobianRows = "full",
        cost: Weight = 1.0,
        gain: float = 2.0,
        priority: int = 0,
    ) -> None:
        super().__init__(1, cost, gain, priority)
        self.at_least = checked_number(self, "at_least", at_least, 0.0)
        choice_argument("ManipulabilityTask", "part", part, ROWS)
        self.frame, self.part = frame, part

    def bind(self, robot: Robot) -> None:
        """Find the frame."""
        name = robot.tool_frame if self.frame is None else self.frame
        frame_index(self, "frame", robot, name)
        self._kinematics = ToolKinematics(robot, name)

    def error(self, c: Configuration) -> Array:
        """(1,)."""
        J = scaled(self._kinematics.evaluate(c.q[None])[1], self.part)
        return np.minimum(manipulability_measures(J).yoshikawa - self.at_least, 0.0)

    def jacobian(self, c: Configuration) -> Array:
        """(1, n)."""
        Q = c.q[None]
        J = scaled(self._kinematics.evaluate(Q)[1], self.part)
        if manipulability_measures(J).yoshikawa[0] >= self.at_least:
            return np.zeros((1, len(c.q)))
        return measure_gradients(J, self._kinematics.hessians(Q)[:, ROWS[self.part]]).yoshikawa
