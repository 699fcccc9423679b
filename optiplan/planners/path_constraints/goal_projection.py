"""Project goal configurations onto the path constraints where none holds them.

Two hands on one box: inverse kinematics moves one hand to its goal pose and leaves the other arm in place.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.planners.path_constraints.goals import goal_inequalities, in_goal
from optiplan.planners.path_constraints.inequality import CompiledInequality, RowsAtRest, shortest_step, stepped
from optiplan.planners.path_constraints.motion_check import PathConstraints
from optiplan.problem.constraints.measures import FramePoses
from optiplan.problem.goals_and_vias import AllOfGoal, JointGoal, PoseGoal, parts_of
from optiplan.problem.problem import Problem
from optiplan.problem.regions.region import RegionGoal

if TYPE_CHECKING:
    from optiplan.planners.common.goal_ranking import GoalSampler

_TRIED = 8
"""Number of configurations, the nearest first, projected onto each goal."""

_ITERATIONS = 40
_SETS = 6  # of rows that a step regards, one after another
_AIMED = 0.5  # share of a goal's tolerance that is aimed at
_KEPT = 0.2  # share of the reserve of a constraint: its rows and what it measures differ a little
_INSIDE = 1e-7  # times its unit: how far beyond its bound a row is aimed at least


def hold_goals(
    problem: Problem,
    model: CollisionModel,
    sampler: "GoalSampler",
    constraints: PathConstraints,
    stop: Callable[[], bool],
) -> list[Array]:
    """Return the configurations (n,) of a sampler that hold the path constraints; where none does, project some.

    A projected configuration that is free and within the torque limits is added to the sampler.
    """
    held = [q for q in sampler.configurations if constraints.end_holds(q)]
    if held or not sampler.configurations or not problem.path_constraints:
        return held
    for goal in problem.goal:
        if isinstance(goal, JointGoal):
            continue
        project = _GoalProjection(problem, goal, constraints)
        for q in sampler.configurations[:_TRIED]:
            found = None if stop() else project(q)
            if found is not None and constraints.end_holds(found) and not model.collides(found):
                sampler.add(found)
    return [q for q in sampler.configurations if constraints.end_holds(q)]


class _GoalProjection:
    """Newton's method on the rows of a goal and of all constraints of the end that are, or would be, violated."""

    def __init__(self, problem: Problem, goal: PoseGoal | RegionGoal | AllOfGoal, constraints: PathConstraints) -> None:
        robot = problem.robot
        self._parts = [(part, FramePoses(robot, part.frame)) for part in parts_of(goal)]
        aimed = [_aimed(part) for part, _ in self._parts]
        rows = [CompiledInequality(robot, one) for part in aimed for one in goal_inequalities(part)]
        ends = [one for kept in constraints.all if kept.one.during[1] == 1.0 for one in kept.inequalities]
        rows += [one for one in ends if isinstance(one, CompiledInequality) and not one.stated.rate]
        self._rows, self._limits = RowsAtRest(robot, rows), problem.limits
        self._reserve = np.concatenate([np.full(one.size, _KEPT * one.stated.reserve) for one in rows])
        self._inside = np.concatenate([np.full(one.size, _INSIDE * one.stated.unit) for one in rows])

    def __call__(self, q: Array) -> Array | None:
        """Return a configuration (n,) near q in the goal and on the constraints; None if none was found."""
        for _ in range(_ITERATIONS):
            value, slopes = self._rows(q)
            value = value - self._reserve
            if (value >= 0.0).all():
                return q if all(in_goal(part, poses.at(q)) for part, poses in self._parts) else None
            q = stepped(q, _step(value, slopes, self._inside), self._limits)
        return None


def _step(value: Array, slopes: Array, inside: Array) -> Array:
    """Return the shortest step (n,) that brings violated rows inside, and no other out of it, to first order.

    Args:
        value: (m,) of the rows, less a part of their reserve.
        slopes: (m, n).
        inside: (m,), targets of the rows.
    """
    wrong = value < 0.0
    step = np.zeros(slopes.shape[1])
    for _ in range(_SETS):
        step = shortest_step(slopes[wrong], inside[wrong] - value[wrong])
        more = wrong | (value + slopes @ step < 0.0)
        if (more == wrong).all():
            break
        wrong = more
    return step


def _aimed(goal: PoseGoal | RegionGoal) -> PoseGoal | RegionGoal:
    """Return the goal with the tolerances that are aimed at."""
    if isinstance(goal, RegionGoal):
        return goal.inner(_AIMED)
    return replace(goal, position=_AIMED * goal.position, orientation=_eased(goal.orientation))


def _eased(angle: float) -> float:
    """Return the target of an orientation tolerance; half a turn and more is no tolerance."""
    return angle if angle >= np.pi else _AIMED * angle
