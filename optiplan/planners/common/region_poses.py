"""Poses of a goal region, for planners whose motion leads to one pose."""

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.kept_models import kept_planning_model
from optiplan.kinematics.ik.numeric import random_seeds
from optiplan.problem.goals_and_vias import AllOfGoal
from optiplan.problem.problem import JointGoal, PoseGoal, Problem, RegionGoal, derived
from optiplan.problem.regions.together import joints_of, sampler_of
from optiplan.robot.frames import frame_pose

_TRIED, _KEPT = 24, 4
"""Configurations tried, and poses of free ones kept."""

_SHARE = 0.2
"""Tolerance of a pose in a region, as a share of the region's narrowest width, m or rad."""


def with_poses(problem: Problem) -> Problem:
    """Return the problem with poses in the place of each goal region: the nearest to the start, then random ones.

    All are poses of free configurations within the limits, where any was found.
    """
    regions = any(isinstance(goal, RegionGoal | AllOfGoal) for goal in problem.goal)
    return derived(problem, goal=tuple(single_ends(problem))) if regions else problem


def single_ends(problem: Problem) -> list[JointGoal | PoseGoal]:
    """Return the alternatives of the goal, poses in the place of regions, and configurations for several frames."""
    ends: list[JointGoal | PoseGoal] = []
    for goal in problem.goal:
        if isinstance(goal, AllOfGoal):
            ends += [JointGoal(q) for q in _reached(problem, goal)]
        else:
            ends += _poses(problem, goal) if isinstance(goal, RegionGoal) else [goal]
    return ends


def _reached(problem: Problem, goal: RegionGoal | AllOfGoal) -> list[Array]:
    """Return configurations (n,) in a goal; where none was found that is free, the one nearest to the start."""
    robot, rng = problem.robot, np.random.default_rng(problem.seed)
    sampler, moving = sampler_of(robot, goal), joints_of(robot, goal)
    model = kept_planning_model(robot, problem.scene, problem.tracking_error)
    first = sampler.onto(problem.start)
    reached = [first[0]] if first[1] and not model.collides(first[0]) else []
    for seed in random_seeds(robot, problem.start, rng, _TRIED):
        q, inside = sampler.drawn(np.where(moving, seed, problem.start), rng)
        reached += [q] if inside and not model.collides(q) else []
        if len(reached) >= _KEPT:
            break
    return reached or [first[0]]


def _poses(problem: Problem, goal: RegionGoal) -> list[PoseGoal]:
    robot, reached = problem.robot, _reached(problem, goal)
    width = goal.high - goal.low
    position, orientation = _tolerance(width[:3], 1e-4), _tolerance(width[3:], 1e-3)
    inner = goal.inner(0.5)
    return [
        PoseGoal(goal.frame, inner.nearest(frame_pose(robot, q, goal.frame)), position, orientation) for q in reached
    ]


def _tolerance(width: Array, usual: float) -> float:
    return float(min(usual, _SHARE * float(np.min(width))))
