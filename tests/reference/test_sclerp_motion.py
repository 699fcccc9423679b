"""The report on screw motion of Baxter, as far as it is about motion: its scheme, its results, what is wrong there."""

from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest

from optiplan.geometry.dual_quaternion import DualQuaternion
from optiplan.geometry.scene import Scene
from optiplan.planners.base import Budget
from optiplan.planners.registry import make_planner
from optiplan.planners.sclerp.bounded_least_squares import bounded_least_squares
from optiplan.planners.sclerp.options import SclerpOptions
from optiplan.planners.sclerp.qp_stepping import ScrewMotion
from optiplan.planners.sclerp.schemes import (
    REFLECTION,
    _least_motion,
    aim,
    iterate_scheme,
    rates_to_twist,
    reflected,
    spatial_J1,
)
from optiplan.planners.sclerp.screw_kinematics import ScrewTool
from optiplan.problem.problem import PoseGoal
from optiplan.robot.batched.kinematics import BatchKinematics
from optiplan.robot.robot import load_robot
from optiplan.verify.verify import verify
from tests.reference.baxter import free_report_arm
from tests.reference.entries import entry, matches
from tests.reference.poses import rot
from tests.reference.sclerp_misprints import PRINTED, printed_aim, printed_scheme, report_J1, report_screw
from tests.unchecked_problem import unchecked_problem

RUNS = [run["id"] for run in entry("sclerp.runs").value]
CONVERGING = [run["id"] for run in entry("sclerp.runs").value if run["converged"]]
WEIGHT = 0.1
"""m/rad: by how much the angle counts where the nearest pose of a screw is looked for."""


@pytest.fixture(scope="module")
def arms(tmp_path_factory):
    """The report's arm within its limits, and the same with joints that turn for ever."""
    return load_robot("baxter_report"), free_report_arm(tmp_path_factory.mktemp("free"), 1e6)


@pytest.fixture(scope="module")
def tool(arms):
    return ScrewTool(arms[0], arms[0].tool_frame)


@pytest.fixture(scope="module")
def literal(tool):
    """The literal run of each goal, of which all tests look at some; to 0.001, which is on the way past 0.003."""

    @cache
    def run(name):
        expected = item("sclerp.runs", name)
        options = replace(PRINTED, tolerance=0.001, iterations=expected["max_iterations"])
        return printed_scheme(tool, np.zeros(7), goal(name), options)

    return run


def item(table, name):
    return next(run for run in entry(table).value if run["id"] == name)


def goal(name):
    return pin.SE3(np.array(item("sclerp.runs", name)["goal"]))


def poses(tool, Q):
    """X_WT (N, 4, 4): the tool is where the last joint is."""
    return BatchKinematics(tool.robot.model).poses(Q)[:, -1]


def screw_deviation(X, ends):
    """Largest distance, m, and angle, rad, of poses X (N, 4, 4) from the nearest of 401 poses of the screw."""
    screw = ScrewMotion(*ends)
    on = np.array([screw.pose(s).homogeneous for s in np.linspace(0.0, 1.0, 401)])
    distance = np.linalg.norm(X[:, None, :3, 3] - on[:, :3, 3], axis=2)
    trace = X[:, :3, :3].reshape(-1, 9) @ on[:, :3, :3].reshape(-1, 9).T
    angle = np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0))
    nearest = (distance + WEIGHT * angle).argmin(axis=1)
    rows = np.arange(len(X))
    return distance[rows, nearest].max(), angle[rows, nearest].max()


def until(X, X_G, tolerance):
    """Steps until no element of the pose is farther from the goal's."""
    return int(np.argmax(np.abs(X - X_G.homogeneous).max(axis=(1, 2)) <= tolerance))


