"""The end of a motion as a term: free in a pose goal, a region, or several of these at once."""

from collections.abc import Callable

import numpy as np

from optiplan.arrays import Array
from optiplan.kinematics.ik.levenberg_marquardt import Descent
from optiplan.planners.path_constraints.goals import goal_inequalities, in_goal
from optiplan.planners.path_constraints.inequality import CompiledInequality
from optiplan.planners.trajopt.bspline_basis import FIXED
from optiplan.planners.trajopt.terms.path_constraints import PRICE, ExpressionTerm
from optiplan.problem.goals_and_vias import AllOfGoal, PoseGoal, parts_of
from optiplan.problem.problem import Problem
from optiplan.problem.regions.region import RegionGoal
from optiplan.problem.regions.together import sampler_of

_FIRM = 10.0
"""Times the price of a path constraint that missing the goal costs: it is one sample against many."""

_ITERATIONS = 50


class FreeEnd:
    """The set of ends of one goal of poses.

    Args:
        goal: the pose with its tolerances, the region, or several of these at once.

    Attributes:
        terms: keep the end in it.
    """

    def __init__(self, problem: Problem, goal: PoseGoal | RegionGoal | AllOfGoal) -> None:
        parts = parts_of(goal)
        rows = [one for part in parts for one in goal_inequalities(part)]
        self.terms = tuple(ExpressionTerm(CompiledInequality(problem.robot, one)) for one in rows)
        for term in self.terms:
            term.price = _FIRM * PRICE
        self._parts = [(part, _descent(problem, part)) for part in parts]
        self._project = _projection(problem, goal)

    def holds(self, q: Array) -> bool:
        """Return whether a configuration (n,) is in the goal."""
        return all(in_goal(part, descent.place(q)) for part, descent in self._parts)

    def landed(self, control: Array) -> Array:
        """Return control points (K, n) with their end in the goal; an end slightly off is projected."""
        if self.holds(control[-1]):
            return control
        result = control.copy()
        result[-FIXED:] = self._project(control[-1])
        return result


def _descent(problem: Problem, goal: PoseGoal | RegionGoal) -> Descent:
    oriented = goal.oriented if isinstance(goal, RegionGoal) else goal.orientation < np.pi
    return Descent(problem.robot, goal.frame, oriented)


def _projection(problem: Problem, goal: PoseGoal | RegionGoal | AllOfGoal) -> Callable[[Array], Array]:
    """Return the function from a configuration (n,) to a near one in a goal."""
    if isinstance(goal, RegionGoal | AllOfGoal):
        sampler = sampler_of(problem.robot, goal)
        return lambda q: sampler.onto(q)[0]
    descent = _descent(problem, goal)
    descent.aim(goal.X_WG)
    return lambda q: descent.descend(q, _ITERATIONS)
