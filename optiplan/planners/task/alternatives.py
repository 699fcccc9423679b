"""Plan a task with alternatives: every task that they make, of which the quickest is taken."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from optiplan.libraries import clock
from optiplan.planners.base import Budget, Candidate, Failure, Planner, PlanResult, Progress, stages_of
from optiplan.problem.problem import Problem, derived
from optiplan.problem.task.choices import every_task, with_choices

PlanTask = Callable[[Planner[Any], Problem, Budget, Progress], PlanResult]
"""Plans a task without alternatives; see `planner.plan_task`."""


def plan_alternatives(
    plan_task: PlanTask, planner: Planner[Any], problem: Problem, budget: Budget, progress: Progress
) -> PlanResult:
    """Return the motion of the quickest task; those of the others are earlier ones, for where it is refused.

    Each has an even share of the time that is left. `info` says of every task what of each choice was taken, counted
    from 1, and its duration, or why there is none.
    """
    tasks, began = list(every_task(problem.task)), clock()
    found: list[tuple[PlanResult, dict[int, int], float]] = []
    told: list[dict[str, Any]] = []
    for k, taken in enumerate(tasks):
        own = derived(problem, task=with_choices(problem.task, taken))
        result = plan_task(planner, own, budget.share(1.0 / (len(tasks) - k)), stages_of(progress))
        said = {"alternatives": [one + 1 for one in taken.values()]}
        if result.trajectory is None:
            failure = result.failure
            told.append({**said, "failure": "" if failure is None else f"{failure.kind}: {failure.detail}"})
        else:
            told.append({**said, "duration": result.trajectory.duration})
        found.append((result, taken, clock() - began))
        if budget.over:
            break
    cut_short = len(found) < len(tasks) or any(result.info.get("cut_short", False) for result, *_ in found)
    solved = sorted((one for one in found if one[0].trajectory is not None), key=_duration, reverse=True)
    info = {"either": told, "cut_short": cut_short}
    if not solved:
        return PlanResult(None, _none([result for result, *_ in found], len(tasks)), {}, info)
    best = solved[-1][0]
    earlier = tuple(Candidate(one.trajectory, seconds) for one, _, seconds in solved[:-1] if one.trajectory is not None)
    return replace(best, info={**best.info, **info}, earlier=(*earlier, *best.earlier))


def _duration(one: tuple[PlanResult, dict[int, int], float]) -> float:
    motion = one[0].trajectory
    return float("inf") if motion is None else motion.duration


def _none(results: list[PlanResult], count: int) -> Failure:
    """Return the failure of the task that came farthest, of those tried; `count` are all."""
    failures = [result.failure for result in results if result.failure is not None]
    if not failures:
        return Failure("no-path", "no alternative was found that can be done")
    worst = max(failures, key=lambda one: int(one.witness.get("step", 0)))
    tried = f"{count} alternatives" if len(results) == count else f"{len(results)} alternatives tried, of {count},"
    return replace(worst, detail=f"none of {tried} can be done; of one, {worst.detail}")
