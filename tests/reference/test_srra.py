"""The report on the SRRA arm: docs/theory/reports.md says in words what these tests say in numbers."""

from dataclasses import replace

import numpy as np
import pytest

from optiplan.kinematics.ik.closed_form import closed_form
from optiplan.robot.dh.table import DhTable, forward, frames
from optiplan.robot.robot import Robot, load_robot
from tests.reference.entries import entry, matches
from tests.reference.poses import angle_between, nearest_rotation, pose, tool_pose, turn


@pytest.fixture(scope="module")
def srra() -> Robot:
    return load_robot("srra")


@pytest.fixture(scope="module")
def goal() -> np.ndarray:
    return np.array(entry("srra.ik.goal").value)


def dimensions(table: DhTable) -> dict[str, float]:
    a3, a_d, d4, d7 = table.rows[2].a, table.rows[3].a, table.rows[4].d, table.rows[7].d
    return {"a3": a3, "a_d": a_d, "d4": d4, "d7": d7, "a4": np.hypot(a_d, d4), "theta_h": np.arctan2(d4, a_d)}


def worked_example(table: DhTable, X: np.ndarray) -> dict[str, object]:
    """The steps of the report for its branch: shoulder in front, elbow up; `theta3_star` is the angle beta."""
    size = dimensions(table)
    a3, a4 = size["a3"], size["a4"]
    x, y, z = centre = X[:3, 3] - size["d7"] * X[:3, 2]
    r = np.hypot(x, y)
    cosine = (r**2 + z**2 - a3**2 - a4**2) / (2.0 * a3 * a4)
    beta = np.arccos(cosine)
    h1, h2 = np.arctan2(r, z), np.arctan2(a4 * np.sin(beta), a3 + a4 * cosine)
    angles = {"theta1": np.arctan2(y, x), "theta2": h1 - h2, "theta3": beta - size["theta_h"]}
    steps = {"wrist_centre": centre, "r": r, "cos_theta3_star": cosine, "theta3_star": beta, "h1": h1, "h2": h2}
    return {**steps, **angles, "theta_h": size["theta_h"]}


def test_srra_dh_rows(srra):
    rows = entry("srra.dh.rows")
    assert srra.dh.convention == "standard"
    assert len(srra.dh.rows) == len(rows.value) == 8
    joints = iter(range(1, 7))
    for i, row in enumerate(srra.dh.rows):
        found = (row.alpha, row.a, row.d, row.theta)
        for value, key in zip(found, ("alpha", "a", "d", "theta_offset"), strict=True):
            rows.check(value, i, key)
        assert (None if row.joint is None else next(joints)) == rows[i]["joint"]


def test_srra_params(srra):
    found = dimensions(srra.dh)
    for key, value in found.items():
        entry("srra.params").check(value, key)
    assert abs(found["a_d"] - np.hypot(found["d4"], found["a_d"])) > 0.5  # the formula printed for a_d is that of a4


def configuration(srra, name, q):
    expected = entry(f"srra.fk.{name}")
    expected.check(forward(srra.dh, q))
    expected.check(tool_pose(srra, q))


def test_srra_fk_home(srra):
    configuration(srra, "home", np.zeros(6))


def test_srra_fk_alternate(srra):
    configuration(srra, "alternate", np.pi * np.array([0.5, -0.5, 0.0, 1.0, 0.0, 0.0]))


def test_srra_ik_goal(goal):
    """As printed, with four digits, it is not a rotation matrix to better than 7.5e-5."""
    entry("srra.ik.goal").check(goal)
    R = goal[:3, :3]
    assert np.abs(R.T @ R - np.eye(3)).max() == pytest.approx(7.5e-5, rel=0.01)
    assert np.linalg.det(R) == pytest.approx(1.0000203, abs=1e-7)


def test_srra_ik_goal_projected(goal):
    entry("srra.ik.goal_projected").check(pose(nearest_rotation(goal[:3, :3]), goal[:3, 3]))


