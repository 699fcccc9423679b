"""The lecture's robots and formulas, trajectories apart: two-link arm, PUMA 560, singularities, accuracy."""

import numpy as np
import pinocchio as pin
import pytest

from optiplan.geometry import pose_from_data
from optiplan.model.closed_form import closed_form
from optiplan.model.robot import Robot, load_robot
from tests.reference.entries import Entry, entry
from tests.reference.poses import jacobian, tool_pose, turn

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
    measured = [abs(np.linalg.det(jacobian(puma, q))) for q in Q]
    expected.check(min(measured), i, "min_manipulability")


def test_lecture_example3_ik(puma):
    expected = entry("lecture.example3.ik")
    for base in ("shoulder_origin_d1_0", "pedestal_d1_0.67183"):
        all_branches(puma, expected, base)
    for i in range(len(expected.value)):
        check_motion(puma, expected, i)
    kept = [branch["branch"] for branch in expected.value if branch["path_in_limits"]]
    assert kept == ["run", "run"]
