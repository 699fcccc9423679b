"""Goals of many poses, such as the grasps of an object: the promising ones first, a few at a time."""

from collections.abc import Iterator

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.geometry.poses import pose_error
from optiplan.kinematics.ik.levenberg_marquardt import Descent
from optiplan.kinematics.ik.numeric import random_seeds
from optiplan.planners.base import Budget
from optiplan.problem.goals_and_vias import Goal, PoseGoal
from optiplan.problem.problem import Problem
from optiplan.problem.regions.together import joints_of

AT_ONCE, MANY = 6, 12
"""Ends of a goal of many that are searched for configurations together; a goal of no more than so many is no such."""

_SEEDS, _ITERATIONS = 3, 40
"""Random starts of the inverse kinematics of an end, and steps of each."""

_ROOM = 5e-3
"""m: ends at which bodies are nearer come after those with more room."""


def end_batches(problem: Problem, goal: Goal, model: CollisionModel, budget: Budget) -> Iterator[Goal]:
    """Yield the ends of a goal: all at once where they are few, else those that are reached and free, best first.

    Of each pose some starts of the inverse kinematics look for a free configuration. Ends where one has 5 mm of room
    come first, then those with less; among them the one that the joints could reach soonest. The others come last.
    """
    if len(goal) <= MANY or not all(isinstance(end, PoseGoal) for end in goal):
        yield goal
        return
    poses = [end for end in goal if isinstance(end, PoseGoal)]
    rng = np.random.default_rng(problem.seed)
    seeds = [problem.start, *problem.robot.configurations.values()]
    seeds += random_seeds(problem.robot, problem.start, rng, _SEEDS)
    ranks = [(2, np.inf) if budget.over else _rank(problem, end, model, seeds) for end in poses]
    order = sorted(range(len(poses)), key=lambda k: (*ranks[k], k))
    for k in range(0, len(order), AT_ONCE):
        yield tuple(poses[i] for i in order[k : k + AT_ONCE])


def _rank(problem: Problem, end: PoseGoal, model: CollisionModel, seeds: list[Array]) -> tuple[int, float]:
    """Return how promising an end is, the least first: its class, and the bound on the duration to it, s."""
    moving, oriented = joints_of(problem.robot, end), end.orientation < np.pi
    descent = Descent(problem.robot, end.frame, oriented)
    descent.aim(end.X_WG)
    best = 2, np.inf
    for seed in seeds:
        q = descent.descend(np.where(moving, seed, problem.start), _ITERATIONS)
        position, angle = pose_error(descent.place(q), end.X_WG)
        if position > end.position or (oriented and angle > end.orientation) or model.collides(q):
            continue
        tight = len(model.near(q[None], _ROOM).distance) > 0
        best = min(best, (int(tight), float(problem.lower_bounds([q])[0])))
    return best
