"""Base class of all planners, with their result and budget types."""

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Any, ClassVar, Generic, Literal, TypeVar

from optiplan.arrays import number_argument
from optiplan.errors import described, wrong_argument
from optiplan.libraries import clock
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory

FailureKind = Literal[
    "goal-unreachable",
    "start-in-collision",
    "goal-in-collision",
    "no-path",
    "collision",
    "constraint",
    "limits",
    "singularity",
    "reach",
    "infeasible",
    "unsupported",
    "budget",
    "cancelled",
    "input",
    "bug",
]
"""Why there is no plan.

* `goal-unreachable`: no configuration within the joint limits reaches the goal.
* `start-in-collision`, `goal-in-collision`: bodies overlap at the start, or wherever the goal is reached.
* `no-path`: no path from the start to the goal was found.
* `collision`: the requested motion is not free.
* `constraint`: every motion found violates a path constraint, or every end of the goal does.
* `limits`: it violates limits in the requested duration or with the requested shape.
* `singularity`, `reach`: the requested path cannot be followed any further.
* `infeasible`: no motion can do it: gravity alone exceeds the torque limits at the start, the goal or a via.
* `unsupported`: this planner, or this robot, cannot do what the problem requires.
* `budget`, `cancelled`: the time ended, or the search was cancelled.
* `input`, `bug`: in a comparison, a planner raised an error about its options, or an unexpected error.
"""


