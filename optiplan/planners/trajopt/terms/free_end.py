"""The end of a motion as a term: anywhere in a pose goal or a region, which is optimised with the rest."""

import numpy as np

from optiplan.arrays import Array
from optiplan.kinematics.ik.levenberg_marquardt import Descent
from optiplan.kinematics.ik.numeric import pose_error
from optiplan.planners.path_constraints.goals import goal_inequalities
from optiplan.planners.path_constraints.inequality import CompiledInequality
from optiplan.planners.trajopt.bspline_basis import FIXED
from optiplan.planners.trajopt.terms.expression import PRICE, ExpressionTerm
from optiplan.problem.goals_and_vias import PoseGoal
from optiplan.problem.problem import Problem
from optiplan.problem.regions.region import RegionGoal
from optiplan.problem.regions.sampling import RegionSampler

_FIRM = 10.0
"""Times the price of a path constraint that missing the goal costs: it is one sample against many."""

_ITERATIONS = 50


class FreeEnd:
    """The set of ends of one pose goal or region.

    Attributes:
        goal: the pose with its tolerances, or the region.
        terms: that keep the end in it.
    """

    def __init__(self, problem: Problem, goal: PoseGoal | RegionGoal) -> None:
        self.goal = goal
        self.terms = tuple(ExpressionTerm(CompiledInequality(problem.robot, one)) for one in goal_inequalities(goal))
        for term in self.terms:
            term.price = _FIRM * PRICE
        self._sampler = RegionSampler(problem.robot, goal) if isinstance(goal, RegionGoal) else None
        oriented = goal.oriented if isinstance(goal, RegionGoal) else goal.orientation < np.pi
        self._descent = Descent(problem.robot, goal.frame, oriented)

    def holds(self, q: Array) -> bool:
        """Return whether a configuration (n,) is in the goal."""
        X_WF = self._descent.place(q)
        if isinstance(self.goal, RegionGoal):
            return self.goal.contains(X_WF)
        position, angle = pose_error(X_WF, self.goal.X_WG)
        return bool(position <= self.goal.position and angle <= self.goal.orientation)

    def landed(self, control: Array) -> Array:
        """Return control points (K, n) whose end is in the goal: that nearest to it, where it is a little off."""
        if self.holds(control[-1]):
            return control
        result = control.copy()
        if self._sampler is not None or isinstance(self.goal, RegionGoal):
            assert self._sampler is not None
            result[-FIXED:] = self._sampler.onto(control[-1])[0]
            return result
        self._descent.aim(self.goal.X_WG)
        result[-FIXED:] = self._descent.descend(control[-1], _ITERATIONS)
        return result
