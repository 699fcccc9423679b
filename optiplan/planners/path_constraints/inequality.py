"""Inequalities of the robot's state that hold a constraint, as CasADi expressions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from optiplan.arrays import Array
from optiplan.kinematics.symbolic.state import BatchedExpression, SymbolicState
from optiplan.robot.robot import Robot

KEPT = 0.6
"""Share of g, or of a clearance, at an end of a motion that is the aim near this end, if that is below the reserve."""

_SLOWEST, _CLOSE = 100.0, 1e-3
"""Largest factor on a duration, and relative precision of the least one."""

Rate = Literal[0, 1, 2]


@dataclass(frozen=True, eq=False)
class Inequality:
    """Rows g(q, v, a) >= 0 that hold a constraint, as an expression, and what a violation of them means.

    Attributes:
        name: of the constraint, for people.
        build: makes the expression (m,), from the robot's state.
        unit: of g: a violation by it weighs as much as a missing centimetre of clearance.
        reserve: what a planner keeps of g between samples, where both ends have it.
        rate: 1 or 2 where g = (1 - r²) / 2 with a speed or an acceleration r, as a share of its limit. A motion that is
            slow enough holds such a constraint.
        during: fractions of the motion.
        finite: raises where values (N, m) or derivatives (N, m, n) at configurations (N, n) are not finite.
    """

    name: str
    build: Callable[[SymbolicState], Any]
    unit: float
    reserve: float
    rate: Rate = 0
    during: tuple[float, float] = (0.0, 1.0)
    finite: Callable[[Array, list[Array], str, Array], None] | None = None


class CompiledInequality:
    """One inequality of one robot, for many states in one call.

    Attributes:
        stated: the inequality.
        size: its number of rows, m.
        depends_on_rates: whether g depends on velocities or accelerations.
    """

    def __init__(self, robot: Robot, stated: Inequality) -> None:
        self.stated = stated
        self._expression = BatchedExpression(robot, "inequality", stated.build)
        self.size = self._expression.size
        self.depends_on_rates = bool({1, 2} & set(self._expression.orders))

    def __call__(self, motion: Sequence[Array]) -> tuple[Array, list[Array]]:
        """Return g (N, m) of states (N, n) of each of q, v, a, and its derivatives (N, m, n) by these."""
        return self._expression(motion)

    def checked(self, motion: Sequence[Array]) -> tuple[Array, list[Array]]:
        """Return the same.

        Raises:
            InputError: one of them is not finite, where the inequality looks for that.
        """
        value, slopes = self._expression(motion)
        if self.stated.finite is not None:
            self.stated.finite(value, slopes, "a sample", motion[0])
        return value, slopes

    def least(self, motion: Sequence[Array]) -> Array:
        """Return the least g of each state (N, n): (N,)."""
        return np.asarray(self.checked(motion)[0].min(axis=1))

    def slower(self, motion: Sequence[Array]) -> float:
        """Return the factor on the duration, 1 at least, at which a motion (N, n) holds g; 1 where no time helps.

        Of a rate as a share of its limit it is known; else it is found by bisection.
        """
        if not self.depends_on_rates:
            return 1.0
        least, rate = float(self.least(motion).min()), self.stated.rate
        if rate:
            return float(max(1.0, np.sqrt(max(1.0 - 2.0 * least, 0.0)) ** (1.0 / rate)))
        slowest = self._least_at(motion, _SLOWEST)
        if least >= 0.0 or slowest < 0.0:
            return 1.0
        wanted, low, high = min(KEPT * self.stated.reserve, KEPT * slowest), 1.0, _SLOWEST
        while high > low * (1.0 + _CLOSE):
            middle = float(np.sqrt(low * high))
            low, high = (low, middle) if self._least_at(motion, middle) >= wanted else (middle, high)
        return high

    def _least_at(self, motion: Sequence[Array], factor: float) -> float:
        """Return the least g along a motion that takes so many times as long."""
        q, v, a = motion
        return float(self.least([q, v / factor, a / factor**2]).min())
