"""Closed forms: every branch, exact, at singularities too; recognised from the axes alone."""

import numpy as np
import pinocchio as pin
import pytest

from optiplan.kinematics.ik.arm_recognition import recognise
from optiplan.kinematics.ik.closed_form import ACCURACY, closed_form, closed_form_of
from optiplan.kinematics.ik.numeric import IkOptions, random_seeds, solve_ik
from optiplan.robot.robot import load_robot
from tests.robot.arms import ARMS, arm, beside, made, model_of, turned


def placed(model, frame, Q):
    """X_WT by pinocchio, one configuration at a time."""
    data, poses = model.createData(), []
    for q in np.asarray(Q):
        pin.framesForwardKinematics(model, data, q)
        poses.append(data.oMf[model.getFrameId(frame)].homogeneous)
    return np.array(poses)


def assert_meets(model, frame, X, found):
    """What is called valid is so by pinocchio, and the errors told are the true ones."""
    rows, columns = np.nonzero(found.valid)
    reached = placed(model, frame, found.q[rows, columns])
    assert np.linalg.norm(reached[:, :3, 3] - X[rows, :3, 3], axis=1).max() <= ACCURACY
    for A, B in zip(reached, X[rows], strict=True):
        assert np.linalg.norm(pin.log3(A[:3, :3].T @ B[:3, :3])) <= 1.01 * ACCURACY


@pytest.mark.parametrize("name", ARMS)
def test_round_trip_finds_the_configuration_among_the_branches(name):
    robot, solver = arm(name)
    Q = np.random.default_rng(1).uniform(-np.pi, np.pi, (300, 6))
    X = placed(robot.model, robot.tool_frame, Q)
    found = solver.solve(X)
    assert_meets(robot.model, robot.tool_frame, X, found)
    own = np.where(found.valid, turned(found.q, Q[:, None]), np.inf).min(1)
    assert own.max() < 1e-8
    assert (np.abs(found.q) <= np.pi + 1e-12).all()
    assert not found.singular[:, :, (0, 2)].any()
    if solver.geometry.spherical:
        assert found.valid.all()


@pytest.mark.parametrize("name", ARMS)
def test_many_starts_find_no_branch_that_is_missing(name):
    robot, solver = arm(name)
    rng = np.random.default_rng(2)
    for q in rng.uniform(robot.limits.lower, robot.limits.upper, (3, 6)):
        X = placed(robot.model, robot.tool_frame, [q])
        seeds = random_seeds(robot, q, rng, 60)
        options = IkOptions(count=60, distinct=1e-3)
        numeric = solve_ik(robot, robot.tool_frame, pin.SE3(X[0]), seeds, options).solutions
        found = solver.solve(X)
        branches = found.q[0, found.valid[0]]
        assert len(numeric) > 1
        for other in numeric:
            assert turned(branches, other).min() < 1e-6
        assert all(turned(np.delete(branches, k, 0), b).min() > 1e-3 for k, b in enumerate(branches))


@pytest.mark.parametrize("kinds", [("wrist",), ("elbow",), ("shoulder",), ("wrist", "elbow")], ids="+".join)
@pytest.mark.parametrize("distance", [0.0, 1e-9, 1e-6])
@pytest.mark.parametrize("name", ARMS)
def test_beside_singularities_the_pose_is_met_and_they_are_named(name, kinds, distance):
    robot, solver = arm(name)
    rng = np.random.default_rng(3)
    Q = beside(solver.geometry, rng.uniform(-np.pi, np.pi, (200, 6)), rng, kinds, distance)
    X = placed(robot.model, robot.tool_frame, Q)
    found = solver.solve(X)
    assert found.valid.any(1).all()
    assert_meets(robot.model, robot.tool_frame, X, found)
    named = (found.singular & found.valid[:, :, None]).any(1).mean(0)
    free = kinds[:1]  # of an arm with three parallel axes, the representative of a free wrist need not be stretched
    assert named[("shoulder", "elbow", "wrist").index(free[0])] > 0.95


@pytest.mark.parametrize("family", ["spherical", "parallel"])
def test_arms_are_known_by_their_axes_alone(family):
    rng = np.random.default_rng(4)
    for _ in range(20):
        model = made(family, rng)
        solver = closed_form_of(model, "tool")
        assert solver is not None
        assert solver.geometry.spherical == (family == "spherical")
        Q = rng.uniform(-np.pi, np.pi, (30, 6))
        X = placed(model, "tool", Q)
        found = solver.solve(X)
        assert_meets(model, "tool", X, found)
        assert np.where(found.valid, turned(found.q, Q[:, None]), np.inf).min(1).max() < 1e-6


@pytest.mark.parametrize("family", ["spherical", "parallel"])
def test_angles_rounded_in_the_robot_file_are_made_good(family):
    rng = np.random.default_rng(5)
    model = made(family, rng, error=1e-8)
    solver = closed_form_of(model, "tool")
    Q = rng.uniform(-np.pi, np.pi, (100, 6))
    X = placed(model, "tool", Q)
    found = solver.solve(X)
    assert_meets(model, "tool", X, found)
    assert np.where(found.valid, turned(found.q, Q[:, None]), np.inf).min(1).max() < 1e-7


def test_other_arms_are_not_taken_for_one():
    assert closed_form(load_robot("panda")) is None
    assert closed_form(load_robot("planar2r")) is None
    assert recognise(arm("ur5")[0].model, "wrist_2_link") is None  # joint 6 does not move it
    rng = np.random.default_rng(6)
    assert recognise(model_of(rng.normal(size=(6, 3)), rng.normal(size=(6, 3)), rng), "tool") is None
    for family in ("spherical", "parallel"):
        assert recognise(made(family, rng, error=1e-3), "tool") is None


