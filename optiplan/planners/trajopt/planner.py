"""`trajopt`: seeds, optimisation of each, and the best trajectory that is free at all times."""

from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.model.collision import CollisionModel
from optiplan.planners.base import Budget, Failure, PlanResult, Progress
from optiplan.planners.failures import out_of_time, too_heavy
from optiplan.planners.goals import ranked_goals
from optiplan.planners.sampling import SampledPath, SamplingOptions, sample_path
from optiplan.planners.stopwatch import Stopwatch
from optiplan.planners.sweep import Touch
from optiplan.planners.timed import timed_path
from optiplan.planners.trajopt.attempt import Optimiser
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.planners.trajopt.seeds import along_path
from optiplan.problem.problem import Problem
from optiplan.trajectory.timing import lower_bounds, stop_at_corners
from optiplan.trajectory.trajectory import Trajectory

_PATIENCE = 0.05
"""With every sampled seed tried, this much more of the lower bound is good enough."""

_EARLY = 1.0 / 3.0
"""Share of the budget after which straight lines that led to nothing must leave the rest to sampled paths."""

_SAME, _FAMILIAR = 1.01, 0.1
"""Durations within 1 % are one local optimum; found again, it is good enough at 10 % more of the lower bound."""


class TrajOpt:
    """Minimum-time B-splines by sequential quadratic programming, from straight lines and sampled paths.

    Goals are tried in the order of their lower bounds, first along straight lines; sampled paths follow until one
    result is within `good_enough` of the bound. Where no optimised curve is free, the sampled path itself is timed and
    returned, so that an answer is given whenever a path was found.
    """

    def __init__(self, options: TrajOptOptions | None = None) -> None:
        self.options = options or TrajOptOptions()

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; see `planners.base.Planner`."""
        return _Run(problem, budget, progress, self.options).result()


class _Run:
    """The state of one call: stages timed, the best trajectory so far, the reason why there is none."""

    def __init__(self, problem: Problem, budget: Budget, progress: Progress, options: TrajOptOptions) -> None:
        self.problem, self.budget, self.progress, self.options = problem, budget, progress, options
        self.watch = Stopwatch()
        self.info: dict[str, Any] = {"attempts": [], "cut_short": False}
        self.best: Trajectory | None = None
        self.touching: Touch | None = None
        self.least = 0.0
        with self.watch.stage("set-up"):
            self.model = CollisionModel(problem.robot, problem.scene)
            self.optimiser = Optimiser(problem, self.model, options)

    def result(self) -> PlanResult:
        """Search, and put what came of it into words."""
        failure = self._search()
        self.info["cut_short"] |= self.budget.over
        if self.best is not None:
            return PlanResult(self.best, None, self.watch.seconds, self.info)
        if self.budget.cancelled:
            failure = out_of_time(self.budget, "looking for a trajectory")
        return PlanResult(None, failure, self.watch.seconds, self.info)

    def _search(self) -> Failure | None:
        problem, start = self.problem, self.problem.start
        with self.watch.stage("goals"):
            goals = ranked_goals(problem, self.model, self.budget)
        if isinstance(goals, Failure):
            return goals
        bounds = lower_bounds(start, np.array(goals), problem.limits)
        if bounds[0] == 0.0:
            self.best = stop_at_corners(np.array([start, goals[0]]), problem.limits, problem.robot.joint_names)
            return None
        self.least, early = float(bounds[0]), self.budget.share(_EARLY)
        for goal, bound in list(zip(goals, bounds, strict=True))[: self.options.straight_goals]:
            budget = early if self.best is None else self.budget
            if not budget.over and not self._done(max(float(bound), self.options.good_enough * self.least)):
                self._attempt("straight", np.array([start, goal]), budget)
        self.info["cut_short"] = early.over
        return self._from_sampled_paths(goals)

    def _from_sampled_paths(self, goals: list[Array]) -> Failure | None:
        shortest: SampledPath | None = None
        failure: Failure | None = None
        for number in range(self.options.seeds):
            if self._done(self.least * (self.options.good_enough + _PATIENCE * number + _FAMILIAR * self._repeats())):
                break
            with self.watch.stage("sampling"):
                options = SamplingOptions(self.budget, seed=self.problem.seed * 1000 + number)
                path = sample_path(self.model, self.problem.start, goals, self.problem.limits, options)
            if isinstance(path, Failure):
                failure = path
                break
            if shortest is None or path.cost < shortest.cost:
                shortest = path
            self._attempt("sampled", path.waypoints, self.budget)
        if self.best is None and shortest is not None:
            return self._time_path(shortest.waypoints)
        return failure if failure is not None else self._why_not()

    def _time_path(self, waypoints: Array) -> Failure | None:
        """No optimised curve is free, but the sampled path is: time it as it is."""
        with self.watch.stage("timing of the sampled path"):
            self.best = timed_path(self.model, waypoints, self.problem.limits, self.budget)
        self.info["fallback"] = "sampled path"
        return too_heavy(self.problem.robot, self.problem.limits, waypoints) if self.best is None else None

    def _attempt(self, kind: str, waypoints: Array, budget: Budget) -> None:
        self.progress("optimisation", len(self.info["attempts"]) / (self.options.seeds + self.options.straight_goals))
        with self.watch.stage("optimisation"):
            velocity = self.problem.limits.velocity
            attempt = self.optimiser.run(along_path(self.optimiser.basis, waypoints, velocity), budget)
        entry: dict[str, Any] = {"seed": kind, "free": attempt is not None and attempt.touch is None}
        if attempt is not None:
            entry |= {"duration": attempt.trajectory.duration, "iterations": attempt.iterations}
        self.info["attempts"].append(entry)
        if attempt is None:
            return
        if attempt.touch is not None:
            self.touching = attempt.touch
        elif self.best is None or attempt.trajectory.duration < self.best.duration:
            self.best = attempt.trajectory

    def _repeats(self) -> int:
        """How often the best local optimum was found again."""
        best = self.best.duration if self.best is not None else np.inf
        found = [a["duration"] for a in self.info["attempts"] if a["free"] and a["duration"] <= _SAME * best]
        return max(0, len(found) - 1)

    def _done(self, enough: float) -> bool:
        """Out of time, or there is a trajectory of at most `enough` s."""
        return self.budget.over or (self.best is not None and self.best.duration <= enough)

    def _why_not(self) -> Failure:
        detail = f"no free trajectory within {self.budget.seconds:.3g} s"
        if self.touching is None:
            return Failure("budget", detail)
        pair = self.touching.contact.pair
        detail += f"; the best attempt touches: '{pair.name_a}' and '{pair.name_b}' at t = {self.touching.t:.3f} s"
        return Failure("collision", detail, self.touching.witness())
