"""`quintic`: all joints move together along one polynomial of degree five. The planner to read first.

With s = t / T from 0 to 1 and D = q_goal - q_start,

    q(t) = q_start + D (10 s^3 - 15 s^4 + 6 s^5),

which starts and ends at rest with no acceleration. Its largest velocity is 1.875 |D| / T, its largest acceleration
(10 / sqrt(3)) |D| / T^2 and its largest jerk 60 |D| / T^3: T is the smallest that keeps all three within limits.
"""

from dataclasses import dataclass

import numpy as np

from optiplan.arrays import Array
from optiplan.model.collision import CollisionModel
from optiplan.model.robot import Limits
from optiplan.planners.base import Budget, Failure, PlanResult, Progress
from optiplan.planners.failures import out_of_time, too_heavy
from optiplan.planners.goals import ranked_goals
from optiplan.planners.stopwatch import Stopwatch
from optiplan.planners.sweep import Touch, first_contact
from optiplan.planners.timed import within_torque
from optiplan.problem.problem import Problem
from optiplan.trajectory.trajectory import Trajectory

SHAPE = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])  # coefficients of s^0 … s^5
SHORTEST = 1e-3  # s: a trajectory needs some duration, even one that goes nowhere


@dataclass(frozen=True)
class QuinticOptions:
    """Options of `quintic`: `goals`, how many goal configurations to try, the quickest to reach first."""

    goals: int = 8

    def __post_init__(self) -> None:
        if self.goals < 1:
            raise ValueError(f"goals = {self.goals} is not positive")


class Quintic:
    """Straight lines in joint space, tried goal by goal until one is free at all times."""

    def __init__(self, options: QuinticOptions | None = None) -> None:
        self.options = options or QuinticOptions()

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; see `planners.base.Planner`."""
        watch, model = Stopwatch(), CollisionModel(problem.robot, problem.scene)
        with watch.stage("goals"):
            goals = ranked_goals(problem, model, budget, self.options.goals)
        if isinstance(goals, Failure):
            return PlanResult(None, goals, watch.seconds)
        touches: list[Touch] = []
        heavy: Failure | None = None
        for k, goal in enumerate(goals):
            if budget.over:
                return PlanResult(None, out_of_time(budget, "trying straight lines"), watch.seconds)
            progress("straight lines", k / len(goals))
            motion = straight(problem.start, goal, problem.limits, problem.robot.joint_names)
            with watch.stage("collision"):
                touch = first_contact(model, motion)
            if touch is None:
                trajectory = within_torque(model, problem.limits, motion)
                if trajectory is not None:
                    return PlanResult(trajectory, None, watch.seconds, {"goal": k})
                heavy = too_heavy(model.robot, problem.limits, np.array([problem.start, goal]))
            else:
                touches.append(touch)
        if heavy is not None:
            return PlanResult(None, heavy, watch.seconds)
        pair, t = touches[0].contact.pair, touches[0].t
        detail = f"no straight motion to {len(goals)} goals is free: '{pair.name_a}' meets '{pair.name_b}' at {t:.3f} s"
        return PlanResult(None, Failure("collision", detail, touches[0].witness()), watch.seconds)


def straight(start: Array, goal: Array, limits: Limits, joint_names: tuple[str, ...]) -> Trajectory:
    """The polynomial above from start (n,) to goal (n,) in the shortest time that the limits allow."""
    d = np.abs(goal - start)
    acceleration = np.sqrt(10.0 / np.sqrt(3.0) * d / limits.acceleration)
    T = max((1.875 * d / limits.velocity).max(), acceleration.max(), np.cbrt(60.0 * d / limits.jerk).max(), SHORTEST)
    coefficients = np.outer(SHAPE / T ** np.arange(6), goal - start)
    coefficients[0] = start
    return Trajectory(joint_names, np.array([0.0, T]), coefficients[None])
