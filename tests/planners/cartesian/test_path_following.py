"""Joint paths that follow tool paths: true between knots, smooth, on one branch, clear of limits, or a reason."""

import threading
from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest

from optiplan.collision.model import CollisionModel
from optiplan.geometry.scene import Scene
from optiplan.planners.base import Budget, Failure
from optiplan.planners.cartesian import path_following
from optiplan.planners.cartesian.diagnosis import limit_crossing
from optiplan.planners.cartesian.differential_ik import Aim, Tracker
from optiplan.planners.cartesian.path_following import follow
from optiplan.planners.cartesian.tool_path import ToolPath, circle, line, screw
from optiplan.robot.frames import frame_pose, geometric_jacobian
from optiplan.robot.robot import load_robot
from optiplan.trajectory.trajectory import Trajectory

READY = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
UR5 = np.array([-0.02, -1.359, 1.644, -0.284, 1.551, 0.0])
HOME = np.array([0.0, 0.0, 0.0, 0.0, -1.2, -1.6, -1.9, 1.5708, 0.0])
STARTS = {"ur5": UR5, "panda": READY, "delbot": HOME}


@cache
def model(name):
    return CollisionModel(load_robot(name), Scene(()))


def start_pose(name):
    robot = model(name).robot
    return frame_pose(robot, STARTS[name], robot.tool_frame)


def moved(name, shift, turn=(0.0, 0.0, 0.0)):
    X = start_pose(name)
    return pin.SE3(pin.exp3(np.array(turn)) @ X.rotation, X.translation + np.array(shift))


def run(name, path, aim=None):
    return follow(model(name), tracker(name, path, aim), STARTS[name], Budget(20.0))


def tracker(name, path, aim=None):
    robot = model(name).robot
    return Tracker(robot, robot.limits, robot.tool_frame, path, aim or Aim())


def worst_error(name, path, followed, aim=None):
    """Largest component of the tool's error at 1500 random places, none of them a knot."""
    at = np.random.default_rng(1).uniform(0.0, 1.0, 1500)
    here = tracker(name, path, aim)
    return max(np.abs(here.error(s, q)).max() for s, q in zip(at, followed(at), strict=True))


def paths(name):
    goal = moved(name, (-0.05, 0.2, -0.1), (0.3, -0.2, 0.6))
    X = start_pose(name)
    return {
        "line": line(X, goal),
        "screw": screw(X, goal),
        "circle": circle(X, X.translation - [0.0, 0.0, 0.1], np.array([2.0 * np.pi, 0.0, 0.0]), np.zeros(3)),
    }


@pytest.mark.parametrize("kind", ["line", "screw", "circle"])
@pytest.mark.parametrize("name", sorted(STARTS))
def test_tool_stays_on_its_path_between_knots_and_the_joints_are_smooth(name, kind):
    path = paths(name)[kind]
    followed = run(name, path)
    assert isinstance(followed, Trajectory), followed
    assert np.array_equal(followed.start, STARTS[name])
    assert followed.duration == 1.0
    assert worst_error(name, path, followed) <= 1e-6
    for order, rounding in ((0, 1e-13), (1, 1e-11), (2, 1e-9)):
        assert np.abs(followed.jumps(order)).max() < rounding


def test_rates_move_the_tool_as_the_path_says():
    """J q' is the path's twist, J q'' + J' q' its rate; J' q' against differences."""
    path = ToolPath(
        start_pose("panda"), np.array([0.1, 0.3, -0.2]), np.array([0.0, 1.0, 0.5]), np.array([0.4, 0.0, 0.1])
    )
    for aim in (Aim(), Aim(goal=READY + 0.1)):
        here, robot, h = tracker("panda", path, aim), model("panda").robot, 1e-6
        dq = here.rate(0.0, READY)
        ddq = here.joint_curvature(0.0, READY, dq)

        def twist(s, q=READY, v=dq, robot=robot):
            return geometric_jacobian(robot, q + s * v, robot.tool_frame) @ v

        J = geometric_jacobian(robot, READY, robot.tool_frame)
        assert J @ dq == pytest.approx(path.twist(0.0), abs=1e-12)
        drift = (twist(h) - twist(-h)) / (2.0 * h)
        assert J @ ddq + drift == pytest.approx(path.twist_rate(0.0), abs=1e-7)


