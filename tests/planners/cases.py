"""Small problems for the planners' tests."""

import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from optiplan.geometry.scene import Box, Obstacle, Scene
from optiplan.problem.problem import JointGoal, PoseGoal, Problem, RegionGoal, Via, derived
from optiplan.robot.robot import load_robot
from tests.robot.robots import chain, joint, write_robot
from tests.unchecked_problem import unchecked_problem

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


def problem(name, start, goal, *obstacles, seed=0, allowed=()):
    arm = robot(name)
    scene = Scene(obstacles, allowed=frozenset(frozenset(pair) for pair in allowed))
    return unchecked_problem(
        name="case",
        robot=arm,
        scene=scene,
        start=np.array(start, dtype=float),
        goal=tuple(goal),
        limits=arm.limits,
        seed=seed,
    )


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


IN_DUCT = np.array([0.0, 0.5, 0.0, -1.5, 0.0, 3.57, 0.785])  # of panda: stretched forward


def duct():
    """The goal has a Panda's hand and forearm in a duct, whose walls leave the wrist a centimetre."""
    x, _, z = tool_pose("panda", IN_DUCT).translation - np.array([0.175, 0.0, 0.0])
    level, upright = (0.45, 0.4, 0.02), (0.45, 0.02, 0.32)
    plates = [box(f"plate {side:+}", level, (x, 0.0, z + 0.16 * side)) for side in (-1, 1)]
    sides = [box(f"side {side:+}", upright, (x, 0.15 * side, z)) for side in (-1, 1)]
    return problem("panda", READY, [JointGoal(IN_DUCT)], *plates, *sides)


def nowhere():
    return problem("panda", READY, [JointGoal(READY)])


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
    """A planar arm whose shoulder would have to pass a bar above or a bar below, in its base; both ends are free."""
    bars = [box("bar above", (0.1, 0.6, 2.0), (0.0, 0.15, 1.7)), box("bar below", (0.1, 0.6, 2.0), (0.0, 0.15, -0.7))]
    allowed = [("bar above", "base"), ("bar below", "base")]
    return problem("planar2r", [0.0, 0.3], [JointGoal(np.array([3.0, 0.2]))], *bars, allowed=allowed)


HANGING, RAISED = np.array([0.9, 0.4]), np.array([-0.6, 0.9])  # of planar2r


def swing():
    """A planar arm with nothing around it."""
    return problem("planar2r", HANGING, [JointGoal(RAISED)])


def unlimited_jerk():
    """The same, where acceleration may jump."""
    return derived(swing(), limits=replace(swing().limits, jerk=np.full(2, np.inf)))


def one_box():
    """A box on the way of the stretched forearm: it must be drawn in."""
    return problem(
        "planar2r", [0.7, 0.3], [JointGoal(np.array([-0.7, 0.3]))], box("box", (0.1, 0.6, 0.1), (1.0, 0.2, 0.5))
    )


def tight():
    """Between two plates, a centimetre above and below the links, into the open and down."""
    plates = [box(f"plate {z}", (0.6, 0.6, 0.02), (0.9, 0.2, z)) for z in (0.43, 0.57)]
    return problem("planar2r", [0.0, 0.0], [JointGoal(np.array([0.0, 0.03]))], *plates)


def through_a_via():
    return derived(swing(), vias=(Via(JointGoal(np.array([0.2, 1.1]))),))


def small_reach():
    """A Panda's hand moves ten centimetres, keeping its orientation: every Cartesian planner can follow."""
    X_WG = tool_pose("panda", READY)
    X_WG.translation = X_WG.translation + np.array([0.05, 0.05, -0.07])
    return problem("panda", READY, [PoseGoal(robot("panda").tool_frame, X_WG)])


def half_space_to_reach():
    """A Panda's hand goes down by 7 cm or more, and may turn about its axis."""
    X_WG, free = small_reach().goal[0].X_WG, np.inf
    low, high = np.array([-0.02, -0.02, 0.0, -0.1, -0.1, -free]), np.array([0.02, 0.02, free, 0.1, 0.1, free])
    return problem("panda", READY, [RegionGoal(robot("panda").tool_frame, X_WG, pin.SE3.Identity(), low, high)])


