"""A user's own constraint: a CasADi expression of the robot's state between two bounds."""

import hashlib
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import numpy as np

from optiplan.arrays import Array, is_finite, is_listed
from optiplan.errors import InputError, described, wrong_argument
from optiplan.kinematics.symbolic.state import BatchedExpression, SymbolicState
from optiplan.problem.constraints.base import WHOLE, During, Statement
from optiplan.records import dataclass
from optiplan.robot.robot import Robot
from optiplan.trajectory.state import State

ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Expression(Statement):
    """lower <= f(q, v, a) <= upper, with any f that CasADi can state; held and checked at samples.

    Such a constraint has no place in a file: a problem that has one cannot be saved.

    Attributes:
        name: for reports.
        build: called with the state `k` of the robot (`SymbolicState`): `k.q`, `k.v`, `k.a`, `k.joint(name)`,
            `k.pose(frame).R` and `.p`, `k.twist(frame)`, `k.acceleration(frame)`, `k.torque()`,
            `k.manipulability(frame)`; returns a number or a vector. `tool` is the tool frame.
        lower, upper: of each component.
        during: part of the motion.
        scale: a change of f that matters; None: the distance of the bounds, or the size of the only one.

    Raises:
        InputError: bounds that are no numbers, or none, or the lower above the upper.

    Example:
        >>> import optiplan as op
        >>> op.Expression("level", lambda k: k.pose("tool").R[2, 2], lower=0.98).lower
        0.98
    """

    KEY: ClassVar[str] = "expression"

    name: str
    build: Callable[[SymbolicState], Any]
    lower: float = -np.inf
    upper: float = np.inf
    during: During = WHOLE
    scale: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not callable(self.build):
            found = f"{described(self.name)} and {described(self.build)}"
            raise wrong_argument("Expression", "build", found, "a name, and a function of the robot's state")
        numbers = (self.lower, self.upper, 1.0 if self.scale is None else self.scale)
        for argument, value in zip(("lower", "upper", "scale"), numbers, strict=True):
            if not is_finite(value) and not (isinstance(value, float) and abs(value) == np.inf):
                raise wrong_argument("Expression", argument, described(value), "a number")
        if not (np.isfinite(self.lower) or np.isfinite(self.upper)) or self.lower > self.upper or numbers[2] <= 0.0:
            found = f"[{self.lower:g}, {self.upper:g}] with a scale of {numbers[2]:g}"
            raise wrong_argument("Expression", "lower", found, "lower <= upper, one of them finite, and a scale > 0")
        within = list(self.during) if is_listed(self.during) else []
        if len(within) != 2 or not all(map(is_finite, within)) or not 0.0 <= within[0] < within[1] <= 1.0:
            raise wrong_argument("Expression", "during", described(self.during), "(from, to), 0 <= from < to <= 1")

    @property
    def size(self) -> float:
        """A change of the value that matters."""
        if self.scale is not None:
            return self.scale
        if np.isfinite(self.upper - self.lower) and self.upper > self.lower:
            return self.upper - self.lower
        return max(abs(self.lower if np.isfinite(self.lower) else self.upper), 1e-3)

    def batched(self, robot: Robot) -> BatchedExpression:
        """Return f for many states of a robot.

        Raises:
            InputError: it cannot be built from the state, has no values, or steps somewhere.
        """
        try:
            found = BatchedExpression(robot, "expression", self._built, smooth=True)
        except InputError:
            raise
        except Exception as error:  # whatever a user's function raises
            raise self._wrong(f"a function that fails: {_reason(error)}") from error
        if not found.size:
            raise self._wrong("an expression without values", "at least one value")
        return found

    def _built(self, state: SymbolicState) -> Any:
        """Return what the function makes of the state.

        Raises:
            TypeError: it is nothing that CasADi can take as an expression.
        """
        import casadi

        value = self.build(state)
        try:
            return casadi.SX(value)
        except NotImplementedError:
            raise TypeError(f"it returns {described(value)}, which is no CasADi expression (SX)") from None

    def checked(self, robot: Robot, start: State, goals: Sequence[State] = ()) -> str:
        """Check it at the start, and at goals of which one at least has to hold it; return a digest of what it states.

        Raises:
            InputError: it cannot be built, is not finite at the start, or the start or every goal violates it.
        """
        batched, within = self.batched(robot), f"values in [{self.lower:g}, {self.upper:g}]"
        value, slopes = batched([start.q[None], start.v[None], start.a[None]])
        self.finite(value, slopes, "the start", start.q[None])
        worst = self.violations(value)[0]
        if self.during[0] == 0.0 and worst > ROUNDING:
            raise self._wrong(f"{_number(value[0])} at the start", within)
        if goals and self.during[1] == 1.0:
            value, _ = batched([np.array([getattr(goal, part) for goal in goals]) for part in "qva"])
            if not (self.violations(value) <= ROUNDING).any():
                raise self._wrong(f"{_number(value[0])} at the goal", within)
        bounds = f"{self.name} {self.lower!r} {self.upper!r} {tuple(self.during)!r}"
        return hashlib.sha256((bounds + batched.content).encode()).hexdigest()

    def violations(self, value: Array) -> Array:
        """Return how far values (N, m) are outside the bounds at most, (N,); negative inside."""
        return np.asarray(np.maximum(self.lower - value, value - self.upper).max(axis=1))

    def finite(self, value: Array, slopes: list[Array], where: str, Q: Array) -> None:
        """Require values (N, m) and derivatives (N, m, n) to be finite.

        Raises:
            InputError: one is not; the first configuration of Q (N, n) where.
        """
        bad = np.asarray(~np.isfinite(value).all(axis=1))
        rough = np.zeros(len(value), dtype=bool)
        for slope in slopes:
            rough |= ~np.isfinite(slope).all(axis=(1, 2))
        if (bad | rough).any():
            k = int(np.flatnonzero(bad | rough)[0])
            what = "a value that is not finite" if bad[k] else "a derivative that is not finite"
            at = ", ".join(f"{q:.4g}" for q in Q[k])
            raise self._wrong(f"{what} at {where}, q = ({at})")

    def _wrong(self, found: str, expected: str = "a smooth function, finite along the motion") -> InputError:
        return wrong_argument("Expression", self.name, found, expected)


def _reason(error: Exception) -> str:
    """Return in a line why a function fails, without the places in CasADi's sources."""
    text = str(error).strip()
    if "truth value" in text:
        return "it compares, so that it is not smooth (`if`, `and`, `max` of Python)"
    if "free" in text and "Function" in text:
        return "it uses symbols that are none of the state's"
    return text.splitlines()[0] if text else type(error).__name__


def _number(values: Array) -> str:
    return ", ".join(f"{value:.6g}" for value in values)
