"""`septic`: one polynomial of degree seven a joint, with any velocities, accelerations and jerks at the ends.

From rest to rest, with s = t / T and D = q_goal - q_start:  q(t) = q_start + D (35 s^4 - 84 s^5 + 70 s^6 - 20 s^7).
The jerk starts and ends at 0 as well, at the price of higher peaks: 2.1875 |D| / T in velocity.
"""

from dataclasses import dataclass

from optiplan.arrays import Array
from optiplan.planners.option_schema import option
from optiplan.planners.point_to_point.base import PointToPoint, Profile
from optiplan.planners.point_to_point.polynomials import EndOptions, Family, polynomial_profile
from optiplan.problem.problem import Problem
from optiplan.trajectory.profiles.laws import SEPTIC


@dataclass(frozen=True)
class SepticOptions(EndOptions):
    """Also accelerations and jerks at the ends."""

    start_acceleration: tuple[float, ...] | None = option(None, "rad/s² or m/s², one a joint; None is none.")
    end_acceleration: tuple[float, ...] | None = option(None, "the same at the goal.")
    start_jerk: tuple[float, ...] | None = option(None, "rad/s³ or m/s³, one a joint; None is none.")
    end_jerk: tuple[float, ...] | None = option(None, "the same at the goal.")


class Septic(PointToPoint[SepticOptions]):
    """Planner of septic polynomials."""

    Options = SepticOptions

    end_derivatives = 2

    def profile(self, problem: Problem, goal: Array) -> Profile:
        """The polynomial of degree seven from the start to a goal (n,)."""
        family = Family("septic", SEPTIC, ("velocity", "acceleration", "jerk"))
        return polynomial_profile(family, self.options, problem, goal)
