"""Parts of a task, one after another, as one motion of all joints."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.task.planned_steps import Stretch, TaskPart, object_and_link
from optiplan.problem.problem import Problem
from optiplan.robot.robot import Robot
from optiplan.trajectory.joining import join_trajectories, standstill
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
            motions.append(motion_of_all_joints(problem.robot, part.steps[0].stage.columns, part.motion, q))
        elif part.duration > 0.0:
            motions.append(standstill(problem.robot.joint_names, q, part.duration))
        since = begin
        for planned, end in zip(part.steps, part.ends, strict=True):
            step, held = planned.step, object_and_link(planned)
            segments.append(Segment(step.number, step.kind, step.name, since, begin + end, *held))
            since = begin + end
        begin = since
    motion = join_trajectories(motions or [standstill(problem.robot.joint_names, problem.start, SHORTEST_DURATION)])
    return replace(motion, segments=tuple(segments))


def motion_of_all_joints(robot: Robot, columns: Sequence[int], motion: Trajectory, q: Array) -> Trajectory:
    """Return the motion of all joints in which some move and the others stand where they stand in q (n,)."""
    coefficients = np.zeros((*motion.coefficients.shape[:2], robot.n))
    coefficients[:, 0] = q
    coefficients[:, :, columns] = motion.coefficients
    return Trajectory(robot.joint_names, motion.breakpoints, coefficients)
