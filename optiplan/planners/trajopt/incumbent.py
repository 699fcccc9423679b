"""The incumbent of a search: the best motion found so far, and those that were the best before it."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from optiplan.libraries import clock
from optiplan.planners.base import Candidate, Progress, announce
from optiplan.planners.common.stopwatch import Stopwatch
from optiplan.planners.path_constraints.motion_check import PathConstraints
from optiplan.planners.trajopt.optimizer import Attempt
from optiplan.problem.problem import Problem
from optiplan.trajectory.trajectory import Trajectory

_NO_GAIN = 1e-6
"""Share of the cost below which a motion counts as no better."""


@dataclass(eq=False)
class Incumbent:
    """The best motion found so far; every free motion is offered to it.

    Attributes:
        problem: that is planned.
        constraints: on its path.
        progress: is told of each better motion.
        info: record of the run; says in `fallback` that the best motion was not optimised.
        began: of the run, by `libraries.clock`, s.
        watch: of its stages; being told of a motion is part of none.
        candidates: the best motion and those before it, the best last.
        cost: of the best one; infinite where there is none.
        curve: the best optimised one, as it was before it was refined; None where there is none.
        bound: on the cost of all motions, once the goals are known.
        soonest: bound on their durations, s.
    """

    problem: Problem
    constraints: PathConstraints
    progress: Progress
    info: dict[str, Any]
    began: float
    watch: Stopwatch
    candidates: list[Candidate] = field(default_factory=list)
    cost: float = np.inf
    curve: Attempt | None = None
    bound: float = 0.0
    soonest: float = 0.0

    def __post_init__(self) -> None:
        self._objective = self.problem.objective_parts()

    def cost_of(self, trajectory: Trajectory) -> float:
        """Return the cost of a motion."""
        return self._objective.cost(trajectory)

    def cost_bound(self, duration: float) -> float:
        """Return a lower bound on the cost of motions of at least this duration, s."""
        return self.problem.objective.time * duration

    @property
    def longest(self) -> float:
        """Return the duration, s, from which on a motion costs more than the best one; infinite without one."""
        time = self.problem.objective.time
        return self.cost / time if time > 0.0 else np.inf

    def bounded(self, soonest: float) -> None:
        """Take a lower bound on the durations of all motions, s."""
        self.bound, self.soonest = self.cost_bound(soonest), soonest

    @property
    def rough(self) -> float:
        """Return the cost of the best curve before it was refined; infinite without one."""
        return np.inf if self.curve is None else self.cost_of(self.curve.trajectory)

    def offer(self, trajectory: Trajectory, *, holds: bool = False) -> bool:
        """Keep a free motion if it is better than the best and holds all path constraints; return whether it is.

        Args:
            trajectory: the motion.
            holds: whether it is known to hold them.
        """
        if not holds:
            trajectory = self.constraints.slowed(trajectory)
        cost = self.cost_of(trajectory)
        if cost >= self.cost * (1.0 - _NO_GAIN):
            return False
        if not holds and self.constraints.broken(trajectory):
            return False
        self.cost = cost
        self.info.pop("fallback", None)
        self.candidates.append(Candidate(trajectory, clock() - self.began))
        with self.watch.aside():
            announce(self.progress, trajectory, self.soonest)
        return True

    def offer_curve(self, attempt: Attempt) -> bool:
        """Offer a free curve that is not refined; return whether it is the best of them."""
        self.offer(attempt.trajectory, holds=True)
        if self.cost_of(attempt.trajectory) <= self.rough:
            self.curve = attempt
        return self.curve is attempt

    def offer_first(self, attempt: Attempt) -> None:
        """Keep a curve that is free but not short yet while there is no other curve."""
        if self.curve is None:
            self.offer_curve(attempt)

    def is_best(self, attempt: Attempt) -> bool:
        """Return whether the best motion is that of this attempt."""
        return bool(self.candidates) and attempt.trajectory is self.candidates[-1].trajectory

    def within(self, factor: float) -> bool:
        """Return whether the best motion costs at most this factor of the bound."""
        return self.cost <= factor * self.bound
