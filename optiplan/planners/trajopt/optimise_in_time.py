"""Optimise curves among dynamic obstacles: contacts at sample u are those at the time u T."""

from dataclasses import replace
from typing import Any

import numpy as np

from optiplan.collision.kept_models import kept_planning_model
from optiplan.libraries import clock
from optiplan.planners.base import Budget, Failure, Planner, PlanResult, Progress, stages_of
from optiplan.planners.common.dynamic_obstacles import delayed, without_dynamic_obstacles
from optiplan.planners.common.incumbent import Incumbent
from optiplan.planners.trajopt.initial_guess import with_bump
from optiplan.planners.trajopt.nonzero_end_optimiser import (
    EXACT,
    LONGEST,
    STRETCHES,
    EndStates,
    NonzeroEndOptimiser,
    torque_ratio,
    with_reserve,
)
from optiplan.planners.trajopt.optimizer import Attempt, Optimiser, attempt_record
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.problem.problem import Problem
from optiplan.trajectory.timing.time_scaling import speed_ratio
from optiplan.trajectory.trajectory import Trajectory

_STATIC, _AGAIN, _DELAYS = 0.3, 0.8, 0.3
"""Share of the budget for the motion among static obstacles; of the rest for the same, where none was found by then;
and of what is left for waiting and slowing down.
"""

_BUMPS = 6
"""Number of further curves, from the best with a bump."""

_CLOSE = 1.01
"""Cost / cost of the motion among static obstacles up to which no further curve is tried."""


class TimedOptimiser(NonzeroEndOptimiser):
    """Optimise curves whose duration is part of the answer: none is made faster afterwards."""

    def timed(self, control: Any, duration: float) -> Trajectory | None:
        """Return the curve in the least duration from this one on within limits and torques; None without one."""
        limits, T = self.problem.limits, duration
        for _ in range(STRETCHES):
            curve = self.curve(control, T)
            ratio = max(speed_ratio(curve, limits), torque_ratio(self.problem, curve))
            if ratio <= 1.0 + EXACT:
                return curve
            T *= ratio * (1.0 + 1e-9)
            if not T <= LONGEST * duration:
                return None
        return None


def optimise_in_time(
    planner: Planner[TrajOptOptions], problem: Problem, budget: Budget, progress: Progress
) -> PlanResult:
    """Plan among static obstacles, wait or slow down for the dynamic ones, and optimise curves in time.

    The guesses of these curves: the motion among static obstacles, the one that waits, and the best with a bump.
    """
    began, incumbent = clock(), Incumbent(problem, progress)
    still, stages, part = without_dynamic_obstacles(problem), stages_of(progress), budget.share(_STATIC)
    static = planner.plan(still, part, stages)
    if static.trajectory is None and part.over and not budget.over:
        static = planner.plan(still, budget.share(_AGAIN), stages)
    if static.trajectory is None:
        return static
    model = kept_planning_model(problem.robot, problem.scene, problem.tracking_error)
    waiting = delayed(problem, [static.trajectory], model, budget.share(_DELAYS))
    cut_short = bool(static.info.get("cut_short", False))
    info: dict[str, Any] = {"attempts": [*static.info.get("attempts", ())], "cut_short": cut_short}
    if not isinstance(waiting, Failure):
        incumbent.offer(waiting.motion)
        info |= {"waited": waiting.wait, "slower": waiting.slower}
    seeds = [static.trajectory] if isinstance(waiting, Failure) else [static.trajectory, waiting.motion]
    if incumbent.cost > _CLOSE * problem.cost(static.trajectory):
        optimiser = Optimiser(with_reserve(problem), model, planner.options)
        info["attempts"] += _curves(optimiser, seeds, incumbent, budget)
    info["cut_short"] |= budget.over
    timings = {**static.timings, "in time": clock() - began - sum(static.timings.values())}
    failure = waiting if isinstance(waiting, Failure) else None
    return replace(incumbent.result(info, failure), timings=timings)


def _curves(
    optimiser: Optimiser, seeds: list[Trajectory], incumbent: Incumbent, budget: Budget
) -> list[dict[str, Any]]:
    """Optimise in time from these motions, then from the best with a bump; offer free ones, return the attempts.

    A curve that costs hardly more than the first motion ends it early.
    """
    problem, attempts = incumbent.problem, list[dict[str, Any]]()
    enough = _CLOSE * problem.cost(seeds[0])
    end = seeds[0].state(seeds[0].duration)
    curves = TimedOptimiser(problem, optimiser, EndStates(problem.start_state, end))
    best: Attempt | None = None
    rng = np.random.default_rng(problem.seed)
    guesses = [(curves.along(motion), motion.duration) for motion in seeds]
    for k in range(len(seeds) + _BUMPS):
        if budget.over or (best is not None and problem.cost(best.trajectory) <= enough):
            break
        if k >= len(seeds):
            base, T = guesses[0] if best is None else (best.control, best.trajectory.duration)
            guesses.append((with_bump(optimiser.basis, base, T, problem.limits, rng), T))
        attempt = curves.run(*guesses[k], budget)
        attempts.append(attempt_record("in time", attempt, optimiser.taken, optimiser.log))
        if attempt is not None and attempt.free:
            incumbent.offer(attempt.trajectory)
            if best is None or attempt.trajectory.duration < best.trajectory.duration:
                best = attempt
    return attempts