@pytest.mark.parametrize("name", CONVERGING)
def test_sclerp_runs(tool, literal, name):
    table, expected, found = entry("sclerp.runs"), item("sclerp.runs", name), literal(name)
    assert found.converged
    assert abs(found.iterations - expected["iterations_tol_0_001"]) <= 2
    X = poses(tool, found.Q)
    k = until(X, goal(name), PRINTED.tolerance)
    assert abs(k - expected["iterations_tol_0_003"]) <= 2
    X, hits = X[: k + 1], found.hits[:k]
    error = np.abs(X[-1] - goal(name).homogeneous).max()
    for value, key in ((error, "final_error"), (X[-1, :3], "final_pose"), (found.Q[k], "final_theta")):
        assert matches(value, expected[key], table.tolerance), key
    assert abs(hits.any(axis=1).sum() - expected["limit_hits"]) <= 2
    assert np.flatnonzero(hits.any(axis=0)).tolist() == expected["limited_joint_indices_from_0"]
    first = int(hits.any(axis=1).argmax()) if hits.any() else None
    assert (first is None) == (expected["first_limit_iteration"] is None)
    assert first is None or abs(first - expected["first_limit_iteration"]) <= 2
    distance, angle = screw_deviation(X, (pin.SE3(X[0]), goal(name)))
    assert matches(distance, expected["screw_deviation_m"], table.tolerance)
    assert matches(angle, expected["screw_deviation_rad"], table.tolerance)
    p, way = X[:, :3, 3] - X[0, :3, 3], goal(name).translation - X[0, :3, 3]
    along = np.clip(p @ way / max(way @ way, 1e-12), 0.0, 1.0)
    off = np.linalg.norm(p - along[:, None] * way, axis=1).max()
    assert matches(off, expected["line_deviation_m"], table.tolerance)


@pytest.mark.parametrize("name", sorted(set(RUNS) - set(CONVERGING)))
def test_runs_that_fail_do(literal, name):
    """Their last values are chaotic: that they hang at the limits is all that can be said."""
    expected, found = item("sclerp.runs", name), literal(name)
    assert not found.converged
    assert found.iterations == expected["max_iterations"]
    assert found.error > 10.0 * PRINTED.tolerance
    assert abs(int(found.hits.any(axis=1).argmax()) - expected["first_limit_iteration"]) <= 2
    assert set(expected["limited_joint_indices_from_0"]) <= set(np.flatnonzero(found.hits.any(axis=0)).tolist())


def test_sclerp_parameters(tool, literal):
    expected = entry("sclerp.parameters")
    for value, key in ((PRINTED.tau, "tau"), (PRINTED.beta, "beta"), (REFLECTION, "limit_reflection")):
        expected.check(value, key)
    expected.check(PRINTED.tolerance, "stop_max_abs_element_error")
    for letter in "bcd":
        name = entry(f"sclerp.printed.{letter}")["run"]
        k = until(poses(tool, literal(name).Q), goal(name), PRINTED.tolerance)
        stopped = np.abs(poses(tool, literal(name).Q[k : k + 1]) - goal(name).homogeneous).max()
        assert round(stopped, 4) == 0.0030 > expected["stop_claimed"]


def symbols(matrix, Q):
    names = {sign + f"q{i}": value for i, x in enumerate(Q) for sign, value in (("", x), ("-", -x))}
    return np.array([[names[word] for word in row] for row in matrix])


