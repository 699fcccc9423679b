"""A first problem of a robot: a start, a goal that it reaches, and the text of the file."""

from collections.abc import Iterable, Sequence

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.collision.kept_models import collision_model
from optiplan.geometry.scene import Scene
from optiplan.kinematics.ik.solve import Answer, answer
from optiplan.problem.write import flow
from optiplan.robot.frames import frame_pose
from optiplan.robot.robot import Robot

SHIFTS = ((0.0, 0.25, -0.1), (0.0, -0.25, -0.1), (0.1, 0.2, 0.0), (-0.15, 0.1, 0.0), (0.0, 0.1, 0.05), (0.0, 0.0, 0.05))
"""From the tool at the start to proposed goals, m, the largest first."""

ROUNDED = 1e-3
"""rad or m: so far from their limits joints are, whose values are rounded to it."""

STEPS = (0.5, -0.5, 0.2, -0.2, 0.05, -0.05)
"""Of all joints to proposed goals, rad or m, where no such point is reached."""


def start_of(robot: Robot) -> str | None:
    """Return the named configuration to start from; None where the robot has none: then zero, within its limits."""
    return next(
        (name for name in ("ready", "home") if name in robot.configurations), next(iter(robot.configurations), None)
    )


def _q(robot: Robot, start: str | None) -> Array:
    if start is not None:
        return np.asarray(robot.configurations[start], float)
    lower, upper = (np.nan_to_num(x, posinf=0.0, neginf=0.0) for x in (robot.limits.lower, robot.limits.upper))
    return np.clip(np.zeros(robot.n), lower, np.maximum(lower, upper))


def reached(robot: Robot, start: str | None, point: Sequence[float] | Array) -> Answer:
    """Return the configurations that put the tool at a point (3,), m, turned as it is at the start."""
    q = _q(robot, start)
    rotation = frame_pose(robot, q, robot.tool_frame).rotation
    return answer(robot, robot.tool_frame, pin.SE3(rotation, np.asarray(point, float)), q)


def proposed_goal(robot: Robot, start: str | None) -> list[float] | None:
    """Return a point [x, y, z], m, that the tool reaches as it is turned at the start, where the robot is free.

    None where there is none, as of most arms with fewer than six joints.
    """
    tool = frame_pose(robot, _q(robot, start), robot.tool_frame).translation
    model = collision_model(robot, Scene())
    for shift in SHIFTS:
        point = np.round(tool + shift, 3)
        found = reached(robot, start, point).solutions
        if any(one.within_limits and not model.collides(one.q) for one in found):
            return [float(x) for x in point]
    return None


def moved_joints(robot: Robot, start: str | None) -> Array:
    """Return a configuration (n,) not far from the start in which the robot is free; the start where there is none."""
    q, model = _q(robot, start), collision_model(robot, Scene())
    lower, upper = robot.limits.lower + ROUNDED, robot.limits.upper - ROUNDED
    steps = (np.where(lower < upper, np.clip(q + step, lower, upper).round(3), q) for step in STEPS)
    return next((moved for moved in steps if not np.allclose(moved, q) and not model.collides(moved)), q)


def first_problem(robot: Robot, name: str, start: str | None, goal: list[float] | None, title: str, schema: str) -> str:
    """Return the text of a problem file.

    Args:
        robot: the robot.
        name: how the file calls it.
        start: named configuration; None: zero.
        goal: [x, y, z] of the tool, m; None: a configuration.
        title: name of the problem.
        schema: file name of the JSON schema beside it.
    """
    q = _q(robot, start)
    begins = flow({"configuration": start}) if start is not None else f"{{joints: [{_row(q)}]}}"
    ends = f"joints: [{_row(moved_joints(robot, start))}]"
    if goal is not None:
        rpy = pin.rpy.matrixToRpy(frame_pose(robot, q, robot.tool_frame).rotation)
        ends = f"pose: {{position: [{_row(goal)}], rpy: [{_row(rpy)}]}}"
    rows = [
        f"# yaml-language-server: $schema={schema}",
        "# Metres and radians. optiplan plan --view shows the motion; optiplan check tells what is wrong.",
        "version: 1",
        f"name: {flow(title)}",
        f"robot: {flow(name)}",
        f"start: {begins}",
        "goal:",
        f"  {ends}",
        "# scene:    # take the # away, and put the box in the way",
        "#   obstacles:",
        "#     - {name: box, shape: {box: [0.1, 0.1, 0.3]}, pose: {position: [0.5, 0.1, 0.15]}}",
    ]
    return "\n".join(rows) + "\n"


def _row(values: Iterable[float]) -> str:
    return ", ".join(f"{round(float(x), 4) + 0.0:g}" for x in values)
