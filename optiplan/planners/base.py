"""What every planner is: the protocol, its result, its budget."""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from optiplan.problem.problem import Problem
from optiplan.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class Failure:
    """Why there is no plan, as a value.

    Attributes:
        kind: one of `goal-unreachable`, `start-in-collision`, `goal-in-collision`, `no-path`, `collision`, `budget`,
            `cancelled`, `limits` (not within limits in the duration or with the shape asked for), `singularity` and
            `reach` (where the path asked for cannot be followed any further), `unsupported`.
        detail: one sentence for a person.
        witness: JSON-ready place where it failed: configuration `q`, time `t`, bodies `pair`, points `points`.
    """

    kind: str
    detail: str
    witness: Mapping[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Kind and reason in one line."""
        return f"Failure: {self.kind}: {self.detail}"


@dataclass(frozen=True, eq=False)
class Candidate:
    """A trajectory that the planner holds for an answer, `seconds` after it began."""

    trajectory: Trajectory
    seconds: float


@dataclass(frozen=True)
class PlanResult:
    """A trajectory or the reason why there is none, with the seconds spent by named stage.

    Attributes:
        info: JSON-ready; its `cut_short` says that the clock ended some of the work, so that another run of the same
            problem may give another answer.
        earlier: answers that were the best for a while, each better than those before it and worse than `trajectory`.
        seconds: after which `trajectory` was there; None: at the end.
    """

    trajectory: Trajectory | None
    failure: Failure | None
    timings: Mapping[str, float]
    info: Mapping[str, Any] = field(default_factory=dict)
    earlier: tuple[Candidate, ...] = ()
    seconds: float | None = None


class Budget:
    """Wall-clock deadline and cancellation, polled by planners.

    Args:
        seconds: from now on, or from `start`.
        cancel: set by another thread, it ends the work at once.

    Example:
        >>> import optiplan as op
        >>> op.Budget(5.0).seconds
        5.0
    """

    def __init__(self, seconds: float, cancel: threading.Event | None = None) -> None:
        self._cancel = cancel or threading.Event()
        self.seconds = seconds
        self.start()

    def __repr__(self) -> str:
        """What is left of it."""
        return f"Budget: {self.remaining:.3g} of {self.seconds:.3g} s left"

    def start(self) -> None:
        """Count the seconds from now on."""
        self._end = time.perf_counter() + self.seconds

    def share(self, fraction: float) -> "Budget":
        """A budget of that fraction of what is left, cancelled together with this one."""
        return Budget(fraction * self.remaining, self._cancel)

    def leaving(self, seconds: float) -> "Budget":
        """The same budget, over so many seconds sooner, cancelled together with this one."""
        other = Budget(self.seconds, self._cancel)
        other._end = self._end - seconds
        return other

    @property
    def remaining(self) -> float:
        """Seconds left; 0 once cancelled."""
        return 0.0 if self.cancelled else max(0.0, self._end - time.perf_counter())

    @property
    def cancelled(self) -> bool:
        """Whether somebody asked to stop at once."""
        return self._cancel.is_set()

    @property
    def over(self) -> bool:
        """Whether the planner must return now."""
        return self.remaining <= 0.0


Progress = Callable[[str, float], None]
"""Called with the name of a stage and the fraction done of it."""


class Planner(Protocol):
    """Anything that turns a Problem into a PlanResult; it prints nothing, keeps no globals and polls its budget."""

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; never raises for "no solution"."""
        ...
