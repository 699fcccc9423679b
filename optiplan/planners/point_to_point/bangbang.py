"""`bangbang`: full acceleration, then full deceleration: the least time under acceleration and velocity bounds.

Over a distance D with acceleration a it switches at t_s = sqrt(D / a) and takes 2 t_s, unless the velocity bound comes
between: then it cruises there. The acceleration jumps, so that only a problem with `limits: {jerk: none}` can have it
verified. In a longer duration than the shortest: with the least acceleration that makes it.
"""

from dataclasses import dataclass, replace

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.point_to_point.base import PointToPoint, Profile, ProfileOptions, require_size
from optiplan.problem.problem import Problem
from optiplan.trajectory.profiles.laws import BangBang
from optiplan.trajectory.profiles.synchronisation import RestToRest


@dataclass(frozen=True)
class BangBangOptions(ProfileOptions):
    """Also bounds on every joint, where they are below the problem's limits.

    Attributes:
        acceleration: rad/s² or m/s²; None is the limit alone.
        velocity: rad/s or m/s; None is the limit alone.
    """

    acceleration: float | None = None
    velocity: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        require_size("acceleration", self.acceleration)
        require_size("velocity", self.velocity)


class BangBangPlanner(PointToPoint[BangBangOptions]):
    """Planner of bang-bang motions."""

    def profile(self, problem: Problem, goal: Array) -> Profile:
        """The motion from the start to a goal (n,)."""
        given = {"acceleration": self.options.acceleration, "velocity": self.options.velocity}
        bounds = {k: np.minimum(getattr(problem.limits, k), v) for k, v in given.items() if v is not None}
        limits, names = replace(problem.limits, **bounds), problem.robot.joint_names
        return RestToRest(problem.start, goal, limits, names, lambda _: BangBang(), self.options.motion)
