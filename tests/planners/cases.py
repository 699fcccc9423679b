"""Small problems for the planners' tests."""

from functools import cache

import numpy as np
import pinocchio as pin

from optiplan.model.robot import load_robot
from optiplan.model.scene import Box, Obstacle, Scene
from optiplan.problem.problem import JointGoal, PoseGoal, Problem

READY = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
LEFT = np.array([1.2, 0.2, 0.1, -1.9, 0.1, 2.0, 0.6])


@cache
def robot(name):
    return load_robot(name)


def box(name, size, position):
    return Obstacle(name, Box(size), pin.SE3(np.eye(3), np.array(position, dtype=float)))


def tool_pose(name, q):
    model = robot(name).model
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return data.oMf[model.getFrameId(robot(name).tool_frame)].copy()


def problem(name, start, goal, *obstacles, seed=0):
    arm = robot(name)
    return Problem("case", arm, Scene(obstacles), np.array(start, dtype=float), tuple(goal), arm.limits, seed=seed)


def free():
    return problem("panda", READY, [JointGoal(LEFT)])


def pose():
    return problem("panda", READY, [PoseGoal(robot("panda").tool_frame, tool_pose("panda", LEFT))])


def any_of():
    return problem("panda", READY, [JointGoal(LEFT), JointGoal(0.5 * (READY + LEFT))])


def planar():
    return problem("planar2r", [0.5, 1.0], [JointGoal(np.array([-1.0, 0.3]))])


def wall():
    """A plate between start and goal that the straight line meets and a way over the top avoids."""
    return problem("panda", READY, [JointGoal(LEFT)], box("plate", (0.5, 0.02, 0.5), (0.5, 0.25, 0.25)))


def nowhere():
    return problem("panda", READY, [JointGoal(READY)])


SOLVABLE = {"free": free, "pose": pose, "any-of": any_of, "planar": planar, "wall": wall, "nowhere": nowhere}


def too_far():
    far = pin.SE3(np.eye(3), np.array([2.0, 0.0, 0.5]))
    return problem("panda", READY, [PoseGoal(robot("panda").tool_frame, far)])


def goal_in_wall():
    at = tool_pose("panda", LEFT).translation
    return problem("panda", READY, [JointGoal(LEFT)], box("block", (0.1, 0.1, 0.1), at))


def start_in_wall():
    at = tool_pose("panda", READY).translation
    return problem("panda", READY, [JointGoal(LEFT)], box("block", (0.1, 0.1, 0.1), at))


def closed_box():
    """The hand should get into a box without an opening: every inverse-kinematics solution pierces a plate."""
    centre = tool_pose("panda", LEFT).translation
    plates = []
    for axis in range(3):
        size = tuple(0.02 if i == axis else 0.3 for i in range(3))
        for side in (-0.15, 0.15):
            plates.append(box(f"{'xyz'[axis]}{side:+}", size, centre + side * np.eye(3)[axis]))
    return problem("panda", READY, [PoseGoal(robot("panda").tool_frame, tool_pose("panda", LEFT))], *plates)


def barred():
    """A planar arm whose shoulder would have to pass a bar above or a bar below; both ends are free."""
    bars = [box("bar above", (0.1, 0.6, 2.0), (0.0, 0.15, 1.7)), box("bar below", (0.1, 0.6, 2.0), (0.0, 0.15, -0.7))]
    return problem("planar2r", [0.0, 0.3], [JointGoal(np.array([3.0, 0.2]))], *bars)


UNSOLVABLE = {
    "too-far": (too_far, {"goal-unreachable"}),
    "goal-in-wall": (goal_in_wall, {"goal-in-collision"}),
    "closed-box": (closed_box, {"goal-in-collision"}),
    "start-in-wall": (start_in_wall, {"start-in-collision"}),
    "barred": (barred, {"no-path", "collision", "budget"}),
}
