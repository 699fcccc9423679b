"""Torques between the samples: the bound on their curvature, and what the proof refuses."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from optiplan.geometry.scene import Scene
from optiplan.problem.problem import derived
from optiplan.robot.mimic_joints import unfold
from optiplan.robot.robot import load_robot
from optiplan.verify.continuous.torque import torque
from optiplan.verify.continuous.torque_bounds import TorqueBounds
from optiplan.verify.report import VerifyPolicy
from tests.verify.motions import problem_of, quintic, within_limits


def torques(robot, trajectory, t):
    data = robot.model.createData()
    states = np.stack([trajectory(t, order) for order in range(3)], axis=1)
    return np.array([pin.rnea(robot.model, data, *state).copy() for state in states])


@pytest.mark.parametrize("name", ["panda", "planar2r", "delbot", "baxter"])
def test_the_second_derivative_is_never_larger_than_its_bound(name):
    """Against differences, on robots with sliding joints and two arms, with armature, in random motions."""
    robot, rng = load_robot(name), np.random.default_rng(3)
    robot.model.armature[:] = 0.1
    bounds, h, loose = TorqueBounds(robot.model), 1e-4, []
    for _ in range(20):
        q = rng.uniform(np.maximum(robot.limits.lower, -1.0), np.minimum(robot.limits.upper, 1.0), (2, robot.n))
        motion = quintic(robot.joint_names, q[0], q[1], 1.0)
        terms, curvature = bounds.over(np.abs([motion(np.array([0.4]), order) for order in range(5)]))
        tau = torques(robot, motion, np.array([0.4 - h, 0.4, 0.4 + h]))
        second = (tau[0] - 2.0 * tau[1] + tau[2]) / h**2
        assert (np.abs(second) <= curvature[0] * 1.001 + 1e-3).all()
        assert (np.abs(tau[1]) <= terms[0] + 1e-9).all()
        loose.append(curvature[0] / np.maximum(np.abs(second), 1e-9))
    robot.model.armature[:] = 0.0
    assert np.min(loose) < 100.0  # a bound that means something


@pytest.mark.parametrize("name", ["panda", "delbot", "baxter", "puma560"])
def test_the_core_bounds_the_same(name, monkeypatch):
    """Its bound on the inertia of a body is a little wider than the matrix's norm."""
    robot, rng = load_robot(name), np.random.default_rng(5)
    robot.model.armature[:] = 0.1
    plain = unfold(robot.model)
    native = TorqueBounds(plain.model, plain.A, plain.b)
    monkeypatch.setattr("optiplan.verify.continuous.torque_bounds.core", None)
    python = TorqueBounds(plain.model, plain.A, plain.b)
    robot.model.armature[:] = 0.0
    motion = np.abs(rng.normal(size=(5, 30, robot.n)))
    for ours, theirs in zip(native.over(motion), python.over(motion), strict=True):
        assert (ours >= theirs * (1.0 - 1e-12)).all()
        assert (ours <= theirs * 1.1).all()


def test_joints_that_follow_others_count():
    """Two of three joints, one sliding, follow: q_J = A q + b and tau = A^T tau_J, against differences."""
    model, rng = pin.Model(), np.random.default_rng(1)
    for k, joint in enumerate((pin.JointModelRX(), pin.JointModelPY(), pin.JointModelRZ())):
        index = model.addJoint(k, joint, pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.3])), f"j{k}")
        body = pin.Inertia(2.0, np.array([0.1, 0.3, 0.0]), 0.1 * np.eye(3))
        model.appendBodyToJoint(index, body, pin.SE3.Identity())
    A, b = np.array([[1.0], [-0.5], [2.0]]), np.array([0.0, 0.4, 0.1])
    bounds, data, h = TorqueBounds(model, A, b), model.createData(), 1e-4
    for _ in range(20):
        c = rng.normal(size=6)
        motion = quintic(("j0",), [0.0], [0.0], 1.0)
        motion = type(motion)(motion.joint_names, motion.breakpoints, c.reshape(1, 6, 1))
        t = np.array([0.4 - h, 0.4, 0.4 + h])
        states = [motion(t, order) @ A.T + (b if order == 0 else 0.0) for order in range(3)]
        tau = np.array([A.T @ pin.rnea(model, data, *(x[k] for x in states)) for k in range(3)])
        terms, curvature = bounds.over(np.abs([motion(t[1:2], order) for order in range(5)]))
        assert np.abs(tau[0] - 2.0 * tau[1] + tau[2])[0] / h**2 <= 1.001 * curvature[0, 0] + 1e-3
        assert np.abs(tau[1]) <= terms[0] + 1e-9


