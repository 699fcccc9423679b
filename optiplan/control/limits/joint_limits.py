"""Limits of single joints: position, velocity, acceleration, jerk; together they bound the velocity of each joint."""

from typing import ClassVar

import numpy as np

from optiplan.arrays import Array
from optiplan.control.arguments import positive_vector, spread_vector
from optiplan.control.limits.base import ControlLimit
from optiplan.errors import wrong_argument
from optiplan.robot.robot import Robot


class JointLimit(ControlLimit):
    """A bound (n,) of one derivative of the positions.

    Attributes:
        values: (n,).
    """

    order: ClassVar[int] = 0

    def __init__(self, values: object = None) -> None:
        self._given = values
        self.values: Array = np.zeros(0)

    def bind(self, robot: Robot) -> None:
        """Take the robot's own values where none are given."""
        own = robot.limits.rates[self.order - 1]
        self.values = own if self._given is None else positive_vector(self, self.name, self._given, robot.n)


class VelocityLimit(JointLimit):
    """|v| <= velocity, rad/s or m/s, kept in time: the acceleration can still be turned back within its jerk limit.

    Args:
        velocity: (n,) or one number; None: the robot's limits.
    """

    name: ClassVar[str] = "velocity"
    order: ClassVar[int] = 1

    def __init__(self, velocity: object = None) -> None:
        super().__init__(velocity)


class AccelerationLimit(JointLimit):
    """|v' - v| <= dt · acceleration, rad/s² or m/s².

    Args:
        acceleration: (n,) or one number; None: the robot's limits.
    """

    name: ClassVar[str] = "acceleration"
    order: ClassVar[int] = 2

    def __init__(self, acceleration: object = None) -> None:
        super().__init__(acceleration)


class JerkLimit(JointLimit):
    """|a' - a| <= dt · jerk, rad/s³ or m/s³.

    Args:
        jerk: (n,) or one number; None: the robot's limits.
    """

    name: ClassVar[str] = "jerk"
    order: ClassVar[int] = 3

    def __init__(self, jerk: object = None) -> None:
        super().__init__(jerk)


class PositionLimit(ControlLimit):
    """lower <= q <= upper, rad or m, with the braking distance: a joint can stop before its end at any time.

    Holds at: every step, and beyond, whatever becomes of the tasks: see `control.braking`.

    Args:
        lower: (n,) or one number; None: the robot's limits. `upper`: the same.
    """

    name: ClassVar[str] = "position"

    def __init__(self, lower: object = None, upper: object = None) -> None:
        self._given = lower, upper
        self.lower: Array = np.zeros(0)
        self.upper: Array = np.zeros(0)

    def bind(self, robot: Robot) -> None:
        """Take the robot's own values where none are given."""
        own = robot.limits.lower, robot.limits.upper
        ends = [
            default if given is None else self._checked(side, given, robot.n)
            for side, given, default in zip(("lower", "upper"), self._given, own, strict=True)
        ]
        self.lower, self.upper = ends
        wrong = np.flatnonzero(self.lower > self.upper)
        if len(wrong):
            found = f"{self.lower[wrong[0]]:g} with upper {self.upper[wrong[0]]:g}"
            raise wrong_argument("PositionLimit", f"lower[{wrong[0]}]", found, "lower <= upper")

    def _checked(self, side: str, value: object, n: int) -> Array:
        """Numbers (n,) that may be infinite, but not NaN."""
        vector = spread_vector(self, side, value, n, f"{n} numbers")
        if np.isnan(vector).any():
            raise wrong_argument("PositionLimit", side, "NaN", f"{n} numbers")
        return vector
