"""Slowing down for torques."""

import numpy as np
import pinocchio as pin
import pytest

from optiplan.planners.trajopt.bspline_basis import DEGREE, SplineBasis, bunched_breakpoints
from optiplan.robot.robot import Robot, load_robot
from optiplan.trajectory.timing import torque_scaling
from optiplan.trajectory.timing.stops import stop_at_corners
from optiplan.trajectory.timing.torque_scaling import torque_scale
from optiplan.trajectory.trajectory import Trajectory


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot("panda")


@pytest.fixture(scope="module")
def motion(robot: Robot) -> Trajectory:
    start = robot.configurations["ready"]
    return stop_at_corners(np.stack([start, start + 0.6]), robot.limits, robot.joint_names)


def torques(robot: Robot, trajectory: Trajectory, t: np.ndarray) -> np.ndarray:
    data = robot.model.createData()
    return np.array([pin.rnea(robot.model, data, *(trajectory(np.array([x]), k)[0] for k in range(3))) for x in t])


def test_scaled_motion_just_meets_its_torque_limit(robot: Robot, motion: Trajectory) -> None:
    peak = np.abs(torques(robot, motion, np.linspace(0, motion.duration, 3001))).max(axis=0)
    rest = np.abs(torques(robot, motion.scaled(1e3), np.linspace(0, 1e3, 501))).max(axis=0)
    limit = np.maximum(0.5 * (peak + rest), 1.05 * rest)
    slower = motion.scaled(motion.duration * torque_scale(robot, limit, motion))
    share = np.abs(torques(robot, slower, np.linspace(0, slower.duration, 3001))) / limit
    assert slower.duration > 1.01 * motion.duration
    assert 0.99 < share.max() <= 1.0


def test_strong_or_unlimited_motors_need_no_slowing(robot: Robot, motion: Trajectory) -> None:
    assert torque_scale(robot, np.full(robot.n, np.inf), motion) == 1.0
    assert torque_scale(robot, np.full(robot.n, 1e4), motion) == 1.0


def test_gravity_beyond_the_motors_cannot_be_slowed_away(robot: Robot, motion: Trajectory) -> None:
    assert torque_scale(robot, np.full(robot.n, 1e-3), motion) == np.inf


def test_the_core_asks_for_as_much_as_the_reference(
    robot: Robot, motion: Trajectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    limit, t = robot.limits.torque, np.linspace(0.0, motion.duration, 400)
    native = torque_scaling._Demand(robot, limit, motion).at(t)
    monkeypatch.setattr(torque_scaling, "core", None)
    np.testing.assert_allclose(native, torque_scaling._Demand(robot, limit, motion).at(t), rtol=1e-9, atol=1e-12)
    assert np.isinf(torque_scaling._Demand(robot, 1e-3 * limit, motion).at(t)).all()


def test_no_instant_between_those_looked_at_takes_more(robot: Robot) -> None:
    """Splines whose accelerations swing within a few milliseconds, too fast for the motors."""
    rng = np.random.default_rng(2)
    for _ in range(5):
        basis = SplineBasis(bunched_breakpoints(22, 0.6))
        control = 0.5 * robot.configurations["ready"] + 0.02 * rng.standard_normal((basis.size, robot.n)).cumsum(axis=0)
        motion = Trajectory.from_bspline(robot.joint_names, basis.knots * 0.8, control, DEGREE)
        found = torque_scale(robot, 1.5 * robot.limits.torque, motion)
        everywhere = torque_scaling._Demand(robot, 1.5 * robot.limits.torque, motion).at(
            np.linspace(0.0, motion.duration, 40_000)
        )
        assert found > 1.0
        assert np.sqrt(everywhere.max()) <= found * (1.0 + 1e-5)