def test_sclerp_J1(arms):
    """The printed matrix is that of the body: right only while the tool turns about one axis from R = I."""
    expected, rng = entry("sclerp.J1"), np.random.default_rng(0)
    Q = rng.normal(size=4)
    Q /= np.linalg.norm(Q)
    assert np.array_equal(spatial_J1(Q), symbols(expected["spatial"], Q))
    assert np.array_equal(report_J1(Q), symbols(expected.printed, Q))
    w, h, R = rng.normal(size=3), 1e-6, pin.Quaternion(*Q).toRotationMatrix()
    ahead, behind = (pin.Quaternion(pin.exp3(x * w) @ R).coeffs()[[3, 0, 1, 2]] for x in (h, -h))
    rate = (np.sign(ahead @ Q) * ahead - np.sign(behind @ Q) * behind) / (2.0 * h)
    assert np.allclose(2.0 * spatial_J1(Q) @ rate, w, atol=1e-8)
    assert np.allclose(2.0 * report_J1(Q) @ rate, R.T @ w, atol=1e-8)

    limits = entry("sclerp.baxter.limits_seed")
    free, rng = ScrewTool(arms[1], arms[1].tool_frame), np.random.default_rng(0)
    starts, goals = [], []
    for _ in range(expected["random_starts_converged"]["of"]):
        starts.append(rng.uniform(limits["lower"], limits["upper"]))
        goals.append(free.pose(starts[-1] + rng.normal(0.0, 0.35, 7)))
    options, converged = replace(PRINTED, iterations=1250), {}
    for key, scheme in (("report", printed_scheme), ("corrected", iterate_scheme)):
        found = [scheme(free, q, X, options) for q, X in zip(starts, goals, strict=True)]
        converged[key] = [run.iterations for run in found if run.converged]
        expected.check(len(converged[key]), "random_starts_converged", key)
    median = np.median(converged["corrected"])  # of another 40 starts than the table's, which are not recorded
    assert abs(median - expected["median_iterations_corrected"]) <= 20


def b_matrix(J, p, J1):
    """B(θ) = J_sᵀ (J_s J_sᵀ)⁻¹ [[I, 2 p̂ J1], [0, 2 J1]], (n, 7): joint rates from those of position and quaternion."""
    return _least_motion(J, rates_to_twist(p, J1))


def test_sclerp_B_matrix(tool):
    """Joint rates that change position and quaternion as asked; with the J1 of the report they do not."""
    q, rng, tolerance = np.array([-0.5, -0.6, 0.8, 1.2, -0.9, 0.7, 0.4]), np.random.default_rng(1), 1e-12
    X, J = tool.at(q)
    Q = pin.Quaternion(X.rotation).coeffs()[[3, 0, 1, 2]]
    p, J1 = X.translation, spatial_J1(Q)
    p_hat = np.array([[0, -p[2], p[1]], [p[2], 0, -p[0]], [-p[1], p[0], 0]])
    assert entry("sclerp.B_matrix").tolerance == tolerance
    B = J.T @ np.linalg.inv(J @ J.T) @ np.block([[np.eye(3), 2.0 * p_hat @ J1], [np.zeros((3, 3)), 2.0 * J1]])
    assert np.allclose(b_matrix(J, p, J1), B, rtol=tolerance, atol=tolerance)
    turning = rng.normal(size=4)
    rates = np.concatenate([rng.normal(size=3), turning - (turning @ Q) * Q])  # of a unit quaternion
    h = 1e-6
    for matrix, right in ((b_matrix(J, p, J1), True), (b_matrix(J, p, report_J1(Q)), False)):
        ahead, behind = (tool.pose(q + x * matrix @ rates) for x in (h, -h))
        R = [pin.Quaternion(Y.rotation).coeffs()[[3, 0, 1, 2]] for Y in (ahead, behind)]
        moved = np.concatenate([ahead.translation - behind.translation, *[np.sign(R[0] @ Q) * R[0]]])
        moved[3:] -= np.sign(R[1] @ Q) * R[1]
        assert np.allclose(moved / (2.0 * h), rates, atol=1e-7) == right