def test_second_derivative_is_that_of_the_flow():
    """The null-space part too: q'' against differences of q' along it, with and without a redundant arm."""
    for name in ("ur5", "panda", "delbot"):
        here, h = tracker(name, paths(name)["screw"], Aim(avoidance=20.0)), 1e-3
        q, dq = STARTS[name], here.rate(0.5, STARTS[name])
        q = here.correct(0.5, q)
        dq = here.rate(0.5, q)
        ddq = here.joint_curvature(0.5, q, dq)
        ahead, behind = (here.rate(0.5 + x, q + x * dq + 0.5 * x**2 * ddq) for x in (h, -h))
        assert ddq == pytest.approx((ahead - behind) / (2.0 * h), abs=1e-3 * np.abs(ddq).max())


def test_drift_runs_down_the_gradient_of_its_cost():
    """-x^5 is the negative gradient in z = q / v of sum h / v x^6 / 6."""
    robot = model("panda").robot
    limits, h = robot.limits, 1e-6
    half, middle = 0.5 * (limits.upper - limits.lower), 0.5 * (limits.upper + limits.lower)

    def cost(z):
        x = (z * limits.velocity - middle) / half
        return (half / limits.velocity * x**6 / 6.0).sum()

    q = middle + 0.8 * half * np.array([1, -1, 0.5, 0.9, -0.3, 1, -1])
    gradient = [(cost(q / limits.velocity + e) - cost(q / limits.velocity - e)) / (2.0 * h) for e in h * np.eye(7)]
    here = tracker("panda", paths("panda")["line"], Aim(avoidance=1.0))
    still = tracker("panda", paths("panda")["line"], Aim(avoidance=0.0))
    J = geometric_jacobian(robot, q, robot.tool_frame) * limits.velocity
    free = np.eye(7) - np.linalg.pinv(J) @ J
    task = still.rate(0.0, q) / limits.velocity
    expected = task - np.linalg.norm(task) * free @ gradient
    assert here.rate(0.0, q) / limits.velocity == pytest.approx(expected, abs=1e-8)


def test_a_redundant_arm_keeps_clear_of_limits_without_disturbing_the_tool():
    robot = model("panda").robot
    start = np.clip(READY + np.array([0.1, 0.0, 0.2, 0.0, 0.0, 0.0, 1.6]), robot.limits.lower, robot.limits.upper)
    X = frame_pose(robot, start, robot.tool_frame)
    path = line(
        X, pin.SE3(pin.exp3(np.array([0.0, 0.0, -0.6])) @ X.rotation, X.translation + np.array([0.0, 0.25, 0.0]))
    )
    room = {}
    for avoidance in (0.0, 20.0):
        followed = follow(model("panda"), tracker("panda", path, Aim(avoidance=avoidance)), start, Budget(20.0))
        if isinstance(followed, Failure):
            room[avoidance] = (0.0, followed.witness["cause"])
            continue
        assert worst_error("panda", path, followed) <= 1e-6
        Q = followed(np.linspace(0.0, 1.0, 300))
        room[avoidance] = (np.minimum(Q - robot.limits.lower, robot.limits.upper - Q).min(), "")
    assert room[0.0] == (0.0, "joint limit")
    assert room[20.0][0] > 0.05


