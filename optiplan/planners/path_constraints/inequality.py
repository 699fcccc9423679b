"""Inequalities of the robot's state that hold a constraint: CasADi expressions, and clearances of named pairs."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from optiplan.arrays import Array
from optiplan.problem.problem import Problem
from optiplan.robot.robot import Limits, Robot

if TYPE_CHECKING:
    from optiplan.kinematics.symbolic.state import SymbolicState
    from optiplan.problem.constraints.motions import PairClearance


KEPT = 0.6
"""Share of g, or of a clearance, at an end of a motion that is the aim near this end, if that is below the reserve."""

_SLOWEST, _CLOSE = 100.0, 1e-3
"""Largest factor on a duration, and relative precision of the least one."""

_FAR = 0.01
"""Distance beyond the required clearance, m, from which pairs are ignored."""

_DAMPING = 1e-9
"""Of the squares of rows' slopes, so that redundant rows do no harm."""

_LONGEST = 0.3
"""rad or m, of a joint in one step of a projection."""

Rate = Literal[0, 1, 2]


class Inequality(NamedTuple):
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
    build: "Callable[[SymbolicState], Any]"
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
        from optiplan.kinematics.symbolic.state import BatchedExpression

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


class PairsApart:
    """The inequality d >= at_least of a few pairs.

    Attributes:
        wanted: the pairs and their least distance.
        model: measures the distances.
        depends_on_rates: False.
    """

    depends_on_rates = False

    def __init__(self, problem: Problem, wanted: "PairClearance") -> None:
        from optiplan.collision.named_pairs import NamedPairs

        self.wanted = wanted
        self.model = NamedPairs(problem.robot, problem.scene, wanted.pairs)

    def least(self, motion: Sequence[Array]) -> Array:
        """Return the least clearance beyond the required one, m, of each state (N, n): (N,), at most 1 cm."""
        found = self.model.near(motion[0], self.wanted.at_least + _FAR)
        least = np.full(len(motion[0]), _FAR)
        np.minimum.at(least, found.rows, found.distance - self.wanted.at_least)
        return least

    def slower(self, motion: Sequence[Array]) -> float:
        """Return 1: no clearance grows with time."""
        return 1.0


class RowsAtRest:
    """The rows of several inequalities at a configuration at rest."""

    def __init__(self, robot: Robot, inequalities: Sequence[CompiledInequality]) -> None:
        self._inequalities, self._still = inequalities, np.zeros((1, robot.n))

    def __call__(self, q: Array) -> tuple[Array, Array]:
        """Return g (m,) and its slopes (m, n) at q (n,)."""
        motion = [np.ascontiguousarray(q)[None], self._still, self._still]
        found = [one(motion) for one in self._inequalities]
        if not found:
            return np.zeros(0), np.zeros((0, len(q)))
        return np.concatenate([value[0] for value, _ in found]), np.vstack([slopes[0][0] for _, slopes in found])


def shortest_step(J: Array, e: Array) -> Array:
    """Return the shortest step d (n,) with J d = e, damped: J^T (J J^T + damping)^-1 e."""
    A = J @ J.T
    A.flat[:: len(e) + 1] += _DAMPING * max(float(np.trace(A)), 1e-12)
    return np.asarray(J.T @ np.linalg.solve(A, e))


def stepped(q: Array, step: Array, limits: Limits) -> Array:
    """Return q (n,) after a step, shortened to at most 0.3 rad or m of a joint, within the position limits."""
    largest = float(np.abs(step).max())
    return np.clip(q + step * min(1.0, _LONGEST / max(largest, 1e-12)), limits.lower, limits.upper)
