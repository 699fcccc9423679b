"""A task in time: what the scene is, and what is done, in each part of a motion."""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator
from itertools import pairwise
from operator import itemgetter
from typing import TypeAlias

import numpy as np

from optiplan.arrays import Array
from optiplan.geometry.scene import Scene
from optiplan.problem.problem import JointGoal, Problem, derived
from optiplan.problem.seams.actions import SeamPart
from optiplan.problem.task.arms import (
    arms_mismatch,
    in_task_order,
    in_time_order,
    joints_of_arms,
    of_one_arm,
    several_arms,
)
from optiplan.problem.task.rides import WaitUntil
from optiplan.problem.task.scene_change import carrying, columns, scene_after, scene_during
from optiplan.problem.task.scene_part import ScenePart, whole_motion
from optiplan.problem.task.steps import Action, Attach, ChangeTool, Detach, Dwell, Event, Move, StraightLine, TaskStep
from optiplan.problem.task.tour_steps import in_order
from optiplan.trajectory.trajectory import Trajectory

MEETING = 1e-9
"""Time, s, by which rounding may part the end of a segment from the beginning of the next; see `_apart`."""


_Stretch: TypeAlias = tuple[Scene, Scene, float, float, list[TaskStep]]
"""The scene, the same with what may touch, begin and end, s, and what is done."""


def mismatch(problem: Problem, trajectory: Trajectory) -> str:
    """Return in words how the segments of a motion are not the steps of its task in order; empty if they are."""
    problem = in_order(problem, trajectory)
    task, T = problem.task, trajectory.duration
    segments = in_task_order(task, trajectory.segments)
    if len(segments) != len(task):
        return f"{len(segments)} segments for {len(task)} of the task"
    for step, segment, named in zip(task, segments, _objects(problem), strict=True):
        if (segment.step, segment.kind) != (step.number, step.kind):
            return f"a segment of step {segment.step} ({segment.kind}) instead of {step.number} ({step.kind})"
        if (found := (segment.object, segment.link)) not in (("", ""), named):
            return f"'{found[0]}' and '{found[1]}' of {step.words} instead of {named}"
        lasts = segment.end - segment.begin
        timed = math.isfinite(lasts) and (lasts == 0.0 if step.event else lasts >= 0.0)
        if not timed or segment.begin < -MEETING:
            return f"{step.words} from {segment.begin:.6g} to {segment.end:.6g} s"
    if several_arms(task):
        late = trajectory.segments != in_time_order(task, segments)
        words = "segments that do not stand in the order of their times" if late else ""
        return words or arms_mismatch(task, segments, T) or _taken_by_others(problem, trajectory)
    for before, after in pairwise(segments):
        if _apart(after.begin, before.end):
            return f"step {after.step} begins at {after.begin:.6g} s; the one before ends at {before.end:.6g} s"
    if _apart(segments[0].begin, 0.0) or _apart(segments[-1].end, T):
        return f"segments from {segments[0].begin:.6g} to {segments[-1].end:.6g} s of {T:.6g} s"
    return _taken_by_others(problem, trajectory)


def _taken_by_others(problem: Problem, trajectory: Trajectory) -> str:
    """Return in words which segment takes time, but has no part of the motion; empty if none."""
    segments = in_task_order(problem.task, trajectory.segments)
    for step, segment, (begin, end) in zip(problem.task, segments, _bounds(problem, trajectory), strict=True):
        if segment.end > segment.begin and not end > begin:
            return f"{step.words} from {segment.begin!r} to {segment.end!r} s, which other steps take"
    return ""


def _objects(problem: Problem) -> Iterator[tuple[str, str]]:
    """Yield the object and the link that the segment of each step names, if it names any."""
    links = {held.name: held.link for held in problem.scene.attached}
    for action in (step.action for step in problem.task):
        if isinstance(action, Attach):
            links[action.body] = action.link
        if isinstance(action, Attach | ChangeTool):
            yield action.body, action.link
        else:
            yield (action.body, links.get(action.body, "")) if isinstance(action, Detach) else ("", "")


def _apart(a: float, b: float) -> bool:
    """Return whether two times differ by more than rounding: `MEETING`, or what doubles of that size can tell."""
    return abs(a - b) > max(MEETING, 4.0 * math.ulp(b))


