"""The report on screw motion of Baxter, as far as it is about the arm: geometry, Jacobian, limits, reachable poses."""

import numpy as np
import pinocchio as pin
import pytest

from optiplan.kinematics.ik.numeric import IkOptions, IkResult, solve_ik
from optiplan.robot.batched.kinematics import BatchKinematics
from optiplan.robot.frames import geometric_jacobian
from optiplan.robot.robot import Robot, load_robot
from tests.reference.baxter import NAMES, free_report_arm
from tests.reference.entries import entry
from tests.reference.poses import pose, rot, tool_pose


@pytest.fixture(scope="module")
def arm() -> Robot:
    """The report's arm within the report's limits."""
    return load_robot("baxter_report")


@pytest.fixture(scope="module")
def free_arm(tmp_path_factory) -> Robot:
    """The same with joints that turn three times round."""
    return free_report_arm(tmp_path_factory.mktemp("free"), 9.4)


@pytest.fixture(scope="module")
def baxter() -> Robot:
    return load_robot("baxter", group="right")


def test_sclerp_baxter_geometry(arm):
    expected, kinematics = entry("sclerp.baxter.geometry"), BatchKinematics(arm.model)
    axes, points = kinematics.axes(kinematics.poses(np.zeros((1, 7))))
    assert list(arm.joint_names) == expected["names"] == list(NAMES)
    expected.check(axes[0], "axes")
    expected.check(points[0], "points")


def test_sclerp_baxter_home(arm):
    X = tool_pose(arm, np.zeros(7))
    entry("sclerp.baxter.home").check(X)
    assert abs(X[1, 3] - 1.372) > 0.3  # as printed in section V
    assert abs(X[1, 3] - 1.0372) < 5e-5


def test_sclerp_baxter_jacobian_home(arm):
    expected = entry("sclerp.baxter.jacobian_home")
    J = geometric_jacobian(arm, np.zeros(7), arm.tool_frame)
    J[:3] = J[:3] - np.cross(J[3:].T, tool_pose(arm, np.zeros(7))[:3, 3]).T  # spatial: of the point in the origin
    s = np.linalg.svd(J, compute_uv=False)
    expected.check(s, "singular_values")
    expected.check(s[0] / s[-1], "condition")


def test_sclerp_baxter_limits_seed(arm):
    expected = entry("sclerp.baxter.limits_seed")
    expected.check(arm.limits.lower, "lower")
    expected.check(arm.limits.upper, "upper")
    right = entry("sclerp.baxter.urdf_map")["limits_in_report_signs"]
    for j, turned_about in enumerate(entry("sclerp.baxter.urdf_map")["sign"]):
        differ = abs(expected["lower"][j] - right["lower"][j])
        assert differ > 0.5 if turned_about < 0 else differ < 0.027


def test_sclerp_baxter_urdf_map(arm, baxter):
    """Three joints of the report turn the other way; with the signs put right the two arms are the same to 0.07 mm."""
    expected, rng = entry("sclerp.baxter.urdf_map"), np.random.default_rng(0)
    sign, offset = np.array(expected["sign"]), np.array(expected["offset"])

    bounds = np.array([sign * (limit - offset) for limit in (baxter.limits.lower, baxter.limits.upper)])
    expected.check(bounds.min(axis=0), "limits_in_report_signs", "lower")
    expected.check(bounds.max(axis=0), "limits_in_report_signs", "upper")
    Q = rng.uniform(-1.0, 1.0, (200, 7))
    ours = np.array([tool_pose(arm, q) for q in Q])
    right, same = (np.array([lying(baxter, s * q + offset) for q in Q]) for s in (sign, np.ones(7)))
    worst = np.linalg.norm(ours[:, :3, 3] - right[:, :3, 3], axis=1).max()
    expected.check(worst, "position_error")
    assert worst < 1e-4
    between = np.einsum("nji,njk->nik", right[:, :3, :3], ours[:, :3, :3])
    assert np.abs(between - between[0]).max() < 1e-9  # one constant rotation of the tool
    expected.check(np.linalg.norm(ours[0, :3, 3] - same[0, :3, 3]), "same_sign_position_error")


def lying(baxter: Robot, q: np.ndarray) -> np.ndarray:
    """Pose of the right hand in the report's base frame: joint S0, the 45° of the mount taken back, y along the arm."""
    X_WS = tool_pose(baxter, q, "right_arm_mount")
    point = X_WS[:3, 3] + X_WS[:3, :3] @ [0.055695, 0.0, 0.011038]  # of joint S0
    return np.linalg.inv(pose(X_WS[:3, :3] @ rot("z", -np.pi / 4), point)) @ tool_pose(baxter, q, "right_hand_link")


def solve(robot: Robot, X: np.ndarray, seeds: int = 60) -> IkResult:
    """Within the joint limits, from many starts of which the first is the report's own, the arm stretched out."""
    rng = np.random.default_rng(6)
    starts = [np.zeros(7), *rng.uniform(robot.limits.lower, robot.limits.upper, (seeds, 7))]
    options = IkOptions(position=3e-8, orientation=3e-8, count=1, iterations=200)
    return solve_ik(robot, robot.tool_frame, pin.SE3(X), starts, options)


def test_sclerp_pure_rotation_other_axes(arm, free_arm):
    """Turned about x or z, the stretched arm's wrist soon leaves its ball: how far it comes, to 0.1 degree."""
    expected, size = entry("sclerp.pure_rotation_other_axes"), entry("sclerp.baxter.geometry")["links"]
    reach = np.hypot(size["l2"], size["l23"]) + np.hypot(size["l4"], size["l45"])
    assert reach == pytest.approx(expected["wrist_reach_max"], abs=1e-9)
    points = entry("sclerp.baxter.geometry")["points"]
    assert np.linalg.norm(np.subtract(points[5], points[1])) == pytest.approx(expected["wrist_distance_home"], abs=1e-9)
    for robot, key in ((free_arm, "max_rotation_deg_no_limits"), (arm, "max_rotation_deg_seed_limits")):
        for name, most in expected[key].items():
            assert turned(robot, name, most - expected.tolerance), (key, name)
            assert not turned(robot, name, most + expected.tolerance), (key, name)
    elsewhere = tool_pose(arm, np.array([-0.5, -0.6, 0.8, 1.2, -0.9, 0.7, 0.4]))
    for axis, degrees in (("x", 30.0), ("z", -30.0)):
        assert solve(arm, elsewhere @ pose(rot(axis, np.radians(degrees)), np.zeros(3))).solutions


def turned(robot: Robot, name: str, degrees: float) -> bool:
    """Whether the stretched arm's tool can turn so far about its own x or z axis, its place kept."""
    angle = np.radians(degrees if name.endswith("plus") else -degrees)
    found = solve(robot, tool_pose(robot, np.zeros(7)) @ pose(rot(name[0], angle), np.zeros(3)))
    return bool(found.solutions)


def test_sclerp_reachable(arm):
    expected = entry("sclerp.reachable")
    goals = {run["id"]: np.array(run["goal"]) for run in entry("sclerp.runs").value}
    assert set(goals) == {*expected["seed_limits"], *expected["unreachable"]}
    for name, X in goals.items():
        found = solve(arm, X)
        assert bool(found.solutions) == (name in expected["seed_limits"]), name
        if found.solutions:
            assert np.abs(tool_pose(arm, found.solutions[0]) - X).max() <= expected.tolerance
