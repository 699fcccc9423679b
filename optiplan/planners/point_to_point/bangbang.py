"""`bangbang`: full acceleration, then full deceleration: the least time under acceleration and velocity bounds.

Over a distance D with acceleration a it switches at t_s = sqrt(D / a) and takes 2 t_s, unless the velocity bound comes
between: then it cruises there. The acceleration jumps, so that only a problem with `limits: {jerk: none}` can have it
verified. In a longer duration than the shortest: with the least acceleration that makes it.
"""

from dataclasses import replace

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.option_schema import option
from optiplan.planners.point_to_point.base import SIZE, PointToPoint, Profile, ProfileOptions
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.trajectory.profiles.laws import BangBang
from optiplan.trajectory.profiles.synchronisation import RestToRest


@dataclass(frozen=True)
class BangBangOptions(ProfileOptions):
    """Also bounds on every joint, where they are below the problem's limits."""

    acceleration: float | None = option(None, "rad/s² or m/s²; None is the limit alone.", **SIZE)
    velocity: float | None = option(None, "rad/s or m/s; None is the limit alone.", **SIZE)


class BangBangPlanner(PointToPoint[BangBangOptions]):
    """Planner of bang-bang motions."""

    Options = BangBangOptions

    def profile(self, problem: Problem, goal: Array) -> Profile:
        """The motion from the start to a goal (n,)."""
        o, own = self.options, problem.limits
        velocity = own.velocity if o.velocity is None else np.minimum(own.velocity, o.velocity)
        acceleration = own.acceleration if o.acceleration is None else np.minimum(own.acceleration, o.acceleration)
        limits, names = replace(own, velocity=velocity, acceleration=acceleration), problem.robot.joint_names
        return RestToRest(problem.start, goal, limits, names, lambda _: BangBang(), self.options.motion)
