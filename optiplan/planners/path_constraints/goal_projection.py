"""Project goal configurations onto the path constraints where none holds them.

Two hands on one box: inverse kinematics moves one hand to its goal pose and leaves the other arm in place.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.planners.common.goal_ranking import GoalSampler
from optiplan.planners.path_constraints.goals import goal_inequalities, in_goal
from optiplan.planners.path_constraints.inequality import CompiledInequality
from optiplan.planners.path_constraints.motion_check import PathConstraints
from optiplan.problem.constraints.measures import FramePoses
from optiplan.problem.goals_and_vias import JointGoal, PoseGoal
from optiplan.problem.problem import Problem
from optiplan.problem.regions.region import RegionGoal

_TRIED = 8
"""Number of configurations, the nearest first, projected onto each goal."""

_ITERATIONS = 40
_DAMPING = 1e-9  # of the squares of the rows' slopes, so that rows that say the same twice do no harm
_SETS = 6  # of rows that a step regards, one after another
_LONGEST = 0.3  # rad or m, of a joint in one step
_AIMED = 0.5  # share of a goal's tolerance that is aimed at
_KEPT = 0.2  # share of the reserve of a constraint: its rows and what it measures differ a little
_INSIDE = 1e-7  # times its unit: how far beyond its bound a row is aimed at least


def hold_goals(
    problem: Problem,
    model: CollisionModel,
    sampler: GoalSampler,
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

    def __init__(self, problem: Problem, goal: PoseGoal | RegionGoal, constraints: PathConstraints) -> None:
        robot = problem.robot
        self._goal, self._poses = goal, FramePoses(robot, goal.frame)
        aimed = (
            goal.inner(_AIMED)
            if isinstance(goal, RegionGoal)
            else replace(goal, position=_AIMED * goal.position, orientation=_eased(goal.orientation))
        )
        rows = [CompiledInequality(robot, one) for one in goal_inequalities(aimed)]
        ends = [one for kept in constraints.all if kept.one.during[1] == 1.0 for one in kept.inequalities]
        self._rows = rows + [one for one in ends if isinstance(one, CompiledInequality) and not one.stated.rate]
        self._limits, self._still = problem.limits, np.zeros((1, robot.n))

    def __call__(self, q: Array) -> Array | None:
        """Return a configuration (n,) near q in the goal and on the constraints; None if none was found."""
        for _ in range(_ITERATIONS):
            rows = self._rows_at(q)
            if (rows.value >= 0.0).all():
                return q if in_goal(self._goal, self._poses.at(q)) else None
            step = _step(rows)
            largest = float(np.abs(step).max())
            q = np.clip(q + step * min(1.0, _LONGEST / max(largest, 1e-12)), self._limits.lower, self._limits.upper)
        return None

    def _rows_at(self, q: Array) -> "_Rows":
        motion = [np.ascontiguousarray(q)[None], self._still, self._still]
        found = [one(motion) for one in self._rows]
        inside = [np.full(one.size, _INSIDE * one.stated.unit) for one in self._rows]
        slopes = np.vstack([slopes[0][0] for _, slopes in found])
        value = [g[0] - _KEPT * one.stated.reserve for (g, _), one in zip(found, self._rows, strict=True)]
        return _Rows(np.concatenate(value), slopes, np.concatenate(inside))


class _Rows(NamedTuple):
    """Rows at a configuration: g (m,) less a part of its reserve, its slopes (m, n), and the target of g (m,)."""

    value: Array
    slopes: Array
    inside: Array


def _step(rows: _Rows) -> Array:
    """Return the shortest step (n,) that brings violated rows g (m,) inside, and no other out of it, to first order."""
    value, slopes, inside = rows
    wrong = value < 0.0
    step = np.zeros(slopes.shape[1])
    for _ in range(_SETS):
        J, e = slopes[wrong], inside[wrong] - value[wrong]
        A = J @ J.T
        A.flat[:: len(e) + 1] += _DAMPING * max(float(np.trace(A)), 1e-12)
        step = J.T @ np.linalg.solve(A, e)
        more = wrong | (value + slopes @ step < 0.0)
        if (more == wrong).all():
            break
        wrong = more
    return np.asarray(step)


def _eased(angle: float) -> float:
    """Return the target of an orientation tolerance; half a turn and more is no tolerance."""
    return angle if angle >= np.pi else _AIMED * angle
