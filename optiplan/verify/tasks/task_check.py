"""Checks of a task: every step, and every part of the motion with the scene and the load that it has there."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, replace
from typing import Any, TypeVar

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.named_pairs import NamedPairs
from optiplan.geometry.scene import Scene
from optiplan.problem.constraints.base import WHOLE
from optiplan.problem.constraints.expression import Expression
from optiplan.problem.constraints.motions import ToolSpeed
from optiplan.problem.constraints.statements import BY_SCENE
from optiplan.problem.goals_and_vias import AllOfGoal
from optiplan.problem.problem import GoalEnd, JointGoal, Problem, RegionGoal, Via, derived
from optiplan.problem.task.scene_change import columns
from optiplan.problem.task.scene_part import ScenePart
from optiplan.problem.task.steps import Attach, Detach, Move, StraightLine, TaskStep
from optiplan.problem.task.timeline import mismatch, proved_parts, steps_in_time
from optiplan.robot.frames import frame_pose
from optiplan.robot.robot import Robot
from optiplan.trajectory.segments import ON_PATH, TOUR
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify import limit_checks
from optiplan.verify.collision_check import collision
from optiplan.verify.constraint_check import path_constraints
from optiplan.verify.report import Check, VerifyPolicy
from optiplan.verify.seams.seam_check import seam_checks
from optiplan.verify.statements import constraint, covering, step_place
from optiplan.verify.tasks.arms_check import arms_check
from optiplan.verify.tasks.line_ways import LineSpeed, line_constraints, line_speed
from optiplan.verify.tasks.ride_check import ride_checks
from optiplan.verify.tasks.standstill_check import standstill
from optiplan.verify.tasks.task_parts import StepPart, standing_at
from optiplan.verify.via_check import vias

End = TypeVar("End", bound=GoalEnd)

_WAYS = {ON_PATH: ", the ways to its path and from it included", TOUR: ", the ways between its targets included"}

WITHIN_REACH = 0.02
"""m: what is taken from farther off is named beside the verdict; open fingers are a centimetre from what they take."""


def task_checks(
    problem: Problem, trajectory: Trajectory, parts: Sequence[StepPart], policy: VerifyPolicy
) -> list[Check]:
    """Return the checks of a motion that does a task; only the first where its segments are not the task's steps.

    `parts` as of `step_parts`; none where the segments are not the steps.
    """
    steps = _segments(problem, trajectory)
    if not steps.passed:
        return [steps]
    scenes = proved_parts(problem, trajectory)
    return [
        steps,
        limit_checks.start_position(problem, trajectory, policy),
        *_worst_of(_ends(parts), "goal"),
        *_worst_of(_passed(parts), "via"),
        *_worst_of(_lines(parts, policy), "line"),
        *_line_speeds(parts, policy),
        *_seams(parts, policy),
        *_worst_of(ride_checks(parts, policy), "ride"),
        standstill(problem, trajectory, parts, policy),
        *arms_check(problem, trajectory, policy),
        *_constraints(problem, trajectory, parts, scenes, policy),
        *limit_checks.of_the_whole(problem, trajectory, policy),
        *_worst_of(_in_scenes(limit_checks.loaded_torque, scenes, trajectory, policy), "torque"),
        _collision(_in_scenes(collision, scenes, trajectory, policy)),
    ]


def task_scope(problem: Problem, trajectory: Trajectory, parts: Sequence[StepPart]) -> tuple[str, ...]:
    """Return what the verdict on a task is about besides: when what is held changes, and what steps let touch.

    `parts` as of `task_checks`.
    """
    if not parts:
        return ()
    said, weights, afar = [], [], []
    for step, scene, begin, _ in steps_in_time(problem, trajectory):
        if isinstance(step.action, Attach) and (
            gap := _gap(problem.robot, scene.later(begin), step.action, trajectory(begin))
        ):
            afar.append(f"{step.action.body} by {step.action.link}, {gap:.2g} m away")
        if isinstance(step.action, Attach | Detach):
            done = "held" if isinstance(step.action, Attach) else "an obstacle"
            said.append(f"{step.action.body} is {done} from {begin:.3f} s")
        if isinstance(step.action, Attach) and step.action.mass:
            weights.append(f"{step.action.body} of {step.action.mass:g} kg")
    allowed: dict[str, dict[int, str]] = {}
    for step in problem.task:
        for pair in step.allowed:
            numbers = allowed.setdefault(" – ".join(sorted(pair)), {})
            numbers.setdefault(step.number, f"{step.number}{_WAYS.get(step.kind, '')}")
    pairs = [f"{pair} in step {', '.join(numbers.values())}" for pair, numbers in sorted(allowed.items())]
    touch = sorted(
        {
            " – ".join(sorted((s.action.body, link)))
            for s in problem.task
            if isinstance(s.action, Attach)
            for link in s.action.touch
        }
    )
    slow = [f"{step.words}: {speed}" for step, speed in _speeds_held(parts) if speed.why]
    return (
        *([f"lines slower than asked: {'; '.join(slow)}"] if slow else []),
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


def _ends(parts: Sequence[StepPart]) -> Iterator[Check]:
    for k, part in enumerate(one.seen for one in parts):
        action = part.step.action
        if isinstance(action, Move):
            ends = [_of_all(part.problem, action.joints, end, part.q) for end in _placed_goal(part, action)]
        elif isinstance(action, StraightLine) and part.way is not None and part.way.leaves is None:
            ends = [AllOfGoal((part.way.goal, *([] if action.region is None else [action.region])))]
        else:
            continue
        check = limit_checks.goal(derived(part.problem, goal=tuple(ends)), standing_at(part.problem, part.q))
        length = 0.0 if part.motion is None else part.motion.duration
        yield covering(replace(_of_part(check, part), time=part.begin + length), f"{step_place(k)}.end")


def _placed_goal(part: StepPart, action: Move) -> Iterator[GoalEnd]:
    """Yield the ends of a move; regions in the frame of a link become regions in the world, where it is at the end."""
    for end in action.goal:
        if action.carried_by and isinstance(end, RegionGoal):
            yield end.moved(frame_pose(part.problem.robot, part.q, action.carried_by))
        else:
            yield end


def _of_all(problem: Problem, joints: Iterable[str], end: End, q: Array) -> End | JointGoal:
    """Return an end of some joints as one of all, the others where they are in q (n,)."""
    if not isinstance(end, JointGoal):
        return end
    whole = np.array(q)
    whole[columns(problem.robot, joints)] = end.q
    return JointGoal(whole, end.tolerance)


def _passed(parts: Sequence[StepPart]) -> Iterator[Check]:
    for k, part in enumerate(parts):
        action = part.step.action
        if not isinstance(action, Move) or not action.vias:
            continue
        motion = part.motion
        if motion is None:
            yield Check("via", "exact", False, detail=f"{part.step.words} takes no time", time=part.begin)
            continue
        at = [_of_all(part.problem, action.joints, via.at, part.q) for via in action.vias]
        c, own = np.tile(part.q, (*motion.coefficients.shape[:2], 1)), columns(part.problem.robot, action.joints)
        c[:, 1:] = 0.0
        c[:, :, own] = motion.coefficients[:, :, own]  # other arms may be on their way
        alone = replace(motion, coefficients=c)
        check = vias(derived(part.problem, vias=tuple(Via(one) for one in at)), alone)
        passed = [f"{step_place(k)}.via[{i}]" for i in range(len(action.vias))]
        yield covering(_of_part(check, part), *passed)


def _lines(parts: Sequence[StepPart], policy: VerifyPolicy) -> Iterator[Check]:
    """Check that the frames of lines move straight and turn about one axis, or not at all, but for rounded corners."""
    for k, part in enumerate(one.seen for one in parts):
        if part.way is None:
            continue
        lasting = part.lasting()
        stated = tuple(line_constraints(part.way, part.problem.robot, lasting))
        own = derived(part.problem, path_constraints=stated, tracking_error=np.zeros(lasting.n))
        for check in path_constraints(own, lasting, policy):
            known = replace(_of_part(check, part), name="line", covers=())
            yield covering(known, f"{step_place(k)}.line")


def _speeds(parts: Sequence[StepPart], policy: VerifyPolicy) -> Iterator[Check]:
    """Check that the origins of frames on lines are no faster than their steps say."""
    for k, part in enumerate(one.seen for one in parts):
        action = part.step.action
        if not isinstance(action, StraightLine) or action.speed == np.inf:
            continue
        own = derived(part.problem, path_constraints=(ToolSpeed(action.frame, action.speed, np.inf),))
        for check in path_constraints(own, part.lasting(), policy):
            known = replace(_of_part(check, part), covers=())
            yield covering(known, f"{step_place(k)}.speed")


def _line_speeds(parts: Sequence[StepPart], policy: VerifyPolicy) -> list[Check]:
    """Return the check of speeds on lines; the detail says what the slowest holds of its speed, the witness all."""
    found = list(_speeds_held(parts))
    if not found:
        return []
    lines = [{"step": step.number, **asdict(speed)} for step, speed in found]
    step, slowest = min(found, key=lambda one: one[1].held / one[1].asked)
    (check,) = _worst_of(_speeds(parts, policy), "line speed")
    return [
        replace(check, detail=f"{check.detail}; {step.words}: {slowest}", witness={**check.witness, "lines": lines})
    ]


def _speeds_held(parts: Iterable[StepPart]) -> Iterator[tuple[TaskStep, LineSpeed]]:
    """Yield lines that state a speed, with what is held of it."""
    for part in (one.seen for one in parts):
        action = part.step.action
        if part.motion is not None and isinstance(action, StraightLine) and np.isfinite(action.speed):
            yield part.step, line_speed(part.problem, part.motion, action)


def _seams(parts: Sequence[StepPart], policy: VerifyPolicy) -> Iterator[Check]:
    """Check the parts of paths of the tool and the events on them, the worst of each kind."""
    found = [
        _of_part(check, part)
        for k, part in enumerate(parts)
        for check in seam_checks(k, part.step, part.problem, (part.motion, part.q), policy)
    ]
    for name in dict.fromkeys(check.name for check in found):
        yield from _worst_of((check for check in found if check.name == name), name)


def _constraints(
    problem: Problem,
    trajectory: Trajectory,
    parts: Sequence[StepPart],
    scenes: Sequence[ScenePart],
    policy: VerifyPolicy,
) -> Iterator[Check]:
    """Check path constraints of the whole, and those of steps."""
    T = trajectory.duration
    for k, one in enumerate(problem.path_constraints):
        if not isinstance(one, (*BY_SCENE, Expression)):
            for check in path_constraints(derived(problem, path_constraints=(one,)), trajectory, policy):
                yield replace(check, covers=(constraint(k),))
            continue
        for scene in scenes:
            low, high = max(one.during[0] * T, scene.begin), min(one.during[1] * T, scene.end)
            lasts = scene.end - scene.begin
            if high > low or high == low == lasts + low:
                during = ((low - scene.begin) / lasts, (high - scene.begin) / lasts) if lasts > 0.0 else WHOLE
                own = derived(scene.problem, path_constraints=(replace(one, during=during),))
                for check in path_constraints(own, scene.motion(trajectory), policy):
                    yield replace(_later(check, scene), covers=(constraint(k),))
    for k, part in enumerate(parts):
        own = derived(part.problem, path_constraints=part.step.constraints)
        for check in path_constraints(own, part.lasting(), policy):
            covers = tuple(f"{step_place(k)}.{one}" for one in check.covers)
            yield replace(_of_part(check, part), covers=covers)


SceneCheck = Callable[[Problem, Trajectory, VerifyPolicy], Check]


def _in_scenes(
    check: SceneCheck, scenes: Sequence[ScenePart], trajectory: Trajectory, policy: VerifyPolicy
) -> Iterator[Check]:
    """Return a check for every part of the motion with its own scene and load."""
    for scene in scenes:
        found = check(scene.problem, scene.motion(trajectory), policy)
        yield _later(replace(found, detail=f"{scene.steps}: {found.detail}"), scene)


def _worst_of(checks: Iterable[Check], name: str) -> list[Check]:
    """Return the check that failed or came nearest to its limit, of several alike; nothing of none."""
    found = list(checks)
    if not found:
        return []
    worst = max(found, key=lambda check: (not check.passed, _share(check)))
    kinds = {check.kind for check in found}
    kind = next(kind for kind in ("sampled", "unchecked", "continuous", "exact") if kind in kinds)
    detail = f"worst of {len(found)}: {worst.detail}" if len(found) > 1 else worst.detail
    covers = tuple(dict.fromkeys(one for check in found for one in check.covers))
    return [replace(worst, name=name, kind=kind, detail=detail, covers=covers)]


def _share(check: Check) -> float:
    if check.worst is None or check.limit is None:
        return 0.0
    return check.worst / check.limit if check.limit > 0.0 else check.worst


def _collision(checks: Iterable[Check]) -> Check:
    """Return one check of contacts of several parts, with the work of all.

    It has the least clearance; where parts fail, that of these alone, and first of one of which nothing was measured.
    """
    found = list(checks)
    unmeasured = np.inf if all(check.passed for check in found) else -np.inf
    worst = min(found, key=lambda check: (check.passed, unmeasured if check.worst is None else check.worst))
    witness: dict[str, Any] = dict(worst.witness)
    for key in ("intervals", "queries", "believed"):
        witness[key] = sum(int(check.witness[key]) for check in found)
    for key in ("pairs", "proved_by_robot"):
        witness[key] = max(int(check.witness[key]) for check in found)
    for key in ("proved_clearance", "self_clearance", "scene_clearance", "met_clearance"):
        known = [check.witness[key] for check in found if check.witness[key] is not None]
        complete = key == "met_clearance" or all(check.passed for check in found)
        witness[key] = min(known) if known and complete else None
    if "nearer" in witness:
        witness["nearer"] = [one for check in found for one in check.witness.get("nearer", ())]
    detail = f"least of {len(found)} parts with scenes of their own: {worst.detail}" if len(found) > 1 else worst.detail
    covers = tuple(dict.fromkeys(one for check in found for one in check.covers))
    passed = all(check.passed for check in found)
    return replace(worst, passed=passed, detail=detail, witness=witness, covers=covers)


def _of_part(check: Check, part: StepPart) -> Check:
    """Return a check of a step in the time of the whole, which says of which step it is."""
    words = f"{part.step.words}: {check.detail}" if check.detail else part.step.words
    return _later(replace(check, detail=words), part)


def _later(check: Check, part: StepPart | ScenePart) -> Check:
    """Return a check of a part of the motion in the time of the whole."""
    return check if check.time is None else replace(check, time=min(check.time + part.begin, part.end))
