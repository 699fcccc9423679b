"""Checks of a task: every step, and every part of the motion with the scene and the load that it has there."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Any, TypeVar

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.named_pairs import NamedPairs
from optiplan.geometry.scene import Scene
from optiplan.problem.constraints.statements import PairClearance, ToolSpeed
from optiplan.problem.problem import GoalEnd, JointGoal, PoseGoal, Problem, Via
from optiplan.problem.task.scene_change import columns, scene_during
from optiplan.problem.task.steps import Attach, Detach, Dwell, Move, StraightLine, TaskStep
from optiplan.problem.task.timeline import ScenePart, mismatch, part_problem, scene_parts, steps_in_time
from optiplan.robot.robot import Robot
from optiplan.trajectory.cut import cut
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify import limit_checks
from optiplan.verify.collision_check import collision
from optiplan.verify.constraint_check import path_constraints
from optiplan.verify.continuous.torque import torque
from optiplan.verify.line_ways import LineWay, frame_at, line_constraints, line_way
from optiplan.verify.report import Check, VerifyPolicy
from optiplan.verify.via_check import vias

End = TypeVar("End", bound=GoalEnd)

WITHIN_REACH = 0.02
"""m: what is taken from farther off is named beside the verdict; open fingers are a centimetre from what they take."""


@dataclass(frozen=True, eq=False)
class _Part:
    """A step in time: its own problem, the motion while it is done, when it begins, s, and of a line its way."""

    step: TaskStep
    problem: Problem
    motion: Trajectory | None
    begin: float
    q: Array
    way: LineWay | None = None


def task_checks(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy) -> list[Check]:
    """Return the checks of a motion that does a task; only the first where its segments are not the task's steps."""
    steps = _segments(problem, trajectory)
    if not steps.passed:
        return [steps]
    parts = list(_parts(problem, trajectory))
    scenes = scene_parts(problem, trajectory)
    return [
        steps,
        limit_checks.start(problem, trajectory, policy),
        *_worst_of(_ends(parts), "goal"),
        *_worst_of(_passed(parts), "via"),
        *_worst_of(_lines(parts, policy), "line"),
        *_worst_of(_speeds(parts, policy), "line speed"),
        _standing(problem, trajectory, parts, policy),
        *_constraints(problem, trajectory, parts, scenes, policy),
        limit_checks.rest(problem, trajectory, policy),
        limit_checks.continuity(problem, trajectory, policy),
        limit_checks.position(problem, trajectory, policy),
        *(limit_checks.rate(problem, trajectory, policy, order) for order in (1, 2, 3)),
        *_worst_of(_in_scenes(torque, scenes, trajectory, policy), "torque"),
        _collision(_in_scenes(collision, scenes, trajectory, policy)),
    ]


def task_scope(problem: Problem, trajectory: Trajectory) -> tuple[str, ...]:
    """Return what the verdict on a task is about besides: when what is held changes, and what steps let touch."""
    if mismatch(problem, trajectory):
        return ()
    said, weights, afar = [], [], []
    for step, scene, begin, _ in steps_in_time(problem, trajectory):
        if isinstance(step.action, Attach) and (gap := _gap(problem.robot, scene, step.action, trajectory(begin))):
            afar.append(f"{step.action.body} by {step.action.link}, {gap:.2g} m away")
        if isinstance(step.action, Attach | Detach):
            done = "held" if isinstance(step.action, Attach) else "an obstacle"
            said.append(f"{step.action.body} is {done} from {begin:.3f} s")
        if isinstance(step.action, Attach) and step.action.mass:
            weights.append(f"{step.action.body} of {step.action.mass:g} kg")
    allowed: dict[str, list[int]] = {}
    for step in problem.task:
        for pair in step.allowed:
            allowed.setdefault(" – ".join(sorted(pair)), []).append(step.number)
    pairs = [f"{pair} in step {', '.join(map(str, numbers))}" for pair, numbers in sorted(allowed.items())]
    touch = sorted(
        {
            " – ".join(sorted((s.action.body, link)))
            for s in problem.task
            if isinstance(s.action, Attach)
            for link in s.action.touch
        }
    )
    return (
        *([f"what is held: {'; '.join(said)}"] if said else []),
        *([f"taken though nothing that may touch it is near: {'; '.join(afar)}"] if afar else []),
        *([f"masses while they are held: {', '.join(weights)}"] if weights else []),
        *([f"contacts allowed while it is held, not checked: {', '.join(touch)}"] if touch else []),
        *([f"contacts allowed by steps, not checked: {', '.join(pairs)}"] if pairs else []),
    )