def round_trip():
    """A Panda's hand ends where it began: what circles are for."""
    return problem("panda", READY, [PoseGoal(robot("panda").tool_frame, tool_pose("panda", READY))])


def stay():
    return problem("planar2r", HANGING, [JointGoal(HANGING)])


@cache
def turntable():
    with tempfile.TemporaryDirectory() as folder:
        table = joint("table", "a", "b", "continuous", '<limit velocity="2" effort="9"/>')
        parts = chain(table, joint("lever", "b", "c", x=0.2))
        limits = "limits: {acceleration: 8.0, jerk: 80.0}\n"
        return load_robot(str(write_robot(Path(folder), parts, limits)))


def endless():
    """An endless joint may turn on: from 3 to -3 rad it is a quarter of a radian across, or six back."""
    arm = turntable()
    return unchecked_problem(
        name="endless",
        robot=arm,
        scene=Scene(),
        start=np.array([3.0, 0.0]),
        goal=(JointGoal(np.array([-3.0, 1.0])),),
        limits=arm.limits,
    )


def weak():
    """Motors that hold the arm on the way, but cannot speed it up as fast as its acceleration limits allow."""
    return derived(swing(), limits=replace(swing().limits, torque=np.array([27.0, 7.0])))


def too_weak():
    """Motors that hold the arm where it starts and not where it shall end."""
    limits = replace(swing().limits, torque=np.array([15.0, 20.0]))
    return derived(problem("planar2r", [1.4, 0.1], [JointGoal(np.array([0.0, 0.1]))]), limits=limits)


def out_of_reach():
    far = pin.SE3(np.eye(3), np.array([3.0, 0.18, 0.5]))
    return problem("planar2r", HANGING, [PoseGoal("tool", far)])


def start_in_box():
    return problem(
        "planar2r",
        HANGING,
        [JointGoal(RAISED)],
        box("box", (0.1, 0.1, 0.1), tool_pose("planar2r", HANGING).translation),
    )


def goal_in_box():
    return problem(
        "planar2r", HANGING, [JointGoal(RAISED)], box("box", (0.1, 0.1, 0.1), tool_pose("planar2r", RAISED).translation)
    )


class Case(NamedTuple):
    """A problem of the contract, and the kinds of failure with which a planner may answer it.

    `simple` is what stops a planner that cannot go around things; None: the planner must find a motion, if it plans in
    the joints' space and there is time. Those that lead the tool may refuse anything.
    """

    make: Callable[[], Problem]
    simple: frozenset[str] | None
    search: frozenset[str] | None = None


def _only(*kinds: str) -> frozenset[str]:
    return frozenset(kinds)


CONTRACT = {
    "free": Case(swing, None),
    "unlimited-jerk": Case(unlimited_jerk, None),
    "one-box": Case(one_box, _only("collision")),
    "tight": Case(tight, None),
    "via": Case(through_a_via, None),
    "pose": Case(small_reach, None),
    "region": Case(half_space_to_reach, None),
    "round-trip": Case(round_trip, None),
    "stay": Case(stay, None),
    "endless": Case(endless, None),
    "weak": Case(weak, None),
    "too-weak": Case(too_weak, _only("infeasible"), _only("infeasible")),
    "out-of-reach": Case(out_of_reach, _only("goal-unreachable"), _only("goal-unreachable")),
    "start-in-box": Case(start_in_box, _only("start-in-collision"), _only("start-in-collision")),
    "goal-in-box": Case(goal_in_box, _only("goal-in-collision"), _only("goal-in-collision")),
    "barred": Case(barred, _only("collision"), _only("no-path", "budget")),
}

OPTIONS = {"arc": {"through": [0.33, 0.03, 0.56]}, "circle": {"radius": 0.05, "plane": "xy"}}
"""Of planners that have no task without them, made for `pose` and `round-trip`."""
