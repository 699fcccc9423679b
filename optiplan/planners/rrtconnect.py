"""`rrtconnect`: a sampled path to the goal that two trees reach first, shortened, rounded and timed."""

from dataclasses import dataclass

import numpy as np

from optiplan.model.collision import CollisionModel
from optiplan.planners.base import Budget, Failure, PlanResult, Progress
from optiplan.planners.failures import too_heavy
from optiplan.planners.goals import ranked_goals
from optiplan.planners.sampling import SamplingOptions, sample_path
from optiplan.planners.stopwatch import Stopwatch
from optiplan.planners.timed import timed_path
from optiplan.problem.problem import Problem

FINEST = 1e-4
"""Smallest step of the collision checks, rad or m."""


@dataclass(frozen=True)
class RrtConnectOptions:
    """Options of `rrtconnect`.

    Attributes:
        goals: goal configurations that the trees may reach, at most.
        reach: longest tree edge, s at full joint speed.
        step: of the collision checks along an edge, rad or m; what is between is proved at the end.
        attempts: random shortcuts.

    Raises:
        ValueError: a value that is not positive.
    """

    goals: int = 8
    reach: float = 0.4
    step: float = 0.05
    attempts: int = 120

    def __post_init__(self) -> None:
        for name in ("goals", "reach", "step"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ValueError(f"{name} = {getattr(self, name)} is not positive and finite")
        if self.step < FINEST:
            raise ValueError(f"step = {self.step} is below {FINEST}: one edge would take longer than any budget")
        if self.attempts < 0:
            raise ValueError(f"attempts = {self.attempts} is negative")


class RrtConnect:
    """OMPL's RRT-Connect between the start and all goal configurations."""

    def __init__(self, options: RrtConnectOptions | None = None) -> None:
        self.options = options or RrtConnectOptions()

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; see `planners.base.Planner`."""
        watch, model, options = Stopwatch(), CollisionModel(problem.robot, problem.scene), self.options
        progress("goals", 0.0)
        with watch.stage("goals"):
            goals = ranked_goals(problem, model, budget, options.goals)
        if isinstance(goals, Failure):
            return PlanResult(None, goals, watch.seconds)
        progress("sampling", 0.1)
        sampling = SamplingOptions(budget, problem.seed, options.reach, options.step, options.attempts)
        with watch.stage("sampling"):
            path = sample_path(model, problem.start, goals, problem.limits, sampling)
        if isinstance(path, Failure):
            return PlanResult(None, path, watch.seconds)
        progress("timing", 0.7)
        with watch.stage("timing"):
            trajectory = timed_path(model, path.waypoints, problem.limits, budget)
        if trajectory is None:
            return PlanResult(None, too_heavy(problem.robot, problem.limits, path.waypoints), watch.seconds)
        info = {"goal": path.goal_index, "waypoints": len(path.waypoints), "cut_short": budget.over, **path.info}
        return PlanResult(trajectory, None, watch.seconds, info)
