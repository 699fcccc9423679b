"""Goal configurations as planners want them: free, ranked by the lower bound of the motion, or a Failure."""

import numpy as np

from optiplan.arrays import Array
from optiplan.model.collision import CollisionModel
from optiplan.planners.base import Budget, Failure
from optiplan.planners.failures import end_collides, out_of_time
from optiplan.problem.goals import GoalOptions, goal_configurations
from optiplan.problem.problem import Problem
from optiplan.trajectory.timing import lower_bounds


def ranked_goals(problem: Problem, model: CollisionModel, budget: Budget, count: int = 8) -> list[Array] | Failure:
    """Up to `count` goal configurations (n,), the one with the smallest lower bound first.

    Failure kinds: `start-in-collision`, `goal-unreachable`, `goal-in-collision`, `cancelled`, `budget`.
    """
    if model.collides(problem.start):
        return end_collides(model, problem.start, "start")
    options = GoalOptions(count=4 * count, stop=lambda: budget.over)
    found = goal_configurations(problem, model, np.random.default_rng(problem.seed), options)
    if not found.configurations:
        if budget.over:
            return out_of_time(budget, "looking for goal configurations")
        return Failure(found.kind, found.reason, found.witness)
    order = np.argsort(lower_bounds(problem.start, np.array(found.configurations), problem.limits), kind="stable")
    return [found.configurations[k] for k in order[:count]]