def test_sclerp_limits_text(tool):
    """Not "within 10 % of the limit": inside by a tenth of the overshoot, and so hardly different from clipping."""
    low, high = np.full(3, -1.0), np.full(3, 2.0)
    q = reflected(np.array([2.5, -1.3, 0.7]), low, high)
    assert np.array_equal(q, [2.5 - 1.1 * (2.5 - 2.0), -1.3 + 1.1 * (-1.0 - -1.3), 0.7])
    assert np.allclose(q, [2.0 - 0.1 * 0.5, -1.0 + 0.1 * 0.3, 0.7])
    X_G = goal("a_y+45_503050")
    ends = tool.pose(np.zeros(7)), X_G
    off = []
    for limits in ("reflect", "clip"):
        run = iterate_scheme(
            tool, np.zeros(7), X_G, SclerpOptions(scheme="corrected", limits=limits, tau=0.2, beta=0.2)
        )
        assert run.hits.any()
        off.append(screw_deviation(poses(tool, run.Q), ends)[0])
    assert abs(off[0] - off[1]) < 5e-5


def test_sclerp_pure_translation_u():
    """Turned by 90° about z, the literal step takes the direction in the wrong frame, and the tool stands still."""
    X = pin.SE3(rot("z", np.pi / 2), np.array([0.2, 0.3, 0.4]))
    X_G = pin.SE3(X.rotation, X.translation + np.array([0.1, 0.0, 0.0]))
    assert entry("sclerp.pure_translation_u").tolerance == 0.0
    A, B = map(DualQuaternion.from_pose, (X, X_G))
    assert np.abs(report_screw(A, B, 0.1).position - X.translation).max() < 1e-15
    assert np.abs(printed_aim(X, B, 0.1)).max() < 1e-15
    assert np.allclose(aim(X, B, 0.1), [0.01, 0, 0, 0, 0, 0], atol=1e-15)
    u, t = np.array([1.0, 0, 0]), X.actInv(X_G.translation)
    assert np.allclose(X.rotation.T @ u, t / 0.1)  # what u should have been
    assert np.array_equal(np.cross(0.1 * u, u), np.zeros(3))  # m = p x u / 2 says nothing


def at_stop(tool, literal, name):
    found = literal(name)
    X = poses(tool, found.Q)
    return X[until(X, goal(name), PRINTED.tolerance)]


def test_sclerp_printed_b(tool, literal):
    expected = entry("sclerp.printed.b")
    expected.check(at_stop(tool, literal, expected["run"])[:3], "printed")
    assert not literal("b_z+45_503050").converged  # the goal that is printed beside this result
    assert np.allclose(goal("b_z+45_503050").rotation, goal(expected["run"]).rotation.T)


def test_sclerp_printed_c(tool, literal):
    expected = entry("sclerp.printed.c")
    expected.check(at_stop(tool, literal, expected["run"])[:3, 3], "printed_position")


def test_sclerp_printed_d(tool, literal):
    """Printed is -45°, the text says 45°; with this sign the report's two figures are right."""
    expected = entry("sclerp.printed.d")
    expected.check(at_stop(tool, literal, expected["run"])[:3], "printed")
    assert np.allclose(goal(expected["run"]).rotation, rot("y", -np.pi / 4))
    assert literal("a_y+45_503050").hits.any()
    assert not literal("a_y-45_503050").hits.any()


def test_sclerp_missing(literal):
    """The goal of figures 1 and 2, for which (0.5, 0.3, 0.5) bears out the text, and the third number of figure 5."""
    assert entry("sclerp.missing").value is None
    for sign, limited in (("+", True), ("-", False)):
        assert np.array_equal(goal(f"a_y{sign}45_503050").translation, [0.5, 0.3, 0.5])
        assert literal(f"a_y{sign}45_503050").hits.any() == limited
    assert np.array_equal(goal("c_trans_303030").translation, [0.3, 0.3, 0.3])


