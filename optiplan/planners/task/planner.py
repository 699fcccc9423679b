"""Plan a task: choose, plan and time its steps, and join them to one motion."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.libraries import clock
from optiplan.planners.base import Budget, Candidate, Failure, Planner, PlanResult, Progress
from optiplan.planners.common.failures import too_heavy
from optiplan.planners.common.moving_scene import without_moving
from optiplan.planners.common.stopwatch import Stopwatch
from optiplan.planners.task.chains import Done, of_step
from optiplan.planners.task.flow import flowing
from optiplan.planners.task.line_timing import line_limits, timed_line
from optiplan.planners.task.optimisation.stretch_optimiser import optimised
from optiplan.planners.task.search import TaskSearch
from optiplan.planners.task.stops import stops_of
from optiplan.planners.task.stretches import Stretch
from optiplan.planners.task.waiting import standstill, waiting
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.problem.problem import Problem
from optiplan.problem.task.steps import Attach, Detach, Dwell
from optiplan.robot.robot import Robot
from optiplan.trajectory.segments import Segment
from optiplan.trajectory.trajectory import Trajectory


def plan_task(planner: Planner[Any], problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
    """Plan a task within the budget: first a motion that stops after every step, then one that does not.

    Args:
        planner: plans the moves.
        problem: with a task.
        budget: time for all of it.
        progress: called with the stages.
    """
    began, watch = clock(), Stopwatch()
    search = TaskSearch(without_moving(problem), planner, budget, progress)
    with watch.stage("steps"):
        done = search.run()
    if isinstance(done, Failure):
        return PlanResult(None, done, watch.seconds)
    with watch.stage("timing"):
        timed = [_timed(one, budget) for one in done]
    failed = next((one for one in timed if isinstance(one, Failure)), None)
    if failed is not None:
        return PlanResult(None, failed, watch.seconds)
    stretches = [Stretch.of(a, b) for a, b in zip(done, timed, strict=True) if not isinstance(b, Failure)]
    if problem.scene.moving:
        with watch.stage("waiting"):
            result = _among_moving(problem, planner, stretches, budget, progress)
        return replace(result, info={"moves": search.infos, **result.info})
    first = Candidate(joined(problem, stretches), clock() - began)
    info: dict[str, Any] = {"moves": search.infos, "attempts": search.attempts}
    with watch.stage("flow"):
        groups = flowing(stretches, budget, progress, thorough=not _timed_only(problem))
    flow = [one for group in groups for one in group]
    joint = Candidate(joined(problem, flow), clock() - began)
    with watch.stage("optimisation"):
        whole = _optimised(problem, planner, groups, budget, progress)
    info |= {"cut_short": search.cut_short or budget.over, "stops": stops_of(whole)}
    info |= {"duration_with_stops": first.trajectory.duration, "duration_joined": joint.trajectory.duration}
    info |= {"stops_left_out": len(stretches) - len(whole)}
    found = [first, joint, Candidate(joined(problem, whole), clock() - began)]
    shorter = [len(flow) < len(stretches), whole != flow]
    *earlier, last = [first, *(one for one, good in zip(found[1:], shorter, strict=True) if good)]
    return PlanResult(last.trajectory, None, watch.seconds, info, tuple(earlier), last.seconds)


def _optimised(
    problem: Problem, planner: Planner[Any], groups: Sequence[list[Stretch]], budget: Budget, progress: Progress
) -> list[Stretch]:
    """Optimise what lies between two stops as one, where it is more than a line and time is all that counts."""
    options = planner.options if isinstance(planner.options, TrajOptOptions) else TrajOptOptions()
    found: list[Stretch] = []
    for k, group in enumerate(groups):
        progress("optimising steps together", k / len(groups))
        several = sum(len(stretch.done) for stretch in group) > 1
        worth = several and _timed_only(problem) and not budget.over
        found += optimised(group, options, budget) if worth else group
    return found


def _timed_only(problem: Problem) -> bool:
    """Whether only time counts, so that steps are optimised together."""
    return problem.objective.weights.keys() == {"time"}


def _among_moving(
    problem: Problem, planner: Planner[Any], stretches: list[Stretch], budget: Budget, progress: Progress
) -> PlanResult:
    """Let what moves pass: of the steps as one where that is quicker, or else of them one by one."""
    groups = flowing(stretches, budget, progress, thorough=not _timed_only(problem))
    failure: Failure | None = None
    for way in (_optimised(problem, planner, groups, budget, progress), stretches):
        passed = waiting(problem, way, budget)
        if not isinstance(passed, Failure):
            waited = sum(b.ends[-1] - a.ends[-1] for a, b in zip(way, passed, strict=True))
            return PlanResult(joined(problem, passed), None, {}, {"waited": waited, "stops": stops_of(passed)})
        failure = passed
    return PlanResult(None, failure, {}, {})


def _timed(done: Done, budget: Budget) -> "Trajectory | float | Failure":
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


def joined(problem: Problem, stretches: Sequence[Stretch]) -> Trajectory:
    """Join stretches, each at rest at both ends, to one motion of all joints, with its segments."""
    parts: list[Trajectory] = []
    segments: list[Segment] = []
    begin = 0.0
    for stretch in stretches:
        first, motion = stretch.done[0], stretch.motion
        if isinstance(motion, Trajectory):
            assert first.stage is not None
            parts.append(whole(problem.robot, first.stage.columns, motion, first.before.q))
        elif motion > 0.0:
            parts.append(standstill(problem.robot, first.before.q, motion))
        since = begin
        for one, end in zip(stretch.done, stretch.ends, strict=True):
            step = one.step
            segments.append(Segment(step.number, step.kind, step.name, since, begin + end, *_object_and_link(one)))
            since = begin + end
        begin = since
    return concatenated(parts or [standstill(problem.robot, problem.start, 1e-3)], segments)


def _object_and_link(done: Done) -> tuple[str, str]:
    """Return what is taken or released, and the link that does it; empty of other steps."""
    action = done.step.action
    if isinstance(action, Attach):
        return action.body, action.link
    if isinstance(action, Detach):
        return action.body, next(held.link for held in done.before.scene.attached if held.name == action.body)
    return "", ""


def whole(robot: Robot, columns: Sequence[int], motion: Trajectory, q: Array) -> Trajectory:
    """Return the motion of all joints in which some move and the others stand where they stand in q (n,)."""
    coefficients = np.zeros((*motion.coefficients.shape[:2], robot.n))
    coefficients[:, 0] = q
    coefficients[:, :, columns] = motion.coefficients
    return Trajectory(robot.joint_names, motion.breakpoints, coefficients)


def concatenated(parts: Sequence[Trajectory], segments: Sequence[Segment]) -> Trajectory:
    """Return motions one after another."""
    size = max(part.coefficients.shape[1] for part in parts)
    padded = [np.pad(part.coefficients, ((0, 0), (0, size - part.coefficients.shape[1]), (0, 0))) for part in parts]
    begins = np.concatenate([[0.0], np.cumsum([part.duration for part in parts])])
    breakpoints = [part.breakpoints[1:] + begin for part, begin in zip(parts, begins, strict=False)]
    times = np.concatenate([[0.0], *breakpoints])
    return Trajectory(parts[0].joint_names, times, np.concatenate(padded), tuple(segments))
