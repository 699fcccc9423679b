"""Resolution, accuracy and repeatability as formulas, and joint resolution seen at the tool."""

import itertools

import numpy as np
import pytest

from optiplan.errors import OptiPlanError
from optiplan.kinematics.manipulability import ToolKinematics
from optiplan.robot.robot import load_robot
from optiplan.workspace.accuracy import (
    control_resolution,
    joint_resolution,
    pose_accuracy,
    programming_resolution,
    repeatability,
    spatial_accuracy,
    tool_error,
)
from tests.robot.robots import chain, joint, write_robot


@pytest.fixture(scope="module")
def ur5():
    return load_robot("ur5")


def test_programming_resolution_divides_the_range_by_the_largest_word():
    """lecture.accuracy: 1 m in 12 and in 16 bits."""
    assert programming_resolution(1.0, 12) == pytest.approx(0.0002442002442002442, abs=1e-12)
    assert programming_resolution(1.0, 16) == pytest.approx(1.525902189669642e-05, abs=1e-12)
    with pytest.raises(ValueError, match="at least 1"):
        programming_resolution(1.0, 0)


def test_control_resolution_of_encoder_and_screw():
    """lecture.accuracy: 1000 pulses on a pitch of 10 mm; a gear in between makes it finer."""
    assert control_resolution(0.01, 1000) == pytest.approx(1e-5, abs=1e-12)
    assert control_resolution(0.01, 1000, gear=4.0) == pytest.approx(2.5e-6, abs=1e-12)


def test_spatial_accuracy_is_half_a_unit_and_the_mechanics():
    """lecture.accuracy: BLU 10 µm."""
    assert spatial_accuracy(1e-5) == pytest.approx(5e-6, abs=1e-12)
    assert spatial_accuracy(1e-5, 3e-5) == pytest.approx(3.5e-5, abs=1e-12)


def test_accuracy_and_repeatability_of_points():
    cross = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]])
    assert repeatability(cross) == pytest.approx(1.0)  # all at distance 1, no spread
    assert repeatability(np.array([[0.0, 0, 0], [2.0, 0, 0], [4.0, 0, 0]])) == pytest.approx(4 / 3 + 3 * np.sqrt(4 / 3))
    assert pose_accuracy(cross + np.array([0, 0, 2.0]), np.array([0, 0, 5.0])) == pytest.approx(3.0)
    with pytest.raises(ValueError, match="at least 2"):
        repeatability(cross[:1])


def test_joint_resolution_from_bits_and_from_a_number(ur5):
    assert joint_resolution(ur5, "17bit") == pytest.approx(np.full(6, 2.0 * np.pi / (2**17 - 1)))
    assert joint_resolution(ur5, "12 bits") == pytest.approx(np.full(6, 2.0 * np.pi / 4095))
    assert joint_resolution(ur5, "1e-4") == pytest.approx(np.full(6, 1e-4))


def test_bits_divide_the_stroke_of_a_sliding_joint(tmp_path):
    arm = load_robot(str(write_robot(tmp_path, chain(joint("j1", "a", "b"), joint("j2", "b", "c", "prismatic")))))
    assert joint_resolution(arm, "8bit") == pytest.approx([2.0 * np.pi / 255, 3.0 / 255])


@pytest.mark.parametrize("text", ["", "bit", "0bit", "65bit", "-1", "nan", "inf", "0", "17bytes"])
def test_what_is_no_resolution_is_refused(ur5, text):
    with pytest.raises(OptiPlanError, match="encoder bits"):
        joint_resolution(ur5, text)


def test_tool_error_bounds_every_corner_of_the_joint_errors(ur5):
    tool, steps = ToolKinematics(ur5), np.array([1e-5, 2e-5, 1e-5, 3e-5, 1e-5, 2e-5])
    Q = np.random.default_rng(0).uniform(-2, 2, (5, 6))
    X, J = tool.evaluate(Q)
    bound = tool_error(J, steps)
    worst = np.zeros((2, len(Q)))
    for signs in itertools.product((-0.5, 0.5), repeat=6):
        moved = tool.evaluate(Q + np.array(signs) * steps)[0]
        worst[0] = np.maximum(worst[0], np.linalg.norm(moved[:, :3, 3] - X[:, :3, 3], axis=1))
        turn = 0.5 * np.linalg.norm(np.cross(X[:, :3, :3], moved[:, :3, :3], axis=1).sum(axis=2), axis=1)
        worst[1] = np.maximum(worst[1], turn)
    for found, limit in zip(worst, (bound.position_worst, bound.rotation_worst), strict=True):
        assert np.all(found <= limit * (1.0 + 1e-4))
        assert np.all(found >= 0.5 * limit)  # a bound, and not an idle one


def test_rms_is_that_of_errors_spread_evenly_over_a_step(ur5):
    tool, steps, rng = ToolKinematics(ur5), np.full(6, 1e-5), np.random.default_rng(1)
    q = np.array([[0.3, -1.0, 1.2, 0.4, 0.9, 0.1]])
    X, J = tool.evaluate(q)
    moved = tool.evaluate(q + steps * rng.uniform(-0.5, 0.5, (40_000, 6)))[0]
    sampled = np.sqrt(np.square(moved[:, :3, 3] - X[:, :3, 3]).sum(axis=1).mean())
    assert sampled == pytest.approx(tool_error(J, steps).position_rms[0], rel=0.02)
    turns = 0.5 * np.cross(np.broadcast_to(X[:, :3, :3], (len(moved), 3, 3)), moved[:, :3, :3], axis=1).sum(axis=2)
    rms = np.sqrt(np.square(turns).sum(axis=1).mean())
    assert rms == pytest.approx(tool_error(J, steps).rotation_rms[0], rel=0.02)


def test_one_link_errs_by_its_length_times_half_a_step():
    J = np.zeros((1, 6, 1))
    J[0, 1, 0], J[0, 5, 0] = 2.0, 1.0  # 2 m from a vertical axis
    found = tool_error(J, np.array([1e-3]))
    assert (found.position_worst[0], found.rotation_worst[0]) == pytest.approx((1e-3, 5e-4))
    assert found.position_rms[0] == pytest.approx(2e-3 / np.sqrt(12.0))
