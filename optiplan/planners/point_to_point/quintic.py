"""`quintic`: all joints move together along one polynomial of degree five. The planner to read first.

With s = t / T from 0 to 1 and D = q_goal - q_start,

    q(t) = q_start + D (10 s^3 - 15 s^4 + 6 s^5),

which starts and ends at rest with no acceleration. Its largest velocity is 1.875 |D| / T, its largest acceleration
(10 / sqrt(3)) |D| / T^2 and its largest jerk 60 |D| / T^3: T is the smallest that keeps all three within limits.
With accelerations at the ends it is the one polynomial of degree five that has them.
"""

from optiplan.arrays import Array
from optiplan.planners.point_to_point.base import PointToPoint, Profile
from optiplan.planners.point_to_point.polynomials import AccelerationOptions, Family, polynomial_profile
from optiplan.problem.problem import Problem
from optiplan.trajectory.profiles.laws import QUINTIC


class Quintic(PointToPoint[AccelerationOptions]):
    """The polynomial above to every goal, until one is good: `PointToPoint.plan` tries them.

    A planner of your own returns a profile of its own: anything with `shortest` and `trajectory(duration)`.
    """

    Options = AccelerationOptions

    end_derivatives = 2

    def profile(self, problem: Problem, goal: Array) -> Profile:
        """The polynomial above from the start to a goal (n,), still of any duration T."""
        family = Family("quintic", QUINTIC, ("velocity", "acceleration"))
        return polynomial_profile(family, self.options, problem, goal)