def _gap(robot: Robot, scene: Scene, action: Attach, q: Array) -> float:
    """Distance, m, of what is taken from all that may touch it or is held by the same link; 0 within reach.

    Links without a body, and those that no joint moves, are not measured.
    """
    body = tuple(one for one in scene.obstacles if one.name == action.body)
    held = tuple(one for one in scene.attached if one.link == action.link)
    near = (action.link, *action.touch, *(one.name for one in held))
    alone = Scene(body, held)
    found = NamedPairs(robot, alone, [(action.body, name) for name in near]).clearance(q)
    return 0.0 if found is None or found.distance <= WITHIN_REACH else found.distance


def _segments(problem: Problem, trajectory: Trajectory) -> Check:
    words = mismatch(problem, trajectory)
    count = problem.task[-1].number
    detail = f"found {words}" if words else f"{count} steps in order, each with its part of the motion"
    return Check("steps", "exact", not words, detail=detail)


def _parts(problem: Problem, trajectory: Trajectory) -> Iterator[_Part]:
    """Return each step with its own part of the motion, None for an event or an empty part."""
    steps = list(steps_in_time(problem, trajectory))
    way: LineWay | None = None
    for (step, scene, begin, end), after in zip_longest(steps, steps[1:]):
        own = part_problem(problem, scene_during(scene.later(begin), step))
        motion = cut(trajectory, begin, end) if end > begin else None
        following = None if after is None else after[0].action
        way = line_way(step.action, following, frame_at(own.robot, step.action, trajectory(begin)), way)
        yield _Part(step, own, motion, begin, trajectory(end), way)


def _ends(parts: Sequence[_Part]) -> Iterator[Check]:
    """Check where moves and lines end."""
    for part in parts:
        action = part.step.action
        if isinstance(action, Move):
            ends = [_of_all(part.problem, action.joints, end, part.q) for end in action.goal]
        elif isinstance(action, StraightLine) and part.way is not None and part.way.leaves is None:
            ends = list(action.ends) or [PoseGoal(action.frame, part.way.end)]
        else:
            continue
        still = Trajectory(part.problem.robot.joint_names, np.array([0.0, 1.0]), part.q[None, None])
        check = limit_checks.goal(replace(part.problem, goal=tuple(ends)), still)
        length = 0.0 if part.motion is None else part.motion.duration
        yield replace(_named(check, part), time=part.begin + length)


def _of_all(problem: Problem, joints: Iterable[str], end: End, q: Array) -> End | JointGoal:
    """Return an end of some joints as one of all, the others where they are in q (n,)."""
    if not isinstance(end, JointGoal):
        return end
    whole = np.array(q)
    whole[columns(problem.robot, joints)] = end.q
    return JointGoal(whole, end.tolerance)


def _passed(parts: Sequence[_Part]) -> Iterator[Check]:
    """Check the vias of moves."""
    for part in parts:
        action = part.step.action
        if not isinstance(action, Move) or not action.vias:
            continue
        motion = part.motion
        if motion is None:
            yield Check("via", "exact", False, detail=f"{part.step.words} takes no time", time=part.begin)
            continue
        at = [_of_all(part.problem, action.joints, via.at, part.q) for via in action.vias]
        check = vias(replace(part.problem, vias=tuple(Via(one) for one in at)), motion)
        yield _later(_named(check, part), part.begin)


def _lines(parts: Sequence[_Part], policy: VerifyPolicy) -> Iterator[Check]:
    """Check that the frames of lines move straight and turn about one axis, or not at all, but for rounded corners."""
    for part in parts:
        if part.way is None or part.motion is None:
            continue
        own = replace(part.problem, path_constraints=tuple(line_constraints(part.way, part.problem.robot, part.motion)))
        for check in path_constraints(own, part.motion, policy):
            yield replace(_later(_named(check, part), part.begin), name="line")


def _speeds(parts: Sequence[_Part], policy: VerifyPolicy) -> Iterator[Check]:
    """Check that the origins of frames on lines are no faster than their steps say."""
    for part in parts:
        action = part.step.action
        if part.motion is None or not isinstance(action, StraightLine) or not np.isfinite(action.speed):
            continue
        own = replace(part.problem, path_constraints=(ToolSpeed(action.frame, action.speed, np.inf),))
        for check in path_constraints(own, part.motion, policy):
            yield _later(_named(check, part), part.begin)


