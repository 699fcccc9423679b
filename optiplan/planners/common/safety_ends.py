"""The ends about which a planner's collision models let pairs be nearer than a scene's `Safety` asks."""

from dataclasses import replace

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.kept_models import kept_planning_model
from optiplan.geometry.scene import Scene
from optiplan.planners.base import Budget
from optiplan.problem.goals import GoalOptions, goal_configurations, listed_ends
from optiplan.problem.problem import JointGoal, Problem, derived


def with_ends(problem: Problem, budget: Budget) -> Problem:
    """Return the problem in a scene that knows where its motions begin and end; itself where no distance is required.

    Ends of poses and regions keep the whole distance where some can. Where none can, the goal becomes those that do
    not touch, and pairs may be nearer there. The verifier has the problem itself, and the ends of the motion.
    """
    safety = problem.scene.safety
    if safety is None or len(safety.ends) > 1:
        return problem
    ends = [problem.start, *listed_ends(problem), *(via.at.q for via in problem.vias if isinstance(via.at, JointGoal))]
    told = ending_at(problem, *ends)
    if all(isinstance(goal, JointGoal) for goal in problem.goal):
        return told
    options = GoalOptions(stop=lambda: budget.over)
    if _reached(told, told.scene, options):
        return told
    nearer = _reached(problem, replace(problem.scene, safety=None), options)
    if not nearer:
        return told
    return derived(ending_at(problem, *ends, *nearer), goal=tuple(JointGoal(q) for q in nearer))


def ending_at(problem: Problem, *ends: Array) -> Problem:
    """Return the problem in its scene with these ends (n,)."""
    return derived(problem, scene=problem.scene.ending_at(*ends)) if problem.scene.safety is not None else problem


def _reached(problem: Problem, scene: Scene, options: GoalOptions) -> list[Array]:
    """Return configurations of the goal that are free in a scene."""
    model = kept_planning_model(problem.robot, scene, problem.tracking_error)
    return goal_configurations(problem, model, np.random.default_rng(problem.seed), options).configurations
