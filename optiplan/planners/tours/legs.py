"""Motions between the configurations of a tour: straight in the joints where that is free, else planned."""

from dataclasses import field
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.base import Budget, Failure, Planner, Progress
from optiplan.planners.common.failures import out_of_time
from optiplan.planners.common.path_timing import within_torque
from optiplan.planners.common.tolerances import NO_MOTION
from optiplan.planners.common.via_legs import plan_through
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.problem.goals_and_vias import ExactGoal
from optiplan.problem.problem import Problem, derived
from optiplan.records import dataclass
from optiplan.trajectory.profiles.laws import SCurve
from optiplan.trajectory.profiles.synchronisation import RestToRest
from optiplan.trajectory.trajectory import Trajectory

Numbers = tuple[int, int]
"""Numbers of the configurations in which a leg begins and ends."""

_MOST = 3.0
"""s of planning for one leg."""


@dataclass(eq=False)
class TourLegs:
    """Legs of one tour, each made once.

    Attributes:
        problem: of the joints that move, from rest to rest.
        check: of straight motions.
        planner: of legs whose straight motion is not free, or where path constraints hold.
    """

    problem: Problem
    check: MotionCheck
    planner: Planner[Any]
    progress: Progress
    planned: int = 0
    _free: dict[Numbers, bool] = field(default_factory=dict)
    _motions: dict[Numbers, Trajectory | Failure] = field(default_factory=dict)

    def straight(self, numbers: Numbers, a: Array, b: Array) -> bool:
        """Return whether the straight motion between two configurations (n,) is proved free, and nothing else holds."""
        if self.problem.path_constraints:
            return False
        if numbers not in self._free:
            self._free[numbers] = self.check.free(a, b)
        return self._free[numbers]

    def motion(self, numbers: Numbers, a: Array, b: Array, budget: Budget) -> Trajectory | Failure | None:
        """Return the motion between two configurations (n,), or why there is none; None where they are the same."""
        if np.abs(b - a).max() <= NO_MOTION:
            return None
        if numbers not in self._motions:
            straight = self._straight_motion(a, b) if self.straight(numbers, a, b) else None
            found = straight or self._planned_motion(a, b, budget)
            if isinstance(found, Failure) and found.kind in ("budget", "cancelled"):
                return found
            self._motions[numbers] = found
        return self._motions[numbers]

    def _straight_motion(self, a: Array, b: Array) -> Trajectory | None:
        """Return the fastest motion on the straight line; None where gravity alone takes more torque than allowed."""
        limits, robot = self.problem.limits, self.problem.robot
        motion = RestToRest(a, b, limits, robot.joint_names, lambda _: SCurve()).trajectory()
        return within_torque(robot, limits, motion)

    def _planned_motion(self, a: Array, b: Array, budget: Budget) -> Trajectory | Failure:
        self.planned += 1
        own = derived(self.problem, start=a, goal=(ExactGoal(b),))
        share = budget.share(min(1.0, _MOST / max(budget.remaining, 1e-9)))
        result = None if budget.over else plan_through(self.planner, own, share, self.progress)
        if result is not None and result.trajectory is not None:
            return result.trajectory
        if result is None or budget.over:  # what a planner says without time is no reason
            return out_of_time(budget, "planning this motion, which is not free on a straight line of the joints")
        return result.failure or Failure("no-path", "no motion was found")