def _bounds(problem: Problem, trajectory: Trajectory) -> Iterator[tuple[float, float]]:
    """Return when each step begins and ends, s; parts meet without a gap, from 0 to the duration.

    Exactly those steps are empty whose segments say so, however short the others are. A gap that rounding left belongs
    to the step after it, at the end to the last one that takes time. Of several arms each step has its own times.
    """
    if several_arms(problem.task):
        yield from ((one.begin, one.end) for one in in_task_order(problem.task, trajectory.segments))
        return
    segments, T = trajectory.segments, trajectory.duration
    lasting = [segment.end > segment.begin for segment in segments]
    last = max((k for k, lasts in enumerate(lasting) if lasts), default=len(segments) - 1)
    begin = 0.0
    for k, (segment, lasts) in enumerate(zip(segments, lasting, strict=True)):
        end = T if k >= last else min(max(segment.end, begin), T) if lasts else begin
        yield begin, end
        begin = end


def scene_parts(problem: Problem, trajectory: Trajectory) -> list[ScenePart]:
    """Return the parts of a motion with scenes of their own; the whole of one to a goal.

    What is held is where the motion has its link at the event. The segments must be the steps of the task, see
    `mismatch`.

    Raises:
        ValueError: they are not.
    """
    if not problem.task:
        return [whole_motion(problem, trajectory)]
    words = mismatch(problem, trajectory)
    if words:
        raise ValueError(words)
    if several_arms(problem.task):
        return _parts_of_arms(problem, trajectory)
    found: list[_Stretch] = []
    for step, scene, begin, end in steps_in_time(problem, trajectory):
        if end <= begin:
            continue
        if found and found[-1][0] is scene and found[-1][1].allowed == scene_during(scene, step).allowed:
            base, during, first, _, steps = found[-1]
            found[-1] = (base, during, first, end, [*steps, step])
        else:
            found.append((scene, scene_during(scene, step), begin, end, [step]))
    return list(_parts_with_ends(problem, found, _step_ends(problem, trajectory)))


def proved_parts(problem: Problem, trajectory: Trajectory) -> list[ScenePart]:
    """Return the parts of a motion that are proved: `scene_parts`, and what the last event leaves.

    Raises:
        ValueError: the segments are not the steps of the task.
    """
    parts = scene_parts(problem, trajectory)
    last = part_of_last_event(problem, trajectory) if problem.task else None
    return parts if last is None else [*parts, last]


def part_of_last_event(problem: Problem, trajectory: Trajectory) -> ScenePart | None:
    """Return the part, without duration, in which the scene is what the last event leaves; None of none at the end.

    The motion has its end there, and obstacles that move stand where they are then.
    """
    T, found = trajectory.duration, list[_Stretch]()
    for step, scene, begin, _ in steps_in_time(problem, trajectory):
        if begin >= T and isinstance(step.action, Event):
            left = scene_after(scene, step.action, problem.robot, trajectory(T), T)
            found = [(left, scene_during(left, step), T, T, [step])]
    return next(_parts_with_ends(problem, found, _step_ends(problem, trajectory)), None)


def _parts_with_ends(
    problem: Problem, found: Iterable[_Stretch], ends: Iterable[tuple[float, Array]]
) -> Iterator[ScenePart]:
    """Yield the parts, each with those of the times, s, and configurations (n,) at which steps end that lie in it."""
    known = [] if problem.scene.safety is None else sorted(ends, key=itemgetter(0))
    times = [t for t, _ in known]
    for _, during, begin, end, steps in found:
        own = known[bisect_left(times, begin) : bisect_right(times, end)]
        scene = during.later(begin) if end > begin else during.stopped(begin)
        scene = scene.ending_at(*(q for _, q in own))
        yield ScenePart(part_problem(problem, scene), begin, end, _words(steps))


