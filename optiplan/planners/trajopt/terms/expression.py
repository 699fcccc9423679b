"""Terms whose rows are CasADi expressions of the state."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.kinematics.symbolic.state import BatchedExpression, SymbolicState
from optiplan.planners.trajopt.terms.term import Curve, Instants, SoftRows, within
from optiplan.robot.robot import Robot

PRICE = 0.5
"""Price of a violation by one unit at one sample."""

KEPT = 0.6
"""Share of the room at an end that is aimed at near this end, where there is less than the reserve."""

Rate = Literal[0, 1, 2]


@dataclass(frozen=True, eq=False)
class Room:
    """Rows g(q, v, a) >= 0 that hold a constraint, as an expression, and what a violation of them means.

    Attributes:
        name: of the constraint, for people.
        build: makes the expression (m,), from the robot's state.
        unit: of g, in which a violation costs `PRICE`.
        reserve: what the optimiser keeps of g between samples, where both ends have it.
        rate: 1 or 2 where g = (1 - r²) / 2 with a speed or an acceleration r, as a share of its limit: such a
            constraint is always held by a motion that is slow enough.
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


class ExpressionTerm:
    """The rows of one `Room`, of all samples in one call. Holds at: samples."""

    decides = False

    def __init__(self, robot: Robot, room: Room) -> None:
        self.room, self.name, self.unit, self.price = room, room.name, room.unit, PRICE
        self.negligible = max(room.reserve, 1e-6 * room.unit)
        self.expression = BatchedExpression(robot, "room", room.build)
        self._inside: Index = np.zeros(0, dtype=np.intp)

    def begin(self, samples: Instants) -> None:
        """Take the samples in the constraint's part of the motion."""
        self._inside = np.flatnonzero(within(samples.u, self.room.during))

    def rows(self, curve: Curve) -> SoftRows:
        """Return the rows g - reserve >= 0 of all samples."""
        u, size = curve.samples.u[self._inside], self.expression.size
        motion = [part[self._inside] for part in curve.motion]
        value, slopes = self.expression(motion)
        if self.room.finite is not None:
            self.room.finite(value, slopes, "a sample", motion[0])
        value = value - self._reserve(curve, u)
        sample = np.repeat(self._inside, size)
        by_q, by_v, by_a = (slope.reshape(len(sample), -1) for slope in slopes)
        return curve.rows(sample, value.ravel(), (by_q, by_v, by_a))

    def _reserve(self, curve: Curve, u: Array) -> Array:
        """Return the reserve at fractions u (N,) of the duration, no more than the ends have: (N, m)."""
        ends = curve.control[[0, -1]]
        still = np.zeros_like(ends)
        room, _ = self.expression([ends, still, still])
        between = (1.0 - u)[:, None] * room[0] + u[:, None] * room[1]
        return np.asarray(np.clip(KEPT * between, 0.0, self.room.reserve))

    def watch(self, rows: SoftRows) -> bool:
        """Return False: all samples have rows."""
        return False

    def least(self, motion: Sequence[Array]) -> Array:
        """Return the least g of each state (N, n): (N,)."""
        value, slopes = self.expression(motion)
        if self.room.finite is not None:
            self.room.finite(value, slopes, "a sample", motion[0])
        return np.asarray(value.min(axis=1))

    def slower(self, least: float) -> float:
        """Return the factor on the duration at which a motion with this least g holds a constraint of rates."""
        return float(np.sqrt(max(1.0 - 2.0 * least, 0.0)) ** (1.0 / self.room.rate)) if self.room.rate else 1.0
