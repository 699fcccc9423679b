"""Paths on the constraints as initial guesses of an optimiser, and the motions along them."""

from typing import TYPE_CHECKING

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget, Failure
from optiplan.planners.path_constraints.motion_check import PathConstraints
from optiplan.planners.sampling.sample_path import SampledPath
from optiplan.planners.sampling.shortcutting import path_cost
from optiplan.problem.problem import Problem, derived
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from optiplan.planners.sampling.constrained.planner import ConstrainedPath


_SHORTCUTS = 60


@dataclass
class ConstrainedSeeds:
    """Paths on the constraints of a problem, the last of them, and the motion along that."""

    problem: Problem
    model: CollisionModel
    last: "ConstrainedPath | None" = None
    timed: Trajectory | Failure | None = None

    @property
    def apply(self) -> bool:
        """Whether there are constraints, all of the whole motion."""
        if not self.problem.path_constraints:
            return False
        from optiplan.planners.sampling.constrained.manifold import in_part_only

        return not in_part_only(self.problem)

    def path(self, goals: list[Array], budget: Budget, number: int) -> SampledPath | Failure:
        """Return a path to one of the goals (n,), another for each number."""
        from optiplan.planners.sampling.constrained.planner import ConstrainedSearch, constrained_path

        problem = derived(self.problem, seed=self.problem.seed + 1000 * number)
        goals = goals[number % len(goals) :] + goals[: number % len(goals)]
        found = constrained_path(self.model, problem, goals, budget, ConstrainedSearch(attempts=_SHORTCUTS))
        if isinstance(found, Failure):
            return found
        self.last, self.timed = found, None
        cost = path_cost(found.waypoints, problem.limits.velocity)
        return SampledPath(found.waypoints, -1, cost, {"states": found.states, "cut_short": budget.over})

    def motion(self, path: SampledPath, constraints: PathConstraints, budget: Budget) -> Trajectory | Failure | None:
        """Return the motion along a path that `path` gave; None of any other."""
        from optiplan.planners.sampling.constrained.planner import timed

        if self.last is None or not np.array_equal(self.last.waypoints, path.waypoints):
            return None
        if self.timed is None:
            self.timed = timed(self.problem, self.last, constraints, budget)
        return self.timed
