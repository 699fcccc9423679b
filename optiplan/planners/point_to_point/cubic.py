"""`cubic`: one polynomial of degree three a joint, with any velocities at the ends.

From rest to rest, with s = t / T and D = q_goal - q_start:  q(t) = q_start + D (3 s^2 - 2 s^3),  whose peaks are
1.5 |D| / T in velocity and 6 |D| / T^2 in acceleration. The acceleration jumps at both ends, so that only a problem
with `limits: {jerk: none}` can have it verified.
"""

from optiplan.arrays import Array
from optiplan.planners.point_to_point.base import PointToPoint, Profile
from optiplan.planners.point_to_point.polynomials import EndOptions, Family, polynomial_profile
from optiplan.problem.problem import Problem
from optiplan.trajectory.profiles.laws import CUBIC


class Cubic(PointToPoint[EndOptions]):
    """Planner of cubic polynomials."""

    Options = EndOptions

    end_derivatives = 1

    def profile(self, problem: Problem, goal: Array) -> Profile:
        """The cubic from the start to a goal (n,)."""
        return polynomial_profile(Family("cubic", CUBIC, ("velocity",)), self.options, problem, goal)
