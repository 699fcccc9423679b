"""Slowing down for torques."""

import numpy as np
import pinocchio as pin
import pytest

from optiplan.robot.robot import Robot, load_robot
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
