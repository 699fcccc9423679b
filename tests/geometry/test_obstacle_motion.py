"""Motions of obstacles: poses, points, velocities beside differences, and the same motion from a later time on."""

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.geometry.obstacle_motion import ObstacleMotion

ROWS = [[0.1, 0.3, -0.05], [0.0, -0.2], [0.0, 0.0, 0.1, 0.02]]
TURN = {"axis": [1.0, -2.0, 0.5], "angle": [0.2, 0.7, -0.1], "about": [0.4, 0.1, -0.3]}
MOTIONS = {"slides": ObstacleMotion.of_data(ROWS), "turns": ObstacleMotion.of_data(ROWS, None, TURN)}


@pytest.fixture(params=MOTIONS)
def motion(request):
    return MOTIONS[request.param]


def test_points_are_those_of_the_poses(motion):
    x, t = np.array([0.3, -0.4, 0.9]), np.linspace(0.0, 3.0, 7)
    assert motion.places(x, t) == pytest.approx(np.array([motion.pose(time) * x for time in t]), abs=1e-12)


def test_a_twist_is_that_of_differences(motion):
    X, step = pin.SE3.Random(), 1e-6
    for t in (0.4, 1.7):
        here, there = (motion.pose(time) * X for time in (t - step, t + step))
        linear = (there.translation - here.translation) / (2.0 * step)
        angular = pin.log3(there.rotation @ here.rotation.T) / (2.0 * step)
        assert motion.twist(motion.pose(t) * X, t) == pytest.approx([*linear, *angular], abs=1e-7)


def test_the_last_joint_is_where_its_frame_is_carried(motion):
    assert motion.carrier(1.3).isApprox(motion.pose(1.3) * motion.joint_frame, 1e-12)
    if motion.axis is not None:
        assert motion.joint_frame.rotation[:, 2] == pytest.approx(motion.axis, abs=1e-12)


def test_from_a_later_time_on_it_is_the_same(motion):
    since = 0.8
    later = ObstacleMotion(motion.from_times(np.array([since]))[0], np.inf, motion.axis, motion.point)
    for t in (0.0, 0.5, 2.0):
        assert later.pose(t).isApprox(motion.pose(since + t), 1e-9)


def test_equal_motions_have_equal_keys(motion):
    again = ObstacleMotion.of_data(**motion.to_data())
    assert again.key == motion.key
    assert again.key != ObstacleMotion.of_data([[0.0, 0.1], [0.0], [0.0]]).key


def test_an_axis_of_any_length_is_a_direction():
    fan = op.Box("fan", (0.2, 0.1, 0.1))
    for length in (1e-200, 1e200):
        assert fan.moving(turn={**TURN, "axis": [length, 0.0, 0.0]}).motion.axis.tolist() == [1.0, 0.0, 0.0]
    for length in (5e-324, 3.0, 1.7e308):
        axis = fan.moving(turn={**TURN, "axis": [length, 0.0, -length]}).motion.axis
        assert axis == pytest.approx([0.5**0.5, 0.0, -(0.5**0.5)], rel=1e-15)
    with pytest.raises(op.InputError, match="turn"):
        fan.moving(turn={**TURN, "axis": [0.0] * 3})


def test_a_body_that_turns_is_moved_with_the_axis_about_which_it_does():
    fan = op.Box("fan", size=(0.2, 0.1, 0.1), position=(0.5, 0.2, 0.3)).moving(ROWS, turn=TURN)
    scene, by = op.Scene([fan]), np.array([1.0, -2.0, 0.5])
    (moved,) = scene.moved("fan", *by).obstacles
    for t in (0.0, 0.7, 2.0):
        before, after = (one.motion.pose(t) * one.X_WO for one in (fan, moved))
        assert after.translation == pytest.approx(before.translation + by, abs=1e-12)
        assert after.rotation == pytest.approx(before.rotation, abs=1e-12)


def test_a_motion_is_given_by_any_sequences():
    box = op.Box("box", size=(0.2, 0.1, 0.1))
    rows = [[0.0, 0.0], [0.0, 0.2], [0.0, 0.0]]
    for given in (np.array(rows), (row for row in rows), tuple(map(tuple, rows))):
        assert box.moving(given).motion.key == box.moving(rows).motion.key


@pytest.mark.parametrize("turn", [{"axis": 3, "angle": [1.0]}, {**TURN, "about": None}, {"axis": [0, 0, 1]}, 3])
def test_a_turn_that_is_none_is_refused(turn):
    with pytest.raises(op.InputError, match=r"turn: .*; expected `axis`"):
        op.Box("box", size=(0.2, 0.1, 0.1)).moving(turn=turn)


@pytest.mark.parametrize("polynomial", [None, 3, [1, 2, 3], [[0], [0]], [[0], [np.nan], [0]], ["a", "b", "c"]])
def test_a_displacement_that_is_none_is_refused(polynomial):
    with pytest.raises(op.InputError, match=r"polynomial: .*; expected coefficients"):
        op.Box("box", size=(0.2, 0.1, 0.1)).moving(polynomial)