def test_srra_ik_intermediates(srra, goal):
    expected = entry("srra.ik.intermediates")
    steps = worked_example(srra.dh, goal)
    for key in expected.value:
        expected.check(steps[key], key)
    for key in ("theta3_star", "theta3", "h2"):  # wrong by more than their last printed digit
        assert abs(expected.printed[key] - expected[key]) > 2e-4
    # The solver, asked for a true rotation with the same wrist centre, has the same first three angles.
    R = nearest_rotation(goal[:3, :3])
    X = pose(R, steps["wrist_centre"] + dimensions(srra.dh)["d7"] * R[:, 2])
    found = closed_form(srra).solve(X[None])
    wanted = [steps["theta1"], steps["theta2"], steps["theta3"]]
    off = turn(found.q[0][:, :3], wanted)
    assert off.min() <= expected.tolerance
    assert found.valid[0][off.argmin()]
    assert "elbow up" in closed_form(srra).branches[off.argmin()]  # as `optiplan ik` and docs/theory/reports.md call it


def first_three(srra: Robot, goal: np.ndarray) -> np.ndarray:
    """R04 (3, 3) of the worked example."""
    steps = worked_example(srra.dh, goal)
    q = [steps["theta1"], steps["theta2"], steps["theta3"], 0.0, 0.0, 0.0]
    return frames(srra.dh, np.array(q))[5, :3, :3]


def test_srra_ik_R04_T(srra, goal):
    expected = entry("srra.ik.R04_T")
    expected.check(first_three(srra, goal).T)
    off = np.abs(np.array(expected.printed) - expected.value)
    assert 7e-4 < off.max() < 8e-4


def test_srra_ik_R47(srra, goal):
    expected = entry("srra.ik.R47")
    expected.check(first_three(srra, goal).T @ goal[:3, :3])
    printed = np.array(expected.printed)
    assert abs(printed[2, 2] - expected[2][2]) > 4e-3
    assert np.linalg.norm(printed[2]) == pytest.approx(1.0044, abs=1e-4)
    factor = np.array(entry("srra.ik.R04_T").printed) @ goal[:3, :3]
    assert factor[2, 2] == pytest.approx(0.92394, abs=5e-6)


def test_srra_ik_printed_angles(srra, goal):
    """A solution all right, of the branch front, elbow down, theta5 < 0; but not what the printed formula gives."""
    q = entry("srra.ik.printed_angles")
    q.check([0.7854, 2.353, -1.0404, 1.562, -0.3921, 1.0566])
    X = tool_pose(srra, q.value)
    assert np.linalg.norm(X[:3, 3] - goal[:3, 3]) == pytest.approx(2.994e-4, abs=5e-8)
    assert np.degrees(angle_between(X, goal)) == pytest.approx(0.0356, abs=5e-5)
    r33 = entry("srra.ik.R47").printed[2][2]
    formula = np.arctan(np.sqrt(1.0 - r33**2) / r33)
    assert formula == pytest.approx(0.3799, abs=5e-5)
    wrong = tool_pose(srra, [*q.value[:4], formula, q[5]])
    assert np.degrees(angle_between(wrong, goal)) == pytest.approx(44.27, abs=0.005)
    assert np.linalg.norm(wrong[:3, 3] - goal[:3, 3]) == pytest.approx(0.1093, abs=5e-5)


def test_srra_ik_fk_of_printed_angles(srra):
    q = np.array(entry("srra.ik.printed_angles").value)
    entry("srra.ik.fk_of_printed_angles").check(forward(srra.dh, q))
    entry("srra.ik.fk_of_printed_angles").check(tool_pose(srra, q))


def test_srra_ik_all_branches(srra):
    X = pose_of("srra.ik.goal_projected")
    found = closed_form(srra).solve(X[None])
    expected = entry("srra.ik.all_branches")
    assert found.valid[0].sum() == len(expected.value) == 8
    apart = np.array([turn(found.q[0], branch["q"]) for branch in expected.value])
    assert (apart.min(axis=1) <= expected.tolerance).all()
    assert len(set(apart.argmin(axis=1))) == 8
    for q in found.q[0]:
        assert np.abs(tool_pose(srra, q) - X).max() < 1e-12