def test_one_joint_by_hand():
    """A pendulum: tau = (I + m r²) q'' + m g r sin q, so tau'' = (I + m r²) q'''' + m g r (sin q)''."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "j")
    model.appendBodyToJoint(joint, pin.Inertia(2.0, np.array([0.0, 0.5, 0.0]), np.eye(3) * 0.1), pin.SE3.Identity())
    q = np.array([0.3, 0.2, 0.7, 0.5, 11.0])  # bounds on q, q', …
    terms, curvature = TorqueBounds(model).over(q.reshape(5, 1, 1))
    weight = 2.0 * 9.81 * 0.5
    assert terms[0, 0] >= weight + (0.1 + 0.5) * 0.7
    least = 0.6 * 11.0 + weight * (0.7 + 0.2**2)
    assert least <= curvature[0, 0] <= 2.0 * least


@pytest.fixture(scope="module")
def swing(panda):
    """A fast motion of all joints, and the largest torque of each to eight digits."""
    ready = panda.configurations["ready"]
    motion = within_limits(quintic(panda.joint_names, ready, np.full(7, -0.4), 1.0), panda.limits)
    return motion, np.abs(torques(panda, motion, np.linspace(0.0, motion.duration, 100_001))).max(axis=0)


@pytest.mark.parametrize(("share", "verdict"), [(0.9999, False), (0.999999, False), (1.0001, True), (1.000002, True)])
@pytest.mark.parametrize("rate", [1.0, 200.0])
def test_a_peak_between_samples_counts(panda, swing, share, verdict, rate):
    """With intervals of a whole second to begin with, no first sample is anywhere near the peak."""
    motion, peak = swing
    problem = problem_of(panda, motion, Scene())
    problem = derived(problem, limits=replace(problem.limits, torque=peak * share / (1.0 + 1e-6)))
    check = torque(problem, motion, VerifyPolicy(torque_rate=rate))
    assert check.passed is verdict, check.detail
    assert check.kind == "continuous"
    assert ("proved" in check.detail) is verdict
    assert check.witness["torques"] < 5000
    if not verdict:
        assert check.worst > check.limit


def test_what_is_not_checked_is_said(planar):
    swing = within_limits(quintic(planar.joint_names, [1.0, 0.0], [-1.0, 0.0], 1.0), planar.limits)
    problem = problem_of(planar, swing, Scene())
    endless = derived(problem, limits=replace(problem.limits, torque=np.full(2, np.inf)))
    assert torque(endless, swing, VerifyPolicy()).kind == "unchecked"


def test_a_proof_that_does_not_end_is_a_refusal(planar):
    swing = within_limits(quintic(planar.joint_names, [1.0, 0.0], [-1.0, 0.0], 1.0), planar.limits)
    check = torque(problem_of(planar, swing, Scene()), swing, VerifyPolicy(torque_rate=1.0, max_queries=3))
    assert not check.passed
    assert check.detail.startswith("not proved with 3 torques")


@pytest.mark.filterwarnings("ignore:overflow", "ignore:invalid value")
def test_numbers_that_overflow_are_refused(planar):
    swing = within_limits(quintic(planar.joint_names, [1.0, 0.0], [-1.0, 0.0], 1.0), planar.limits)
    wild = type(swing)(swing.joint_names, swing.breakpoints, swing.coefficients * 1e300)
    assert not torque(problem_of(planar, swing, Scene()), wild, VerifyPolicy()).passed
