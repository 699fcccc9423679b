"""The lecture's robots and formulas, trajectories apart: two-link arm, PUMA 560, singularities, accuracy."""

import numpy as np
import pytest

from optiplan.geometry.poses import pose_from_data
from optiplan.kinematics.ik.closed_form import closed_form
from optiplan.kinematics.manipulability import ToolKinematics, manipulability_measures, measure_gradients
from optiplan.robot.dh.table import frames
from optiplan.robot.frames import geometric_jacobian
from optiplan.robot.robot import Robot, load_robot
from optiplan.workspace import accuracy
from tests.reference.entries import Entry, entry
from tests.reference.poses import tool_pose, turn

PEDESTAL = 0.67183  # m: where the lecture's tool puts z = 0 at the shoulder, the robot here has its foot


@pytest.fixture(scope="module")
def puma() -> Robot:
    return load_robot("puma560")


def test_lecture_puma560_dh(puma):
    expected = entry("lecture.puma560.dh")
    assert puma.dh.convention == "standard"
    assert len(puma.dh.rows) == len(expected.value)
    for i, row in enumerate(puma.dh.rows):
        assert (row.theta, row.joint) == (0.0, "revolute")
        for key in ("d", "a", "alpha"):
            expected.check(getattr(row, key), i, key)


def test_lecture_example3_poses():
    expected = entry("lecture.example3.poses")
    given = {"T1": ([0.4, 0.2, 0.0], np.pi), "T2": ([0.4, -0.2, 0.0], np.pi / 2)}
    for name, (point, angle) in given.items():
        expected.check(pose_from_data({"position": point, "rpy": [angle, 0.0, 0.0]}).homogeneous, name)


def raised(branch: dict) -> list[np.ndarray]:
    """The two poses in the frame of the robot's foot."""
    poses = [np.array(entry("lecture.example3.poses")[name], dtype=float) for name in ("T1", "T2")]
    for X in poses:
        X[2, 3] += PEDESTAL if branch["base"] == "shoulder_origin_d1_0" else 0.0
    return poses


def all_branches(puma: Robot, expected: Entry, base: str) -> None:
    """The solver has exactly the eight branches of the table, for both poses."""
    branches = [branch for branch in expected.value if branch["base"] == base]
    found = closed_form(puma).solve(np.array(raised(branches[0])))
    assert found.valid.all()
    for k, key in enumerate(("q1", "q2")):
        apart = np.array([turn(found.q[k], branch[key]) for branch in branches])
        assert (apart.min(axis=1) <= expected.tolerance).all()
        assert len(set(apart.argmin(axis=1))) == 8


def check_motion(puma: Robot, expected: Entry, i: int) -> None:
    """Straight in joint space from q1 to q2: limits, peak velocities, the tool's path.

    The entry's path length is that of 501 equal times of the quintic; the true one is 26 µm longer on the longest path.
    """
    branch = expected[i]
    q1, q2 = np.array(branch["q1"]), np.array(branch["q2"])
    for q, X in zip((q1, q2), raised(branch), strict=True):
        assert np.abs(tool_pose(puma, q) - X).max() < 1e-8
    dq = q2 - q1
    expected.check(dq, i, "dq")
    expected.check(0.375 * np.abs(dq).max(), i, "peak_velocity_quintic")
    expected.check(0.3 * np.abs(dq).max(), i, "peak_velocity_trapezoidal")
    inside = [bool(((puma.limits.lower <= q) & (q <= puma.limits.upper)).all()) for q in (q1, q2)]
    assert [*inside, all(inside)] == [branch[key] for key in ("q1_in_limits", "q2_in_limits", "path_in_limits")]
    u = np.linspace(0.0, 1.0, 501)
    Q = q1 + (10.0 * u**3 - 15.0 * u**4 + 6.0 * u**5)[:, None] * dq
    points = np.array([tool_pose(puma, q)[:3, 3] for q in Q])
    chord = points[-1] - points[0]
    along = np.clip((points - points[0]) @ chord / (chord @ chord), 0.0, 1.0)
    expected.check(np.linalg.norm(points - points[0] - along[:, None] * chord, axis=1).max(), i, "line_deviation")
    expected.check(np.linalg.norm(np.diff(points, axis=0), axis=1).sum(), i, "tool_path_length")
    measured = manipulability_measures(ToolKinematics(puma).evaluate(Q)[1]).yoshikawa
    expected.check(measured.min(), i, "min_manipulability")


