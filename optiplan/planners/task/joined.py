"""Parts of a task, one after another, as one motion of all joints."""

from collections.abc import Sequence
from dataclasses import replace

from optiplan.planners.task.planned_steps import Stretch, TaskPart, object_and_link
from optiplan.problem.problem import Problem
from optiplan.problem.task.steps import TaskStep
from optiplan.trajectory.joining import join_trajectories, standstill, with_resting_joints
from optiplan.trajectory.segments import Segment
from optiplan.trajectory.tolerances import SHORTEST_DURATION
from optiplan.trajectory.trajectory import Trajectory


def joined_parts(problem: Problem, parts: Sequence[TaskPart]) -> Trajectory:
    """Join parts, each at rest at both ends, to one motion of all joints, with its segments."""
    motions: list[Trajectory] = []
    segments: list[Segment] = []
    begin = 0.0
    for part in parts:
        q = part.steps[0].before.q
        if isinstance(part, Stretch):
            motions.append(with_resting_joints(part.motion, part.steps[0].stage.columns, problem.robot.joint_names, q))
        elif part.duration > 0.0:
            motions.append(standstill(problem.robot.joint_names, q, part.duration))
        since = begin
        for planned, end in zip(part.steps, part.ends, strict=True):
            step, held = planned.step, object_and_link(planned)
            segments.append(Segment(step.number, step.kind, step.name, since, begin + end, *held))
            since = begin + end
        begin = since
    if not motions:
        return standing_still(problem, [planned.step for part in parts for planned in part.steps], segments)
    return replace(join_trajectories(motions), segments=tuple(segments))


def standing_still(problem: Problem, steps: Sequence[TaskStep], segments: Sequence[Segment]) -> Trajectory:
    """Return the motion of steps in which nothing moves: the last one that is no event takes the shortest time."""
    T, last = SHORTEST_DURATION, max((k for k, step in enumerate(steps) if not step.event), default=len(steps))
    timed = [replace(one, begin=T * (k > last), end=T * (k >= last)) for k, one in enumerate(segments)]
    return replace(standstill(problem.robot.joint_names, problem.start, T), segments=tuple(timed))
