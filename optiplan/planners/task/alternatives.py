"""Plan a task with alternatives: every task that they make, of which the quickest is taken."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from optiplan.libraries import clock
from optiplan.planners.base import Budget, Candidate, Failure, Planner, PlanResult, Progress, announce
from optiplan.problem.problem import Problem, derived
from optiplan.problem.task.choices import every_task, with_choices
from optiplan.trajectory.trajectory import Trajectory

PlanTask = Callable[[Planner[Any], Problem, Budget, Progress], PlanResult]
"""Plans a task without alternatives; see `planner.plan_task`."""


class _Quicker:
    """The progress of one task: its stages, and its motions that are quicker than those of the tasks before it."""

    def __init__(self, progress: Progress, least: float) -> None:
        self._progress, self._least = progress, least

    def __call__(self, stage: str, fraction: float) -> None:
        self._progress(stage, fraction)

    def found(self, motion: Trajectory, _: float) -> None:
        """Tell of a motion; a bound on those of one task is none on the others."""
        if motion.duration < self._least:
            announce(self._progress, motion)


def plan_alternatives(
    plan_task: PlanTask, planner: Planner[Any], problem: Problem, budget: Budget, progress: Progress
) -> PlanResult:
    """Return the motion of the quickest task; those of the others are earlier ones, for where it is refused.

    Each has an even share of the time that is left. `info` says of every task what of each choice was taken, counted
    from 1, and its duration, or why there is none.
    """
    tasks, began = list(every_task(problem.task)), clock()
    results: list[PlanResult] = []
    motions: list[Candidate] = []
    told: list[dict[str, Any]] = []
    best: tuple[PlanResult, Candidate] | None = None
    for k, taken in enumerate(tasks):
        own, since = derived(problem, task=with_choices(problem.task, taken)), clock() - began
        least = min((one.trajectory.duration for one in motions), default=float("inf"))
        result = plan_task(planner, own, budget.share(1.0 / (len(tasks) - k)), _Quicker(progress, least))
        results.append(result)
        said = {"alternatives": [one + 1 for one in taken.values()]}
        if result.trajectory is None:
            failure = result.failure
            told.append({**said, "failure": "" if failure is None else f"{failure.kind}: {failure.detail}"})
        else:
            told.append({**said, "duration": result.trajectory.duration})
            seconds = clock() - began if result.seconds is None else since + result.seconds
            last = Candidate(result.trajectory, seconds)
            better = [one for one in result.earlier if one.trajectory.duration < least]
            motions += [*(replace(one, seconds=since + one.seconds) for one in better), last]
            if best is None or last.trajectory.duration < best[1].trajectory.duration:
                best = result, last
        if budget.over:
            break
    cut_short = len(results) < len(tasks) or any(result.info.get("cut_short", False) for result in results)
    info = {"either": told, "cut_short": cut_short}
    if best is None:
        return PlanResult(None, _none(results, len(tasks)), {}, info)
    result, last = best
    earlier = [one for one in motions if one is not last and one.trajectory.duration >= last.trajectory.duration]
    earlier.sort(key=lambda one: one.trajectory.duration, reverse=True)
    return replace(result, info={**result.info, **info}, earlier=tuple(earlier), seconds=last.seconds)


def _none(results: list[PlanResult], count: int) -> Failure:
    """Return the failure of the task that came farthest, of those tried; `count` are all."""
    failures = [result.failure for result in results if result.failure is not None]
    if not failures:
        return Failure("no-path", "no alternative was found that can be done")
    worst = max(failures, key=lambda one: int(one.witness.get("step", 0)))
    tried = f"{count} alternatives" if len(results) == count else f"{len(results)} alternatives tried, of {count},"
    return replace(worst, detail=f"none of {tried} can be done; of one, {worst.detail}")