def test_lecture_example3_ik(puma):
    expected = entry("lecture.example3.ik")
    for base in ("shoulder_origin_d1_0", "pedestal_d1_0.67183"):
        all_branches(puma, expected, base)
    for i in range(len(expected.value)):
        check_motion(puma, expected, i)
    kept = [branch["branch"] for branch in expected.value if branch["path_in_limits"]]
    assert kept == ["run", "run"]


def test_lecture_example5():
    """Two links: |det J| = a1 a2 |sin theta2| is largest at theta2 = ±pi/2, whatever theta1; det J at +pi/2 only."""
    expected = entry("lecture.example5")
    arm = load_robot("two_links")
    tool, grid = ToolKinematics(arm), np.linspace(-np.pi, np.pi, 721)
    for theta1 in (0.0, 0.9, -2.3):
        J = tool.evaluate(np.stack([np.full_like(grid, theta1), grid], axis=1))[1][:, :2]
        assert np.abs(np.linalg.det(J) - 0.7 * np.sin(grid)).max() <= expected.tolerance
        m = manipulability_measures(J).yoshikawa
        assert np.abs(m - 0.7 * np.abs(np.sin(grid))).max() <= expected.tolerance
        best = grid[m >= m.max() - 1e-12]
        expected.check(sorted(best, reverse=True), "argmax_theta2")
        expected.check(m.max(), "m_for_a1_1_a2_0.7")
    Q = np.array([[0.4, theta] for theta in expected["argmax_theta2"]])
    gradient = measure_gradients(tool.evaluate(Q)[1][:, :2], tool.hessians(Q)[:, :2]).yoshikawa
    assert np.abs(gradient).max() <= expected.tolerance


def test_lecture_singularities(puma):
    """Determinants as products: the lecture's wrist block, and the full ones of PUMA 560 and of the UR table."""
    expected, rng = entry("lecture.singularities"), np.random.default_rng(7)
    Q = rng.uniform(-np.pi, np.pi, (200, 6))
    axes = frames(puma.dh, Q)[:, :, :3, 2]  # z_0 … z_6
    wrist = np.linalg.det(axes[:, 3:6])
    assert np.abs(wrist + np.sin(Q[:, 4])).max() <= expected.tolerance
    a2, a3, d4 = puma.dh.rows[1].a, puma.dh.rows[2].a, puma.dh.rows[3].d
    (c2, _), (c3, s3), (c23, s23) = ((np.cos(x), np.sin(x)) for x in (Q[:, 1], Q[:, 2], Q[:, 1] + Q[:, 2]))
    product = a2 * (d4 * c3 + a3 * s3) * (a2 * c2 + a3 * c23 - d4 * s23) * np.sin(Q[:, 4])
    assert np.abs(determinants(puma, Q, puma.tool_frame) - product).max() <= expected.tolerance
    ur = load_robot("delbot", group="arm")
    a2, a3, d5 = ur.dh.rows[1].a, ur.dh.rows[2].a, ur.dh.rows[4].d
    c2, c23, s234 = np.cos(Q[:, 1]), np.cos(Q[:, 1:3].sum(axis=1)), np.sin(Q[:, 1:4].sum(axis=1))
    product = a2 * a3 * np.sin(Q[:, 2]) * np.sin(Q[:, 4]) * (a2 * c2 + a3 * c23 + d5 * s234)
    assert np.abs(determinants(ur, Q, ur.dh.rows[5].name) - product).max() <= expected.tolerance


def determinants(robot: Robot, Q: np.ndarray, frame: str) -> np.ndarray:
    return np.array([np.linalg.det(geometric_jacobian(robot, q, frame)) for q in Q])


def test_lecture_accuracy():
    expected = entry("lecture.accuracy")
    for bits in (12, 16):
        expected.check(accuracy.programming_resolution(1.0, bits), f"PR_L1m_B{bits}")
    step = accuracy.control_resolution(0.01, 1000)
    expected.check(step, "CR_encoder_1000_pitch_10mm")
    assert step <= expected["BLU_max_typical_CNC"]
    expected.check(accuracy.spatial_accuracy(step), "half_BLU")
    finer = accuracy.spatial_accuracy(step, robot_accuracy=2e-5)
    assert finer == pytest.approx(expected["half_BLU"] + 2e-5, abs=expected.tolerance)
    assert finer < expected["UR5e_repeatability"]
