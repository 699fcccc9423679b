"""Plan a task: choose, plan and time its steps, and join them to one motion."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from optiplan.libraries import clock
from optiplan.planners.base import Budget, Failure, Planner, PlanResult, Progress
from optiplan.planners.common.context import Stopwatch
from optiplan.planners.common.dynamic_obstacles import without_dynamic_obstacles
from optiplan.planners.common.incumbent import Incumbent
from optiplan.planners.task.alternatives import plan_alternatives
from optiplan.planners.task.beside import one_after_another, quickest_beside
from optiplan.planners.task.join_steps import join_steps
from optiplan.planners.task.optimisation.stretch_optimiser import optimised
from optiplan.planners.task.planned_steps import Group, Pause, Stretch, TaskPart, joined_parts
from optiplan.planners.task.rides.in_time import TaskInTime
from optiplan.planners.task.sections import SectionPlanner
from optiplan.planners.task.stops import stops_of
from optiplan.planners.task.via_moves import ViaMoves, unsupported
from optiplan.planners.task.waiting import waiting
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.problem.problem import Problem
from optiplan.problem.seams.actions import SeamPart, Transit
from optiplan.problem.task.arms import several_arms
from optiplan.problem.task.choices import choices_of

_JOINING = 0.3
"""Share of the remaining time for joining curves; the rest is for optimising them together."""

_STANDING, _DELAYING = 0.85, 0.5
"""Where obstacles move: share of the time for planning among those that stand, and of what is left for delaying the
steps as they are.
"""

_BESIDE = 0.3
"""Share of the time after joining that is kept for putting steps of several arms into time."""

_PIECE, _LONG = 4, 6
"""Steps optimised together at first, where there are more than the second number between two stops."""


def plan_task(planner: Planner[Any], problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
    """Plan a task, or past vias: first a motion that stops after every step, then one that does not.

    Args:
        planner: plans the moves.
        problem: with a task, or with vias and a planner that `joins_legs`.
        budget: time for all of it.
        progress: called with the stages, and with each better motion.
    """
    if choices_of(problem.task):
        return plan_alternatives(plan_task, planner, problem, budget, progress)
    refused = unsupported(problem, planner)
    if refused is not None:
        return PlanResult(None, refused)
    if any(step.timed for step in problem.task):
        return TaskInTime(problem, planner, plan_task, budget, progress).run()
    stated, problem = problem, one_after_another(problem)
    began, watch, moves = clock(), Stopwatch(), ViaMoves.of(problem, planner)
    incumbent = Incumbent(stated, progress, watch, began)
    waits = bool(problem.scene.dynamic_obstacles)

    beside = several_arms(problem.task)

    def offer(way: Sequence[TaskPart], in_a_row: bool = False) -> float:
        """Offer the motion of these parts; return its duration, s."""
        motion = moves.motion(joined_parts(moves.problem, way))
        if beside:
            with watch.stage("arms"):
                motion = quickest_beside(moves, () if in_a_row else way, motion, budget)
        incumbent.offer(motion)
        return motion.duration

    still = without_dynamic_obstacles(moves.problem)
    time = budget.share(_STANDING) if waits else budget
    sections = SectionPlanner(still, planner, time, progress, (lambda _: None) if waits else offer)
    parts = sections.run(watch)
    if isinstance(parts, Failure):
        return PlanResult(None, moves.failure(parts), watch.seconds)
    info: dict[str, Any] = {"moves": sections.moves, **sections.info}
    if waits:
        with watch.stage("waiting"):
            found = _wait_for_obstacles(moves, planner, parts, incumbent, budget, progress)
        cut_short = info["cut_short"] or found.info["cut_short"]
        return replace(found, timings=watch.seconds, info={**info, **found.info, "cut_short": cut_short})
    info["duration_with_stops"] = offer(parts, in_a_row=True)
    with watch.stage("flow"):
        joining = budget.share(_JOINING)
        groups = join_steps(parts, joining, progress, thorough=not _timed_only(problem))
        info["cut_short"] |= joining.over
    info["duration_joined"] = offer(_flat(groups))
    with watch.stage("optimisation"):
        time = budget.share(1.0 - _BESIDE) if beside else budget
        for whole in _optimised(problem, planner, groups, time, progress):
            offer(whole)
    info["cut_short"] |= time.over
    info |= {} if beside else {"stops": stops_of(whole)}
    info["stops_left_out"] = len(parts) - len(whole)
    return incumbent.result(info)


def _optimised(
    problem: Problem, planner: Planner[Any], groups: Sequence[Group], budget: Budget, progress: Progress
) -> Iterator[list[TaskPart]]:
    """Yield the parts, each group optimised as one motion where only time counts.

    Long groups are optimised in pieces first: a better motion is there early, and the optimisation of the group
    starts from it.
    """
    options = planner.options if isinstance(planner.options, TrajOptOptions) else TrajOptOptions()
    found = list(groups)
    for most in (_PIECE, None):
        for k, group in enumerate(found):
            progress("optimising steps together", k / len(groups))
            if (
                isinstance(group, Pause)
                or _is_fixed(group)
                or not _timed_only(problem)
                or (most is not None and _count(group) <= _LONG)
            ):
                continue
            better: list[Stretch] = []
            for piece in _pieces(group, most):
                better += piece if budget.over or _count(piece) == 1 else optimised(piece, options, budget)
            found[k] = better
        yield _flat(found)


def _is_fixed(group: list[Stretch]) -> bool:
    """Whether a group is a path, whose motion is found already."""
    return isinstance(group[0].steps[0].step.action, Transit | SeamPart)


def _flat(groups: Sequence[Group]) -> list[TaskPart]:
    return [part for group in groups for part in (group if isinstance(group, list) else [group])]


def _pieces(stretches: list[Stretch], most: int | None) -> list[list[Stretch]]:
    """Cut stretches into pieces of `most` steps, or more where one stretch has more; None: one piece."""
    pieces: list[list[Stretch]] = [[]]
    for stretch in stretches:
        if most is not None and pieces[-1] and _count([*pieces[-1], stretch]) > most:
            pieces.append([])
        pieces[-1].append(stretch)
    return pieces


def _count(stretches: Sequence[Stretch]) -> int:
    return sum(len(stretch.steps) for stretch in stretches)


def _timed_only(problem: Problem) -> bool:
    """Whether only time counts, so that steps are optimised together."""
    return problem.objective.weights.keys() == {"time"}


def _wait_for_obstacles(
    moves: ViaMoves,
    planner: Planner[Any],
    parts: list[TaskPart],
    incumbent: Incumbent,
    budget: Budget,
    progress: Progress,
) -> PlanResult:
    """Delay the steps one by one until dynamic obstacles have passed; then join them, and delay what is joined."""
    problem, info, began = moves.problem, dict[str, Any](), clock()

    def offer(way: Sequence[TaskPart], time: Budget) -> Failure | None:
        """Offer the motion of these parts, delayed; return why there is none."""
        passed = waiting(problem, way, time)
        if isinstance(passed, Failure):
            return passed
        if incumbent.offer(moves.motion(joined_parts(problem, passed))):
            waited = sum(b.duration - a.duration for a, b in zip(way, passed, strict=True))
            info.update(waited=waited, stops=stops_of(passed))
        return None

    failure = offer(parts, budget.share(_DELAYING))
    time = budget.leaving(clock() - began)  # what is joined takes as long to delay
    joining = time.share(_JOINING)
    groups = join_steps(parts, joining, progress, thorough=not _timed_only(problem))
    info["cut_short"] = joining.over
    *_, together = _optimised(problem, planner, groups, time, progress)
    late = offer(together, budget)
    info["cut_short"] |= time.over
    failure = late if failure is not None and failure.kind == "budget" else failure
    return incumbent.result(info, moves.failure(failure))