def test_sclerp_improved(tool):
    """The table's own improvement, 400 poses with bounded steps, by our bounded least squares; ours is on the screw."""
    expected = entry("sclerp.improved")
    for run in expected.value:
        track, end, margin = bounded_steps(tool, goal(run["id"]))
        pairs = zip((*track, *end), TRACKED, strict=True)
        for value, key in pairs:
            if run[key] > 1e-9:
                assert matches(value, run[key], expected.tolerance, relative=True), (run["id"], key)
            else:
                assert value < 1e-9, (run["id"], key)
        assert (end[0] < 1e-9) == run["converged"]
        if run["min_limit_margin"] > 1e-3:
            assert matches(margin, run["min_limit_margin"], expected.tolerance, relative=True), run["id"]
        else:
            assert abs(margin) < 1e-3


TRACKED = ("max_track_position", "max_track_rotation", "final_position_error", "final_rotation_error")


def bounded_steps(tool, X_G):
    """(position, rotation) errors at worst and at the end, and the least distance from a limit."""
    low, high = tool.robot.limits.lower, tool.robot.limits.upper
    q, screw, errors, margin = np.zeros(7), ScrewMotion(tool.pose(np.zeros(7)), X_G), [], 9.0
    for s in np.linspace(0.0, 1.0, 401)[1:]:
        target, bounds = screw.pose(s), (np.maximum(low, q - 0.05), np.minimum(high, q + 0.05))
        for _ in range(4):
            X, J = tool.at(q)
            e = pin.log6(X.actInv(target)).vector
            if np.abs(e).max() < 1e-13:
                break
            body = X.inverse().action @ J
            q = q + bounded_least_squares(body, e, (bounds[0] - q, bounds[1] - q), np.zeros(7), 1e-6)
        left = tool.pose(q).actInv(target)
        errors.append((np.linalg.norm(left.translation), np.linalg.norm(pin.log3(left.rotation))))
        margin = min(margin, (q - low).min(), (high - q).min())
    margin = min(margin, -low.max(), high.min())  # the start's
    return np.max(errors, axis=0), errors[-1], margin


@pytest.mark.parametrize("name", entry("sclerp.reachable")["seed_limits"])
def test_quadratic_programs_keep_to_the_screw_and_within_limits_at_all_times(arms, name):
    arm = arms[0]
    problem = unchecked_problem(
        name=name,
        robot=arm,
        scene=Scene(()),
        start=np.zeros(7),
        goal=(PoseGoal(arm.tool_frame, goal(name), 1e-6, 1e-6),),
        limits=arm.limits,
    )
    options = {"redundancy": "goal" if name == "b_z+45_503050" else "local"}
    result = make_planner("sclerp", options).plan(problem, Budget(60.0), lambda stage, fraction: None)
    assert result.failure is None, result.failure
    trajectory = result.trajectory
    assert verify(problem, trajectory).verified
    low, high = trajectory.extrema(0)
    assert (low >= arm.limits.lower - 1e-9).all()
    assert (high <= arm.limits.upper + 1e-9).all()
    tool = ScrewTool(arm, arm.tool_frame)
    X = poses(tool, trajectory(np.linspace(0.0, trajectory.duration, 150)))
    assert np.abs(X[-1] - goal(name).homogeneous).max() <= 1e-6
    assert off_screw(X, ScrewMotion(tool.pose(np.zeros(7)), goal(name))) <= 1e-6


def off_screw(X, screw):
    """Largest distance, m and rad alike, of poses X (N, 4, 4) from a screw, wherever on it they are."""
    fine = np.linspace(0.0, 1.0, 201)
    on = np.array([screw.pose(s).homogeneous for s in fine])
    worst = 0.0
    for pose in X:
        s = fine[np.abs(on - pose).sum(axis=(1, 2)).argmin()]
        for _ in range(3):  # Newton: how far along the screw's own twist the pose still is
            here, step = screw.pose(s), 1e-6
            twist = pin.log6(here.actInv(screw.pose(s + step))).vector / step
            left = pin.log6(here.actInv(pin.SE3(pose))).vector
            s += float(twist @ left / (twist @ twist))
        worst = max(worst, np.abs(pin.log6(screw.pose(s).actInv(pin.SE3(pose))).vector).max())
    return worst
