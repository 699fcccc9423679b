"""The end of a motion as a term: anywhere in a pose goal, which is optimised with the rest."""

import numpy as np

from optiplan.arrays import Array
from optiplan.kinematics.ik.levenberg_marquardt import Descent
from optiplan.kinematics.ik.numeric import pose_error
from optiplan.planners.trajopt.bspline_basis import FIXED
from optiplan.planners.trajopt.terms.expression import PRICE, ExpressionTerm
from optiplan.planners.trajopt.terms.rooms import end_rooms
from optiplan.problem.goals_and_vias import PoseGoal
from optiplan.problem.problem import Problem

_FIRM = 10.0
"""Times the price of a path constraint that missing the goal costs: it is one sample against many."""

_ITERATIONS = 50


class FreeEnd:
    """The set of ends of one pose goal.

    Attributes:
        goal: the pose with its tolerances.
        terms: that keep the end in it.
    """

    def __init__(self, problem: Problem, goal: PoseGoal) -> None:
        self.goal = goal
        self.terms = tuple(ExpressionTerm(problem.robot, room) for room in end_rooms(goal))
        for term in self.terms:
            term.price = _FIRM * PRICE
        self._descent = Descent(problem.robot, goal.frame, goal.orientation < np.pi)

    def holds(self, q: Array) -> bool:
        """Return whether a configuration (n,) is in the goal."""
        position, angle = pose_error(self._descent.place(q), self.goal.X_WG)
        return bool(position <= self.goal.position and angle <= self.goal.orientation)

    def landed(self, control: Array) -> Array:
        """Return control points (K, n) whose end is in the goal: that nearest to it, where it is a little off."""
        if self.holds(control[-1]):
            return control
        self._descent.aim(self.goal.X_WG)
        result = control.copy()
        result[-FIXED:] = self._descent.descend(control[-1], _ITERATIONS)
        return result