def pose_of(name: str) -> np.ndarray:
    X = np.array(entry(name).value)
    return pose(nearest_rotation(X[:3, :3]), X[:3, 3])  # sixteen digits are not quite a rotation


def round_trip(robot: Robot, Q: np.ndarray, tolerance: float) -> np.ndarray:
    """Every original found again, every solution a solution; returns how many branches each pose has."""
    X = np.array([tool_pose(robot, q) for q in Q])
    found = closed_form(robot).solve(X)
    assert (np.where(found.valid, turn(found.q, Q[:, None, :]), np.inf).min(axis=1) <= 1e-6).all()
    for solutions, valid, target in zip(found.q, found.valid, X, strict=True):
        for q in solutions[valid]:
            assert np.abs(tool_pose(robot, q) - target).max() <= tolerance
    return found.valid.sum(axis=1)


def test_srra_ik_closed_form(srra):
    Q = np.random.default_rng(1).uniform(-np.pi, np.pi, (1500, 6))
    assert (round_trip(srra, Q, entry("srra.ik.closed_form").tolerance) == 8).all()
    # The report's elbow-up branch, theta3 = theta_h - theta3_star, misses its own wrist centre by 1.49 m.
    steps = worked_example(srra.dh, np.array(entry("srra.ik.goal").value))
    printed = [steps["theta1"], steps["h1"] + steps["h2"], steps["theta_h"] - steps["theta3_star"], 0.0, 0.0, 0.0]
    right = [steps["theta1"], steps["h1"] + steps["h2"], -steps["theta_h"] - steps["theta3_star"], 0.0, 0.0, 0.0]
    miss = [np.linalg.norm(frames(srra.dh, np.array(q))[5, :3, 3] - steps["wrist_centre"]) for q in (printed, right)]
    assert miss[0] == pytest.approx(1.48984, abs=1e-5)
    assert miss[1] < 1e-12


def test_srra_reach(srra):
    expected, size = entry("srra.reach"), dimensions(srra.dh)
    for key, beta in (("wrist_max", 0.0), ("wrist_min", np.pi)):
        q = np.array([0.4, -0.7, beta - size["theta_h"], 0.2, 0.3, 0.1])
        expected.check(np.linalg.norm(frames(srra.dh, q)[5, :3, 3]), key)
    inner, outer = expected["wrist_min"] - size["d7"], expected["wrist_max"] + size["d7"]
    expected.check(outer, "flange_max")
    expected.check(inner, "flange_inner_void")
    expected.check(1.0 - (inner / outer) ** 3, "shell_fraction_of_sphere")
    solver, outward = closed_form(srra), np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    for radius, reachable in ((outer - 1e-7, True), (outer + 1e-7, False)):
        assert solver.solve(pose(outward, [radius, 0.0, 0.0])[None]).valid.any() == reachable
    inward = outward @ np.diag([1.0, -1.0, -1.0])
    for radius, reachable in ((inner + 1e-7, True), (inner - 1e-7, False)):
        assert solver.solve(pose(inward, [radius, 0.0, 0.0])[None]).valid.any() == reachable


def test_srra_repo_kinematics_py_bug(srra):
    expected = entry("srra.repo.kinematics_py_bug")
    a3 = dimensions(srra.dh)["a3"]
    wrong = DhTable("standard", tuple(replace(row, a=a3) if i == 3 else row for i, row in enumerate(srra.dh.rows)))
    expected.check(forward(srra.dh, np.zeros(6))[:3, 3], "home_position_report")
    expected.check(forward(wrong, np.zeros(6))[:3, 3], "home_position_repo_code")
    assert not matches(forward(srra.dh, np.zeros(6))[:3, 3], expected["home_position_repo_code"], expected.tolerance)