def _standing(problem: Problem, trajectory: Trajectory, parts: Sequence[_Part], policy: VerifyPolicy) -> Check:
    """Check that joints which a step does not move stand still, all of them at events; and that a dwell lasts.

    Standing still is moving by no more than `jump_tolerance` over the whole step, from the exact extrema.
    """
    worst, where, when, failed = 0.0, "", 0.0, ""
    for part in parts:
        step, action = part.step, part.step.action
        if part.motion is None:
            if isinstance(action, Attach | Detach):
                speed = np.abs(trajectory(np.array([part.begin]), 1)[0]) / problem.limits.velocity
                if speed.max() > policy.rest_tolerance:
                    failed = failed or f"the robot moves at the event of {step.words}"
            elif isinstance(action, Dwell):
                failed = failed or f"{step.words} does not last"
            continue
        moving = action.joints if isinstance(action, Move | StraightLine) else ()
        own = [k for k, name in enumerate(problem.robot.joint_names) if name not in moving]
        low, high = part.motion.extrema(0)
        moved = float((high - low)[own].max(initial=0.0))
        if moved > worst:
            worst, where, when = moved, step.words, part.begin
        if isinstance(action, Dwell) and part.motion.duration < action.seconds * (1.0 - 1e-9):
            failed = failed or f"{step.words} lasts {part.motion.duration:.6g} s of {action.seconds:g} s"
    passed = worst <= policy.jump_tolerance and not failed
    detail = failed or "joints that a step does not move, and all of them at events"
    return Check("standstill", "exact", passed, worst, policy.jump_tolerance, "rad", when, where, detail)


def _constraints(
    problem: Problem, trajectory: Trajectory, parts: Sequence[_Part], scenes: Sequence[ScenePart], policy: VerifyPolicy
) -> Iterator[Check]:
    """Check path constraints of the whole, and those of steps."""
    T = trajectory.duration
    for one in problem.path_constraints:
        if not isinstance(one, PairClearance):
            yield from path_constraints(replace(problem, path_constraints=(one,)), trajectory, policy)
            continue
        for scene in scenes:
            low, high = max(one.during[0] * T, scene.begin), min(one.during[1] * T, scene.end)
            if high > low:
                lasts = scene.end - scene.begin
                during = ((low - scene.begin) / lasts, (high - scene.begin) / lasts)
                own = replace(scene.problem, path_constraints=(replace(one, during=during),))
                for check in path_constraints(own, scene.motion(trajectory), policy):
                    yield _later(check, scene.begin)
    for part in parts:
        if part.step.constraints and part.motion is not None:
            own = replace(part.problem, path_constraints=part.step.constraints)
            for check in path_constraints(own, part.motion, policy):
                yield _later(_named(check, part), part.begin)


SceneCheck = Callable[[Problem, Trajectory, VerifyPolicy], Check]


def _in_scenes(
    check: SceneCheck, scenes: Sequence[ScenePart], trajectory: Trajectory, policy: VerifyPolicy
) -> Iterator[Check]:
    """Return a check for every part of the motion with its own scene and load."""
    for scene in scenes:
        found = check(scene.problem, scene.motion(trajectory), policy)
        yield _later(replace(found, detail=f"{scene.steps}: {found.detail}"), scene.begin)


def _worst_of(checks: Iterable[Check], name: str) -> list[Check]:
    """Return the check that failed or came nearest to its limit, of several alike; nothing of none."""
    found = list(checks)
    if not found:
        return []
    worst = max(found, key=lambda check: (not check.passed, _share(check)))
    kinds = {check.kind for check in found}
    kind = next(kind for kind in ("sampled", "unchecked", "continuous", "exact") if kind in kinds)
    detail = f"worst of {len(found)}: {worst.detail}" if len(found) > 1 else worst.detail
    return [replace(worst, name=name, kind=kind, detail=detail)]


def _share(check: Check) -> float:
    if check.worst is None or check.limit is None:
        return 0.0
    return check.worst / check.limit if check.limit > 0.0 else check.worst


def _collision(checks: Iterable[Check]) -> Check:
    """Return one check of contacts of several parts, with the least clearance and the work of all."""
    found = list(checks)
    measured = [check for check in found if check.worst is not None] or found
    worst = min(measured, key=lambda check: (check.passed, np.inf if check.worst is None else check.worst))
    witness: dict[str, Any] = dict(worst.witness)
    for key in ("intervals", "queries", "believed"):
        witness[key] = sum(int(check.witness[key]) for check in found)
    for key in ("pairs", "proved_by_robot"):
        witness[key] = max(int(check.witness[key]) for check in found)
    for key in ("proved_clearance", "self_clearance", "scene_clearance", "met_clearance"):
        known = [check.witness[key] for check in found if check.witness[key] is not None]
        complete = key == "met_clearance" or all(check.passed for check in found)
        witness[key] = min(known) if known and complete else None
    detail = f"least of {len(found)} parts with scenes of their own: {worst.detail}" if len(found) > 1 else worst.detail
    return replace(worst, passed=all(check.passed for check in found), detail=detail, witness=witness)


def _named(check: Check, part: _Part) -> Check:
    """Return a check that says of which step it is."""
    words = f"{part.step.words}: {check.detail}" if check.detail else part.step.words
    return replace(check, detail=words)


def _later(check: Check, begin: float) -> Check:
    """Return a check of a part of the motion in the time of the whole."""
    return check if check.time is None else replace(check, time=check.time + begin)
