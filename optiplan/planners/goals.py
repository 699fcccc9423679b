"""Goal configurations as planners want them: free, not too heavy to hold, ranked, or a Failure."""

import numpy as np

from optiplan.arrays import Array
from optiplan.model.collision import CollisionModel
from optiplan.planners.base import Budget, Failure
from optiplan.planners.failures import end_collides, end_too_heavy, out_of_time
from optiplan.planners.torque import Gravity
from optiplan.problem.goals import GoalOptions, goal_configurations
from optiplan.problem.problem import Problem
from optiplan.trajectory.timing import lower_bounds


def ranked_goals(problem: Problem, model: CollisionModel, budget: Budget, count: int = 8) -> list[Array] | Failure:
    """Up to `count` goal configurations (n,), the one with the smallest lower bound first.

    Failure kinds: `start-in-collision`, `goal-unreachable`, `goal-in-collision`, `unsupported` (gravity exceeds the
    torque limits at the start or at all goals), `cancelled`, `budget`.
    """
    gravity = Gravity(problem.robot, problem.limits.torque)
    if model.collides(problem.start):
        return end_collides(model, problem.start, "start")
    if gravity.too_much(problem.start):
        return end_too_heavy(gravity, problem.start[None], "start")
    options = GoalOptions(count=4 * count, stop=lambda: budget.over)
    found = goal_configurations(problem, model, np.random.default_rng(problem.seed), options)
    if not found.configurations:
        if budget.over:
            return out_of_time(budget, "looking for goal configurations")
        return Failure(found.kind, found.reason, found.witness)
    goals = np.array([q for q in found.configurations if not gravity.too_much(q)])
    if not len(goals):
        return end_too_heavy(gravity, np.array(found.configurations), "goal")
    order = np.argsort(lower_bounds(problem.start, goals, problem.limits), kind="stable")
    return [goals[k] for k in order[:count]]
