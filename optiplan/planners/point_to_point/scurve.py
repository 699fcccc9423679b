"""`scurve`: the fastest motion on a straight line in joint space with limited jerk, in exact pieces.

Constant jerk in up to seven phases; where the problem does not limit jerk (`limits: {jerk: none}`), constant
acceleration in up to three. In a longer duration than the shortest: the same curve, stretched.
Where the problem states a motion at its ends: each joint's own profile between its states, in one duration for all
(Ruckig).
"""

from optiplan.arrays import Array
from optiplan.planners.option_schema import option_error
from optiplan.planners.point_to_point.base import PointToPoint, Profile, ProfileOptions
from optiplan.problem.problem import Problem
from optiplan.trajectory.profiles.laws import SCurve
from optiplan.trajectory.profiles.state_to_state import BetweenStates
from optiplan.trajectory.profiles.synchronisation import RestToRest


class SCurvePlanner(PointToPoint[ProfileOptions]):
    """Planner of jerk-limited S-curves."""

    Options = ProfileOptions

    end_derivatives = 2

    def profile(self, problem: Problem, goal: Array) -> Profile:
        """The S-curve from the start to a goal (n,).

        Raises:
            InputError: joints that do not rest at an end and are not synchronised.
        """
        names = problem.robot.joint_names
        end = problem.end_states(goal)[0]
        if problem.moving_start or end.v.any() or end.a.any():
            if self.options.motion != "synchronised":
                expected = "synchronised, where the ends are not at rest"
                raise option_error("scurve", "motion", self.options.motion, expected)
            return BetweenStates(problem.start_state, end, problem.limits, names)
        return RestToRest(problem.start, goal, problem.limits, names, lambda _: SCurve(), self.options.motion)