def test_a_redundant_arm_arrives_at_the_configuration_that_it_aims_at():
    X = start_pose("delbot")
    path = circle(X, X.translation - [0.0, 0.3, 0.0], np.array([0.0, 0.0, 2.0 * np.pi]), np.zeros(3))
    anywhere, back = run("delbot", path), run("delbot", path, Aim(goal=HOME))
    assert np.abs(anywhere.end - HOME).max() > 1e-3
    assert back.end == pytest.approx(HOME, abs=1e-12)
    assert worst_error("delbot", path, back, Aim(goal=HOME)) <= 1e-6


def test_free_orientation_follows_the_position_only():
    path = line(start_pose("ur5"), moved("ur5", (-0.1, 0.2, 0.1)))
    aim = Aim(orientation=False)
    followed = run("ur5", path, aim)
    assert worst_error("ur5", path, followed, aim) <= 1e-6
    assert worst_error("ur5", path, followed) > 1e-3


def test_another_configuration_of_the_goal_pose_is_named():
    path = line(start_pose("ur5"), moved("ur5", (0.0, 0.1, 0.0)))
    end = run("ur5", path).end
    other = end + 2.0 * np.pi * np.eye(6)[5]
    failure = run("ur5", path, Aim(goal=other))
    assert (failure.kind, failure.witness["cause"], failure.witness["joint"]) == ("no-path", "branch", "wrist_3_joint")
    assert failure.witness["fraction"] == 1.0


def test_the_path_must_begin_where_the_tool_is():
    path = line(moved("ur5", (0.0, 1e-3, 0.0)), moved("ur5", (0.0, 0.1, 0.0)))
    with pytest.raises(ValueError, match="begin"):
        run("ur5", path)


def test_two_joints_cannot_do_what_takes_six():
    robot = load_robot("planar2r")
    q = np.array([0.5, 1.0])
    X = frame_pose(robot, q, robot.tool_frame)
    path = line(X, pin.SE3(X.rotation, X.translation + np.array([0.1, 0.0, 0.1])))
    failure = follow(
        CollisionModel(robot, Scene(())), Tracker(robot, robot.limits, robot.tool_frame, path, Aim()), q, Budget(5.0)
    )
    assert (failure.kind, failure.witness["fraction"]) == ("unsupported", 0.0)


def test_a_path_of_too_many_knots_says_so_where_nothing_ends_it_before(monkeypatch):
    monkeypatch.setattr(path_following, "_MOST_KNOTS", 4)
    path = paths("ur5")["line"]
    failure = run("ur5", path)
    assert (failure.kind, failure.witness["cause"]) == ("no-path", "knots")
    robot = model("ur5").robot
    narrow = replace(robot, limits=replace(robot.limits, lower=UR5 - 1e-3, upper=UR5 + 1e-3))
    held = Tracker(narrow, narrow.limits, robot.tool_frame, path, Aim())
    before = follow(model("ur5"), held, UR5, Budget(20.0))
    assert (before.kind, before.witness["fraction"] < failure.witness["fraction"]) == ("limits", True)


def test_first_crossing_of_a_limit_is_found():
    """q = 3 s (1 - s) of one joint, minus that of another: 0.48 is met at s = 0.2, and again at 0.8."""
    robot = load_robot("planar2r")
    path = Trajectory(
        robot.joint_names,
        np.array([0.0, 1.0]),
        np.array([[[0.0, 0.0], [3.0, -3.0], [-3.0, 3.0]]]),
    )
    limits = replace(robot.limits, lower=np.array([-1.0, -0.48]), upper=np.array([0.63, 1.0]))
    s, joint = limit_crossing(path, limits)
    assert (s, joint) == (pytest.approx(0.2, abs=1e-8), 1)
    assert limit_crossing(path, replace(limits, lower=np.full(2, -1.0), upper=np.full(2, 1.0))) is None


def test_stops_when_asked():
    cancel = threading.Event()
    cancel.set()
    path = paths("ur5")["line"]
    failure = follow(model("ur5"), tracker("ur5", path), UR5, Budget(20.0, cancel))
    assert failure.kind == "cancelled"