@dataclass(frozen=True)
class Failure:
    """Reason why no plan was found, as a value.

    Attributes:
        kind: see `FailureKind`.
        detail: one sentence for a person.
        witness: JSON-ready location of the failure: configuration `q`, time `t`, bodies `pair`, points `points`,
            and the refused `motion`, as `Trajectory.to_dict`, if there is one. `untimed`: the motion is a path at a
            constant rate, which has no time law yet.
    """

    kind: FailureKind
    detail: str
    witness: Mapping[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Return kind and reason in one line."""
        return f"Failure: {self.kind}: {self.detail}"


@dataclass(frozen=True, eq=False)
class Candidate:
    """Trajectory that the planner proposes as a solution, found `seconds` after it began."""

    trajectory: Trajectory
    seconds: float


@dataclass(frozen=True)
class PlanResult:
    """A trajectory or the reason why there is none, with the seconds spent by named stage.

    Attributes:
        info: JSON-ready; its `cut_short` is set when the time limit ended some of the work, so that another run of the
            same problem may give another result.
        earlier: previous incumbents, each better than those before it and worse than `trajectory`.
        seconds: time at which `trajectory` was found; None: at the end.
    """

    trajectory: Trajectory | None = None
    failure: Failure | None = None
    timings: Mapping[str, float] = field(default_factory=dict)
    info: Mapping[str, Any] = field(default_factory=dict)
    earlier: tuple[Candidate, ...] = ()
    seconds: float | None = None


class Budget:
    """Wall-clock deadline and cancellation, polled by planners.

    Args:
        seconds: from now on, or from `start`.
        cancel: event that another thread sets to end the work at once.

    Raises:
        InputError: the seconds are no number, or below 0.

    Example:
        >>> import optiplan as op
        >>> op.Budget(5.0).seconds
        5.0
    """

    def __init__(self, seconds: float, cancel: threading.Event | None = None) -> None:
        number_argument("Budget", "seconds", seconds, "a number of seconds >= 0", 0.0)
        if cancel is not None and not hasattr(cancel, "is_set"):
            raise wrong_argument("Budget", "cancel", described(cancel), "a threading.Event")
        self._cancel = cancel or threading.Event()
        self._outer: Budget | None = None
        self.seconds = seconds
        self.start()

    def __repr__(self) -> str:
        """Return the remaining time in words."""
        return f"Budget: {self.remaining:.3g} of {self.seconds:.3g} s left"

    def start(self) -> None:
        """Start the clock."""
        self._end = clock() + self.seconds

    def share(self, fraction: float) -> "Budget":
        """Return a budget of that fraction of the remaining time, cancelled together with this one."""
        other = Budget(fraction * self.remaining, self._cancel)
        other._outer = self
        return other

    def leaving(self, seconds: float) -> "Budget":
        """Return a budget that ends `seconds` earlier, cancelled together with this one."""
        other = Budget(self.seconds, self._cancel)
        other._end, other._outer = self._end - seconds, self
        return other

    def leave(self, seconds: float) -> None:
        """End, with every budget that is part of this one, at least `seconds` before the one that this is part of."""
        if self._outer is not None:
            self._end = min(self._end, self._outer._end - seconds)

    @property
    def remaining(self) -> float:
        """Return the remaining time, s; 0 once cancelled."""
        if self.cancelled:
            return 0.0
        own = max(0.0, self._end - clock())
        return own if self._outer is None else min(own, self._outer.remaining)

    @property
    def overrun(self) -> float:
        """Return the time since this budget ended, s; 0 before."""
        return max(0.0, clock() - self._end)

    @property
    def cancelled(self) -> bool:
        """Return whether the work was cancelled."""
        return self._cancel.is_set()

    @property
    def over(self) -> bool:
        """Return whether the planner must return now."""
        return self.remaining <= 0.0


Progress = Callable[[str, float], None]
"""Called with the name of a stage and its fraction done; `announce` reports motions to it."""


def announce(progress: Progress, trajectory: Trajectory, bound: float = 0.0) -> None:
    """Report a new, unverified incumbent to the method `found(trajectory, bound)` of `progress`, if it has one.

    Args:
        progress: that a planner was given.
        trajectory: the incumbent.
        bound: lower bound on the duration, s, of any motion to the goals known; 0 where the planner has none.
    """
    found = getattr(progress, "found", None)
    if found is not None:
        found(trajectory, bound)


def stages_of(progress: Progress) -> Progress:
    """Return the progress of a part of the work: it passes stages on, but no motions, since these are no answers."""
    return lambda stage, fraction: progress(stage, fraction)


def silent(stage: str, fraction: float) -> None:
    """Progress that nobody wants to know."""


OptionsT = TypeVar("OptionsT")


@dataclass(frozen=True)
class NoOptions:
    """The options of a planner that has none."""


class Planner(ABC, Generic[OptionsT]):
    """Base class: turn a Problem into a PlanResult, without printing or globals, polling the budget.

    Attributes:
        Options: frozen dataclass of options, preferably a `PlannerOptions`; see `planners.option_schema`.
        passes_vias: whether `plan` handles a problem's vias; otherwise it is called for the legs between them, one by
            one and without vias.
        joins_legs: whether legs between vias may be joined and optimised together, as moves of a task are; the motion
            of any other planner rests at each via.
        holds_constraints: whether `plan` handles path constraints; otherwise it is called only for problems without.
        end_derivatives: what `plan` handles of a motion stated at the start or at goals: 0 none, 1 velocities, 2 also
            accelerations; it is not called for problems that state more.
        times_obstacles: whether `plan` takes the motion of dynamic obstacles into account. Otherwise it plans among
            the static ones, and its motion waits or slows down until the others have passed.

    Example:
        >>> import optiplan as op
        >>> class Idle(op.Planner):
        ...     def plan(self, problem, budget, progress):
        ...         return op.PlanResult(failure=op.Failure("no-path", "I did not look for one"))
        >>> op.plan(op.load_problem("01_reach"), Idle())
        Run: no motion (no-path: I did not look for one); reach, Idle
    """

    Options: ClassVar[type[Any]] = NoOptions
    passes_vias: bool = False
    joins_legs: bool = False
    holds_constraints: bool = False
    end_derivatives: int = 0
    times_obstacles: bool = False

    def __init__(self, options: OptionsT | None = None) -> None:
        self.options: OptionsT = self.Options() if options is None else options

    @abstractmethod
    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; never raises for "no solution".

        Raises:
            InputError: the options do not fit the problem.
        """

    def replan(self, problem: Problem, earlier: Trajectory, budget: Budget, progress: Progress) -> PlanResult:
        """Plan, starting from a motion for a similar problem; by default that motion is not used."""
        return self.plan(problem, budget, progress)

    def near(self, problem: Problem, earlier: Trajectory, budget: Budget) -> Trajectory | None:
        """Return a motion of this problem near one of a similar problem, without a search; None without one."""
        return None

    def check(self, problem: Problem, budget: Budget) -> None:
        """Check that the options fit the problem, without planning.

        Raises:
            InputError: they do not.
        """
