"""`scurve`: the fastest motion on a straight line in joint space with limited jerk, in exact pieces (Ruckig).

Constant jerk in up to seven phases; where the problem does not limit jerk (`limits: {jerk: none}`), constant
acceleration in up to three. In a longer duration than the shortest: the same curve, stretched.
"""

from optiplan.arrays import Array
from optiplan.planners.point_to_point.base import PointToPoint, Profile, ProfileOptions
from optiplan.problem.problem import Problem
from optiplan.trajectory.profiles.laws import SCurve
from optiplan.trajectory.profiles.synchronisation import RestToRest


class SCurvePlanner(PointToPoint[ProfileOptions]):
    """Planner of jerk-limited S-curves."""

    Options = ProfileOptions

    def profile(self, problem: Problem, goal: Array) -> Profile:
        """The S-curve from the start to a goal (n,)."""
        names = problem.robot.joint_names
        return RestToRest(problem.start, goal, problem.limits, names, lambda _: SCurve(), self.options.motion)