def _step_ends(problem: Problem, trajectory: Trajectory) -> Iterator[tuple[float, Array]]:
    """Yield when the motion begins and a step ends, s, with the configuration (n,) there; and vias of joint values.

    Only steps that say where they end have an end, and it stays one while the arm stands there: a motion to a path or
    away from it ends anywhere, and at an event on a path the tool is on its way. Of several arms, the others are on
    their way unless all of them rest.
    """
    yield 0.0, trajectory.start
    rows = list(steps_in_time(problem, trajectory))
    of_arms = joints_of_arms(problem.task, problem.robot.joint_names)

    lasting = [(begin, end) for _, _, begin, end in rows if end > begin]
    begun, over = sorted(begin for begin, _ in lasting), sorted(end for _, end in lasting)

    def resting(t: float) -> bool:
        return bisect_left(begun, t) == bisect_right(over, t)

    since: dict[str, float] = {}  # s, from when on each arm is at its last end; inf where it is at none
    for step, _, begin, end in rows:
        action = step.action
        stands = step.ride is None and isinstance(action, Dwell | WaitUntil | Event)
        if isinstance(action, SeamPart) and action.low == 0.0:
            yield begin, trajectory(begin)
        if stands and end <= since.get(step.arm, 0.0):
            continue
        since[step.arm] = end if stands or states_its_end(action) else math.inf
        if math.isinf(since[step.arm]):
            continue
        if resting(end):
            yield end, trajectory(end)
        else:
            yield end, of_one_arm(step.arm, of_arms, trajectory(end))
        if not isinstance(action, Move) or not resting(begin):
            continue
        for via in action.vias:
            if isinstance(via.at, JointGoal):
                whole = np.array(trajectory(begin))
                whole[columns(problem.robot, action.joints)] = via.at.q
                yield begin, whole


def states_its_end(action: Action) -> bool:
    """Whether a step says where it ends: near there pairs may be nearer than a `Safety` asks."""
    if isinstance(action, SeamPart):
        return action.high == action.path.curve.length
    return isinstance(action, Move | StraightLine)


def steps_in_time(problem: Problem, trajectory: Trajectory) -> Iterator[tuple[TaskStep, Scene, float, float]]:
    """Return each step with the scene in which it begins, its begin and its end, s; see `_bounds`.

    A tour is the steps from target to target, in the order of the motion; those of several arms in that of their times.
    """
    scene, problem = problem.scene, in_order(problem, trajectory)
    rows = [(*row, k) for k, row in enumerate(zip(problem.task, _bounds(problem, trajectory), strict=True))]
    if several_arms(problem.task):
        rows.sort(key=lambda row: (row[1][0], row[2]))
    for step, (begin, end), _ in rows:
        yield step, scene, begin, end
        if isinstance(step.action, Event):
            scene = scene_after(scene, step.action, problem.robot, trajectory(end), end)


def _parts_of_arms(problem: Problem, trajectory: Trajectory) -> list[ScenePart]:
    """Return the parts of a motion of several arms: between events, and where what may touch changes."""
    rows = list(steps_in_time(problem, trajectory))
    changes = [(0.0, problem.scene)]
    for step, scene, begin, _ in rows:
        if isinstance(step.action, Event):
            changes.append((begin, scene_after(scene, step.action, problem.robot, trajectory(begin), begin)))
    times = sorted({0.0, trajectory.duration, *(t for _, _, begin, end in rows for t in (begin, end))})
    found: list[_Stretch] = []
    for begin, end in pairwise(times):
        base = next(scene for since, scene in reversed(changes) if since <= begin)
        steps = [step for step, _, since, until in rows if since < end and until > begin]
        during = base
        for step in steps:
            during = scene_during(during, step)
        if found and found[-1][0] is base and found[-1][1].allowed == during.allowed:
            found[-1] = (
                base,
                during,
                found[-1][2],
                end,
                list({id(one): one for one in [*found[-1][4], *steps]}.values()),
            )
        else:
            found.append((base, during, begin, end, steps))
    return list(_parts_with_ends(problem, found, _step_ends(problem, trajectory)))


def part_problem(problem: Problem, scene: Scene) -> Problem:
    """Return the problem of a part of a task, with the masses of what is held."""
    robot = carrying(problem.robot, scene)
    return derived(problem, robot=robot, scene=scene, task=(), path_constraints=())


def _words(steps: list[TaskStep]) -> str:
    numbers = sorted(step.number for step in steps)
    if not numbers:
        return "no step"
    return f"steps {numbers[0]} to {numbers[-1]}" if numbers[0] != numbers[-1] else f"step {numbers[0]}"
