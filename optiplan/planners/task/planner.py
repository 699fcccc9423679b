"""Plan a task: choose, plan and time its steps, and join them to one motion."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.libraries import clock
from optiplan.planners.base import (
    Budget,
    Failure,
    Planner,
    PlanResult,
    Progress,
    stages_of,
)
from optiplan.planners.common.dynamic_obstacles import without_dynamic_obstacles
from optiplan.planners.common.failures import too_heavy
from optiplan.planners.common.incumbent import Incumbent
from optiplan.planners.common.stopwatch import Stopwatch
from optiplan.planners.task.chains import PlannedStep, of_step
from optiplan.planners.task.join_steps import join_steps
from optiplan.planners.task.line_timing import line_limits, timed_line
from optiplan.planners.task.optimisation.stretch_optimiser import optimised
from optiplan.planners.task.search import TaskSearch
from optiplan.planners.task.stops import stops_of
from optiplan.planners.task.stretches import Stretch
from optiplan.planners.task.via_moves import ViaMoves, unsupported
from optiplan.planners.task.waiting import waiting
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.problem.problem import Problem
from optiplan.problem.task.steps import Attach, Detach, Dwell
from optiplan.robot.robot import Robot
from optiplan.trajectory.joining import join_trajectories, standstill
from optiplan.trajectory.segments import Segment
from optiplan.trajectory.trajectory import Trajectory

_JOINING = 0.3
"""Share of the time that is left for joining curves as they are; the rest is for optimising them together."""

_PIECE, _LONG = 4, 6
"""Steps that are optimised together at first, where there are more than so many between two stops."""


def plan_task(planner: Planner[Any], problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
    """Plan a task, or past vias: first a motion that stops after every step, then one that does not.

    Args:
        planner: plans the moves.
        problem: with a task, or with vias and a planner that `joins_legs`.
        budget: time for all of it.
        progress: called with the stages, and with each better motion.
    """
    refused = unsupported(problem, planner)
    if refused is not None:
        return PlanResult(None, refused)
    began, watch, moves = clock(), Stopwatch(), ViaMoves.of(problem, planner)
    search = TaskSearch(without_dynamic_obstacles(moves.problem), planner, budget, stages_of(progress))
    stretches = _stopping(search, budget, watch)
    if isinstance(stretches, Failure):
        return PlanResult(None, moves.failure(stretches), watch.seconds)
    if problem.scene.dynamic_obstacles:
        with watch.stage("waiting"):
            found = _wait_for_obstacles(moves, planner, stretches, budget, progress)
        return replace(found, timings=watch.seconds, info={"moves": search.infos, **found.info})
    incumbent = Incumbent(problem, progress, watch, began)

    def offer(way: Sequence[Stretch]) -> float:
        """Offer a way to do the steps; return its duration, s."""
        motion = moves.motion(joined_stretches(moves.problem, way))
        incumbent.offer(motion)
        return motion.duration

    info: dict[str, Any] = {"moves": search.infos, "attempts": search.attempts}
    info["duration_with_stops"] = offer(stretches)
    with watch.stage("flow"):
        groups = join_steps(stretches, budget.share(_JOINING), progress, thorough=not _timed_only(problem))
    info["duration_joined"] = offer([one for group in groups for one in group])
    with watch.stage("optimisation"):
        for whole in _optimised(problem, planner, groups, budget, progress):
            offer(whole)
    info |= {"cut_short": search.cut_short or budget.over, "stops": stops_of(whole)}
    info["stops_left_out"] = len(stretches) - len(whole)
    return incumbent.result(info)


def _stopping(search: TaskSearch, budget: Budget, watch: Stopwatch) -> list[Stretch] | Failure:
    """Return all steps one by one, from rest to rest."""
    with watch.stage("steps"):
        done = search.run()
    if isinstance(done, Failure):
        return done
    with watch.stage("timing"):
        timed = [_timed(one, budget) for one in done]
    failed = next((one for one in timed if isinstance(one, Failure)), None)
    if failed is not None:
        return failed
    return [Stretch.of(a, b) for a, b in zip(done, timed, strict=True) if not isinstance(b, Failure)]


def _optimised(
    problem: Problem, planner: Planner[Any], groups: Sequence[list[Stretch]], budget: Budget, progress: Progress
) -> Iterator[list[Stretch]]:
    """Yield the stretches, what lies between two stops optimised as one where time is all that counts.

    Long groups are optimised in pieces first: there is a better motion early, and the whole begins with it.
    """
    options = planner.options if isinstance(planner.options, TrajOptOptions) else TrajOptOptions()
    ways = [list(group) for group in groups]
    for most in (_PIECE, None):
        for k, way in enumerate(ways):
            progress("optimising steps together", k / len(groups))
            if not _timed_only(problem) or (most is not None and _steps(way) <= _LONG):
                continue
            pieces = _pieces(way, most)
            ways[k] = [
                one
                for piece in pieces
                for one in (piece if budget.over or _steps(piece) == 1 else optimised(piece, options, budget))
            ]
        yield [one for way in ways for one in way]


def _pieces(stretches: list[Stretch], most: int | None) -> list[list[Stretch]]:
    """Cut stretches into pieces of `most` steps, or more where one stretch has more; None: one piece."""
    pieces: list[list[Stretch]] = [[]]
    for stretch in stretches:
        if most is not None and pieces[-1] and _steps([*pieces[-1], stretch]) > most:
            pieces.append([])
        pieces[-1].append(stretch)
    return pieces


def _steps(stretches: Sequence[Stretch]) -> int:
    return sum(len(stretch.done) for stretch in stretches)


def _timed_only(problem: Problem) -> bool:
    """Whether only time counts, so that steps are optimised together."""
    return problem.objective.weights.keys() == {"time"}


def _wait_for_obstacles(
    moves: ViaMoves, planner: Planner[Any], stretches: list[Stretch], budget: Budget, progress: Progress
) -> PlanResult:
    """Let what moves pass: of the steps as one where that is quicker, or else of them one by one."""
    problem = moves.problem
    groups = join_steps(stretches, budget, progress, thorough=not _timed_only(problem))
    failure: Failure | None = None
    *_, together = _optimised(problem, planner, groups, budget, progress)
    for way in (together, stretches):
        passed = waiting(problem, way, budget)
        if not isinstance(passed, Failure):
            waited = sum(b.ends[-1] - a.ends[-1] for a, b in zip(way, passed, strict=True))
            motion = moves.motion(joined_stretches(problem, passed))
            return PlanResult(motion, None, {}, {"waited": waited, "stops": stops_of(passed)})
        failure = passed
    return PlanResult(None, moves.failure(failure))


def _timed(done: PlannedStep, budget: Budget) -> "Trajectory | float | Failure":
    """Return the motion of a step, of its joints; or how long it stands still, s."""
    if isinstance(done.step.action, Dwell):
        return done.step.action.seconds
    if done.stage is None or done.curve is None:
        return 0.0
    if not done.is_line:
        return done.curve
    motion = timed_line(done.stage, done.curve, line_limits(done), budget)
    if motion is None:
        problem, curve = done.stage.problem, done.curve
        heavy = too_heavy(problem.robot, problem.limits, curve(np.linspace(0.0, curve.duration, 200)))
        return of_step(heavy, done.step, done.before, done.stage.problem.robot, done.stage)
    return motion


def joined_stretches(problem: Problem, stretches: Sequence[Stretch]) -> Trajectory:
    """Join stretches, each at rest at both ends, to one motion of all joints, with its segments."""
    parts: list[Trajectory] = []
    segments: list[Segment] = []
    begin = 0.0
    for stretch in stretches:
        first, motion = stretch.done[0], stretch.motion
        if isinstance(motion, Trajectory):
            assert first.stage is not None
            parts.append(motion_of_all_joints(problem.robot, first.stage.columns, motion, first.before.q))
        elif motion > 0.0:
            parts.append(standstill(problem.robot.joint_names, first.before.q, motion))
        since = begin
        for one, end in zip(stretch.done, stretch.ends, strict=True):
            step = one.step
            segments.append(Segment(step.number, step.kind, step.name, since, begin + end, *_object_and_link(one)))
            since = begin + end
        begin = since
    return replace(
        join_trajectories(parts or [standstill(problem.robot.joint_names, problem.start, 1e-3)]),
        segments=tuple(segments),
    )


def _object_and_link(done: PlannedStep) -> tuple[str, str]:
    """Return what is taken or released, and the link that does it; empty of other steps."""
    action = done.step.action
    if isinstance(action, Attach):
        return action.body, action.link
    if isinstance(action, Detach):
        return action.body, next(held.link for held in done.before.scene.attached if held.name == action.body)
    return "", ""


def motion_of_all_joints(robot: Robot, columns: Sequence[int], motion: Trajectory, q: Array) -> Trajectory:
    """Return the motion of all joints in which some move and the others stand where they stand in q (n,)."""
    coefficients = np.zeros((*motion.coefficients.shape[:2], robot.n))
    coefficients[:, 0] = q
    coefficients[:, :, columns] = motion.coefficients
    return Trajectory(robot.joint_names, motion.breakpoints, coefficients)
