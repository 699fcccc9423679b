"""The incumbent of a search: the best motion found so far, and the earlier best ones."""

from collections.abc import Mapping
from dataclasses import field
from typing import Any

import numpy as np

from optiplan.libraries import clock
from optiplan.planners.base import Candidate, Failure, PlanResult, Progress, announce
from optiplan.planners.common.context import Stopwatch
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory

_NO_GAIN = 1e-6
"""Share of the cost below which a motion counts as no better."""


@dataclass(eq=False)
class Incumbent:
    """The best motion found so far; every motion that can be an answer is offered to it.

    Attributes:
        problem: to plan.
        progress: receives each better motion.
        watch: of the run's stages; the report of a motion is part of none.
        began: start of the run, by `libraries.clock`, s.
        candidates: the best motions so far, each better than the one before it.
        cost: of the last; infinite without any.
        soonest: lower bound on the durations of all motions, s.
    """

    problem: Problem
    progress: Progress
    watch: Stopwatch = field(default_factory=Stopwatch)
    began: float = field(default_factory=clock)
    candidates: list[Candidate] = field(default_factory=list)
    cost: float = np.inf
    soonest: float = 0.0

    def __post_init__(self) -> None:
        self._objective = self.problem.objective_parts()

    @property
    def best(self) -> Trajectory | None:
        """Return the best motion; None where there is none."""
        return self.candidates[-1].trajectory if self.candidates else None

    def cost_of(self, trajectory: Trajectory) -> float:
        """Return the cost of a motion."""
        return self._objective.cost(trajectory)

    def improves(self, trajectory: Trajectory) -> bool:
        """Return whether a motion costs less than the best one."""
        return self.cost_of(trajectory) < self.cost * (1.0 - _NO_GAIN)

    def offer(self, trajectory: Trajectory) -> bool:
        """Keep a motion if it is better than the best; return whether it is."""
        if not self.improves(trajectory):
            return False
        self.cost = self.cost_of(trajectory)
        self.candidates.append(Candidate(trajectory, clock() - self.began))
        with self.watch.aside():
            announce(self.progress, trajectory, self.soonest)
        return True

    def result(self, info: Mapping[str, Any], failure: Failure | None = None) -> PlanResult:
        """Return the best motion with those before it, or the failure where there is none."""
        if not self.candidates:
            return PlanResult(None, failure, self.watch.seconds, info)
        *earlier, last = self.candidates
        return PlanResult(last.trajectory, None, self.watch.seconds, info, tuple(earlier), last.seconds)
