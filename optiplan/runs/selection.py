"""Select the best candidate of a planner that the verifier accepts."""

import time
from dataclasses import dataclass

from optiplan.planners.base import Budget, Candidate
from optiplan.problem.problem import Problem
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import Report
from optiplan.verify.verify import verify

_CURED_BY_TIME = {"velocity", "acceleration", "jerk", "torque"}
_SLOWER = (1.002, 1.01, 1.03, 1.1)


@dataclass(frozen=True, eq=False)
class Selection:
    """A motion and the verdict on it.

    Attributes:
        trajectory: the shortest motion that is verified; where none is, the planner's own choice.
        slowed: factor on the duration that the planner gave it; above 1 where only that made it hold its limits.
        improvements: (seconds of planning and proving, duration in s) of every verified answer on the way, in order of
            both; one whose proof would have ended after that of a better one is left out.
    """

    trajectory: Trajectory
    report: Report
    slowed: float = 1.0
    improvements: tuple[tuple[float, float], ...] = ()


def best_verified(problem: Problem, candidates: list[Candidate], budget: Budget) -> Selection:
    """Hold candidates, the planner's favourite last, against the verifier.

    One that is refused for a rate or a torque alone is tried again a little slower, unless another candidate is as fast
    as that. The favourite is looked at in any case, everything else while the budget lasts.
    """
    chosen, refused = None, None
    for place in reversed(range(len(candidates))):
        faster = candidates[place]
        other = candidates[place - 1].trajectory.duration if place else float("inf")
        for factor in (1.0, *_SLOWER):
            trajectory = faster.trajectory.scaled(faster.trajectory.duration * factor) if factor > 1.0 else None
            if (trajectory is not None and trajectory.duration >= other) or (refused is not None and budget.over):
                break
            began = time.perf_counter()
            tried = Selection(trajectory or faster.trajectory, verify(problem, trajectory or faster.trajectory), factor)
            seconds = faster.seconds + time.perf_counter() - began
            if tried.report.verified:
                chosen = place, tried, seconds
                break
            refused = refused or tried
            if not {check.name for check in tried.report.checks if not check.passed} <= _CURED_BY_TIME:
                break
        if chosen is not None or (refused is not None and budget.over):
            break
    if chosen is None:
        if refused is None:
            raise ValueError("there are no candidates")
        return refused
    place, answer, seconds = chosen
    before = _verified(problem, candidates[:place], budget)
    now = (seconds, answer.trajectory.duration)
    return Selection(answer.trajectory, answer.report, answer.slowed, _in_turn([*before, now]))


def _verified(problem: Problem, earlier: list[Candidate], budget: Budget) -> list[tuple[float, float]]:
    """Return time and duration of the earlier candidates that are verified."""
    found = []
    for candidate in earlier:
        if budget.over:
            break
        began = time.perf_counter()
        if verify(problem, candidate.trajectory).verified:
            found.append((candidate.seconds + time.perf_counter() - began, candidate.trajectory.duration))
    return found


def _in_turn(answers: list[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    """Keep those of (seconds, duration) that were not proved after a better one, in order."""
    kept: list[tuple[float, float]] = []
    for answer in reversed(answers):
        if not kept or answer[0] < kept[-1][0]:
            kept.append(answer)
    return tuple(reversed(kept))