def test_formulas_of_the_docstring():
    """q1, q2, q3 of SRRA by the lines in the docstring, on the branch `front, up`."""
    robot, solver = arm("srra")
    g = solver.geometry
    X = placed(robot.model, robot.tool_frame, [[0.3, -0.4, 0.9, 0.5, 0.6, 0.7]])
    c = g.R_WA.T @ ((X[0, :3, :3] @ g.in_tool[:, 3] + X[0, :3, 3]) - g.p_WA)
    r = np.sqrt(c[0] ** 2 + c[1] ** 2 - g.lateral**2)
    D = complex(c[2], r) - g.shoulder
    cos_beta = (abs(D) ** 2 - abs(g.upper) ** 2 - abs(g.fore) ** 2) / (2 * abs(g.upper) * abs(g.fore))
    q3 = np.arccos(cos_beta) - np.angle(g.fore) + np.angle(g.upper)
    q1 = np.arctan2(c[1], c[0]) - np.arctan2(g.lateral, r)
    q2 = np.angle(D) - np.angle(g.upper + np.exp(1j * q3) * g.fore)
    found = solver.solve(X)
    assert found.branches[0].startswith("shoulder front, elbow up")
    assert found.q[0, 0, :3] == pytest.approx([q1, q2, q3], abs=1e-12)
    assert D == pytest.approx(np.exp(1j * q2) * (g.upper + np.exp(1j * q3) * g.fore), abs=1e-12)


@pytest.mark.parametrize("name", ["puma560", "ur5"])
def test_names_say_where_elbow_and_shoulder_are(name):
    robot, solver = arm(name)
    X = placed(robot.model, robot.tool_frame, np.random.default_rng(7).uniform(-np.pi, np.pi, (40, 6)))
    found = solver.solve(X)
    data, g, seen = robot.model.createData(), solver.geometry, 0
    for n, k in zip(*np.nonzero(found.valid), strict=True):
        pin.framesForwardKinematics(robot.model, data, found.q[n, k])
        shoulder, elbow = data.oMi[2].translation, data.oMi[3].translation
        wrist = data.oMi[4].translation
        axis = data.oMi[2].rotation @ solver_axis(robot.model)
        shoulder, elbow = (p + axis * (axis @ (wrist - p)) for p in (shoulder, elbow))  # into the plane of the wrist
        along = wrist - shoulder
        P = X[n, :3, :3] @ g.in_tool[:, 3] + X[n, :3, 3] - g.p_WA
        outward = np.cross([0.0, 0.0, 1.0], axis) * np.sign(np.cross([0.0, 0.0, 1.0], axis) @ P)
        along = wrist - shoulder
        across = elbow - shoulder - along * ((elbow - shoulder) @ along) / (along @ along)
        if along @ outward > 0.0:  # always so on a spherical wrist
            assert ("elbow up" in found.branches[k]) == (across[2] > 0.0)
            seen += 1
        left = np.cross([0.0, 0.0, 1.0], outward)
        assert ("shoulder left" in found.branches[k]) == (P @ left > 0.0)
    assert seen == found.valid.sum() if g.spherical else seen > 100


def solver_axis(model):
    """Axis of joint 2 in its own frame."""
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    return data.oMi[2].actInv(pin.Motion(data.J[:, 1])).angular


def test_out_of_reach_the_nearest_pose_keeps_the_orientation():
    robot, solver = arm("srra")
    rng = np.random.default_rng(8)
    X = placed(robot.model, robot.tool_frame, rng.uniform(-np.pi, np.pi, (50, 6)))
    X[:25, :3, 3] = 4.0 * rng.normal(size=(25, 3)) + 2.0
    g = solver.geometry
    X[25:, :3, 3] = g.p_WA + 0.1 * rng.uniform(-1, 1, (25, 3)) - X[25:, :3, :3] @ g.in_tool[:, 3]  # the wrist too near
    wrist = np.linalg.norm(X[:, :3, 3] + np.einsum("nij,j->ni", X[:, :3, :3], g.in_tool[:, 3]) - g.p_WA, axis=1)
    found = solver.solve(X)
    least, most = abs(abs(g.upper) - abs(g.fore)), abs(g.upper) + abs(g.fore)
    assert (least, most) == pytest.approx((0.2139411215943933, 1.736058878405607), abs=1e-9)  # srra.reach
    outside = (wrist > most) | (wrist < least)
    assert outside.sum() >= 45
    assert not found.valid[outside].any()
    assert found.error[outside, :, 1].max() < ACCURACY
    miss = np.maximum(wrist - most, least - wrist)[outside]
    assert found.error[outside, :, 0].min(1) == pytest.approx(miss, abs=1e-9)


def test_no_poses_and_wrong_ones():
    solver = arm("ur5")[1]
    assert solver.solve(np.empty((0, 4, 4))).q.shape == (0, 8, 6)
    with pytest.raises(ValueError, match="shape"):
        solver.solve(np.eye(4))
    with pytest.raises(ValueError, match="orthonormal"):
        solver.solve(np.diag([1.0, 1.0, 1.001, 1.0])[None])
    with pytest.raises(ValueError, match="orthonormal"):
        solver.solve(np.full((1, 4, 4), np.nan))
