import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from optiplan.kinematics.manipulability import manipulability_measures
from optiplan.problem.problem import JointGoal
from optiplan.runs.metrics import Metrics, by_determinant, measure, peak_jerk
from optiplan.trajectory import quadrature
from optiplan.trajectory.quadrature import integral
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.verify import verify
from tests.planners import cases

LINKS = 0.5, 0.6  # m, of planar2r, whose axes are along y


def quintic(problem, duration):
    """From the start to the first goal, at rest at both ends: jerk 60 |D| / T^3."""
    coefficients = np.outer([0, 0, 0, 10, -15, 6] / duration ** np.arange(6), problem.goal[0].q - problem.start)
    coefficients[0] = problem.start
    return Trajectory(problem.robot.joint_names, np.array([0.0, duration]), coefficients[None])


def moving(start, goal, robot="planar2r"):
    problem = cases.problem(robot, start, [JointGoal(np.array(goal, dtype=float))])
    return problem, quintic(problem, 1.5)


def measured(problem, trajectory):
    return measure(problem, trajectory, verify(problem, trajectory))


def test_tool_on_a_circle():
    problem, trajectory = moving([0.2, 0.7], [1.4, 0.7])
    found = measured(problem, trajectory)
    at = cases.tool_pose("planar2r", problem.start).translation
    shoulder = problem.robot.model.jointPlacements[1].translation
    assert found.tool_path == pytest.approx(1.2 * np.linalg.norm((at - shoulder)[[0, 2]]), rel=1e-6)
    assert found.tool_rotation == pytest.approx(1.2, rel=1e-6)
    assert found.joint_path == pytest.approx(1.2, rel=1e-6)
    assert found.peak_jerk == pytest.approx(60.0 * 1.2 / trajectory.duration**3)
    assert found.jerk_share == pytest.approx(found.peak_jerk / problem.limits.jerk[0])
    assert found.peak_jerk_joint == problem.robot.joint_names[0]


def test_lengths_and_torques_are_the_integrals_of_a_dense_sampling():
    problem, trajectory = moving(cases.READY, cases.LEFT, "panda")
    found = measured(problem, trajectory)
    t = np.linspace(0.0, trajectory.duration, 4001)
    model, data = problem.robot.model, problem.robot.model.createData()
    tool, speeds, tau = model.getFrameId(problem.robot.tool_frame), [], []
    for q, v, a in zip(*(trajectory(t, order) for order in range(3)), strict=True):
        pin.forwardKinematics(model, data, q, v, a)
        twist = pin.getFrameVelocity(model, data, tool, pin.LOCAL_WORLD_ALIGNED)
        speeds.append([np.linalg.norm(twist.linear), np.linalg.norm(twist.angular), np.linalg.norm(v)])
        tau.append(pin.rnea(model, data, q, v, a).copy())
    lengths = np.trapezoid(np.array(speeds), t, axis=0)
    assert [found.tool_path, found.tool_rotation, found.joint_path] == pytest.approx(lengths, rel=2e-6)
    squares = np.trapezoid(np.array(tau) ** 2, t, axis=0) / trajectory.duration
    assert list(found.joint_torques.values()) == pytest.approx(np.sqrt(squares), rel=2e-6)
    assert list(found.joint_torques) == list(problem.robot.joint_names)
    assert found.rms_torque == pytest.approx(np.sqrt(squares.sum()), rel=2e-6)


def test_way_there_and_back_counts_twice():
    problem, there = moving([0.2, 0.7], [1.0, 0.7])
    T, c = there.duration, there.coefficients
    back = c * np.array([0.0] + 5 * [-1.0])[:, None]
    back[:, 0] = there.end
    both = Trajectory(there.joint_names, np.array([0.0, T, 2.0 * T]), np.concatenate([c, back]))
    assert measured(problem, both).tool_path == pytest.approx(2.0 * measured(problem, there).tool_path, rel=1e-6)


def test_rules_of_gauss_and_kronrod_are_exact_as_far_as_they_should():
    nodes, weights = quadrature._NODES, quadrature._WEIGHTS
    for k in range(14):
        assert weights @ nodes**k == pytest.approx(1.0 / (k + 1), abs=1e-15)
    for k in range(8):
        assert quadrature._GAUSS @ nodes[1::2] ** k == pytest.approx(1.0 / (k + 1), abs=1e-15)


@pytest.mark.parametrize("shape", [(6, 7), (6, 6), (3, 2)])
def test_determinant_is_the_product_of_singular_values(shape):
    J = np.random.default_rng(3).normal(size=(50, *shape))
    assert by_determinant(J) == pytest.approx(manipulability_measures(J).yoshikawa, rel=1e-9)


def test_integral_finds_a_kink_anywhere():
    _, trajectory = moving([0.2, 0.7], [1.0, 0.7])
    T = trajectory.duration
    for x in np.linspace(0.05, 0.95, 300):
        found = integral(lambda t, x=x: np.abs(t - x * T)[..., None], trajectory)
        assert found == pytest.approx([0.5 * T**2 * (x**2 + (1.0 - x) ** 2)], rel=1e-6)


@pytest.mark.parametrize("degree", [1, 2])
def test_jerk_is_infinite_where_velocity_or_acceleration_jumps(degree):
    problem, _ = moving([0.2, 0.7], [1.0, 0.7])
    coefficients = np.zeros((1, degree + 1, 2))
    coefficients[0, degree, 1] = 0.1
    joint, jerk, share = peak_jerk(Trajectory(problem.robot.joint_names, [0.0, 1.0], coefficients), problem)
    assert (joint, jerk, share) == (1, np.inf, np.inf)


def test_least_manipulability_is_found_between_samples():
    problem, trajectory = moving([0.2, -0.5], [0.2, 0.9])  # stretched on the way: singular
    assert measured(problem, trajectory).manipulability < 1e-9
    problem, trajectory = moving([0.2, 0.5], [0.2, 0.9])
    assert measured(problem, trajectory).manipulability == pytest.approx(LINKS[0] * LINKS[1] * np.sin(0.5))


def test_clearance_is_the_reports():
    problem = cases.wall()
    trajectory = quintic(problem, 2.0)
    report = verify(problem, trajectory)
    found = measure(problem, trajectory, report)
    assert found.clearance is None
    assert found.lowest_clearance == next(check.worst for check in report.checks if check.name == "collision") <= 0.0
    free = moving(cases.READY, cases.LEFT, "panda")
    proved = measured(*free)
    assert 0.0 < proved.clearance <= proved.lowest_clearance


def test_a_motion_to_nowhere_is_measured_at_once():
    """Rounding alone moves the tool: its path, of 1e-15 m, needs no digits."""
    problem, trajectory = moving([0.2, 0.7], [0.2 + 1e-15, 0.7])
    calls = []

    def speed(t):
        calls.append(t)
        return np.abs(trajectory(t.ravel(), 1))[:, :1].reshape(*t.shape, 1)

    found = integral(speed, trajectory)
    assert found == pytest.approx([0.0], abs=1e-12)
    assert len(calls) == 1
    assert measured(problem, trajectory).tool_path < 1e-12


def test_motion_of_another_robot_is_not_measured():
    problem, _ = moving([0.2, 0.7], [1.0, 0.7])
    _, other = moving(cases.READY, cases.LEFT, "panda")
    assert measured(problem, other) is None


def test_every_metric_is_documented():
    text = (Path(__file__).parents[2] / "docs" / "reference" / "run-folder.md").read_text()
    table = text[text.index("key of `metrics`") : text.index("## The comparison")]
    assert {field.name for field in fields(Metrics)} <= set(re.findall(r"`([a-z_]+)`", table))
