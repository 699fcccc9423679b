"""Inverse kinematics of any robot: branches first, whole turns, singular and unreachable poses."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from optiplan.geometry.poses import pose_error
from optiplan.kinematics.ik import solve
from optiplan.kinematics.ik.joint_wraps import apart, images, whole_turns
from optiplan.kinematics.ik.numeric import IkOptions, joints_that_move, random_seeds, solve_ik
from optiplan.kinematics.ik.solve import answer, inverse_kinematics, wanted_configuration
from optiplan.robot.robot import load_robot
from tests.robot.arms import arm


def pose_of(robot, q):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, np.asarray(q, float))
    return data.oMf[robot.model.getFrameId(robot.tool_frame)].copy()


def seeds_of(robot, count, seed=0):
    return random_seeds(robot, np.zeros(robot.n), np.random.default_rng(seed), count)


def narrowed(robot, lower, upper):
    limits = replace(robot.limits, lower=np.full(robot.n, lower), upper=np.full(robot.n, upper))
    return replace(robot, limits=limits)


def test_whole_turns_stay_within_limits_and_prefer_the_near_ones():
    robot = load_robot("ur5")
    q = np.array([3.0, -1.0, 1.0, 0.2, 0.3, -3.0])
    near = np.array([-3.0, -1.0, 1.0, 0.2, 0.3, 3.0])
    found = whole_turns(robot, q, near, 16)
    turns = (np.array(found) - q) / (2 * np.pi)
    assert turns == pytest.approx(np.round(turns), abs=1e-12)
    assert ((np.array(found) >= robot.limits.lower) & (np.array(found) <= robot.limits.upper)).all()
    assert found[0] == pytest.approx(q + 2 * np.pi * np.array([-1, 0, 0, 0, 0, 1]))
    assert len({tuple(image) for image in found}) == len(found)


def test_images_are_all_that_the_limits_hold():
    robot = narrowed(load_robot("ur5"), -10.0, 4.0)
    q, near = np.array([1.0, 4.5, -9.9, 0.0, 3.9, -4.0]), np.zeros(6)
    turn = 2 * np.pi
    expected = [
        [1.0, 1.0 - turn],
        [4.5 - turn, 4.5 - 2 * turn],
        [-9.9 + turn, -9.9 + 2 * turn, -9.9],
        [0.0, -turn],
        [3.9 - turn, 3.9, 3.9 - 2 * turn],
        [-4.0 + turn, -4.0],
    ]
    for values, wanted in zip(images(robot, q, near), expected, strict=True):
        wanted = [x for x in wanted if -10.0 <= x <= 4.0]
        assert values == pytest.approx(sorted(wanted, key=abs), abs=1e-12)


def test_joints_without_limits_and_sliding_ones():
    robot = narrowed(load_robot("planar2r"), -np.inf, np.inf)
    turn = 2 * np.pi
    assert images(robot, np.array([0.1, 0.2]), np.array([6.0, 0.0]))[0] == pytest.approx(
        [0.1 + turn, 0.1, 0.1 + 2 * turn]
    )
    narrow = narrowed(robot, 1.0, 2.0)
    assert len(images(narrow, np.zeros(2), np.zeros(2))[0]) == 0
    assert whole_turns(narrow, np.zeros(2), np.zeros(2), 4)[0] == pytest.approx([0.0, 0.0])  # stays where it is
    delbot = load_robot("delbot", group="base")
    assert [len(values) for values in images(delbot, np.array([100.0, 0.0, 0.0]), np.zeros(3))][1] == 1


def test_all_branches_come_without_a_random_start():
    robot, _ = arm("srra")
    X_WG = pose_of(robot, [0.3, -0.4, 0.9, 0.5, 0.6, 0.7])
    used = []
    seeds = (used.append(1) or seed for seed in seeds_of(robot, 50))
    found = inverse_kinematics(robot, robot.tool_frame, X_WG, seeds, IkOptions(count=24))
    assert len(found.solutions) == 8
    assert len(used) == 1  # the first seed chooses among whole turns
    assert all(max(pose_error(pose_of(robot, q), X_WG)) < 1e-9 for q in found.solutions)


def test_a_free_joint_is_filled_up_with_random_starts():
    robot, _ = arm("srra")
    X_WG = pose_of(robot, [0.3, -0.4, 0.9, 0.5, 0.0, 0.7])
    found = inverse_kinematics(robot, robot.tool_frame, X_WG, seeds_of(robot, 60), IkOptions(count=12))
    assert len(found.solutions) > 8
    assert all(max(pose_error(pose_of(robot, q), X_WG)) <= 1e-8 for q in found.solutions)


def test_a_tolerance_reaches_what_the_exact_pose_does_not():
    robot, solver = arm("srra")
    X_WG = pose_of(robot, [0.3, -0.4, np.angle(solver.geometry.upper / solver.geometry.fore), 0.5, 0.6, 0.7])
    X_WG.translation *= 1.0001
    options = IkOptions(count=1)
    assert not inverse_kinematics(robot, robot.tool_frame, X_WG, seeds_of(robot, 5), options).solutions
    loose = replace(options, position=1e-3, orientation=1e-3)
    assert inverse_kinematics(robot, robot.tool_frame, X_WG, seeds_of(robot, 5), loose).solutions


def test_free_orientation_and_other_robots_are_left_to_numbers():
    robot = load_robot("planar2r")
    target = pin.SE3(pin.rpy.rpyToMatrix(1.0, 0.0, 2.0), pose_of(robot, [0.4, 0.9]).translation)
    options = IkOptions(orientation=np.pi)
    ours = inverse_kinematics(robot, robot.tool_frame, target, seeds_of(robot, 20), options).solutions
    theirs = solve_ik(robot, robot.tool_frame, target, seeds_of(robot, 20), options).solutions
    assert np.array_equal(ours, theirs)
    with pytest.raises(ValueError, match="seed"):
        inverse_kinematics(robot, robot.tool_frame, target, [], options)


def test_answer_is_sorted_by_what_is_wanted_and_says_what_is_singular():
    robot, _ = arm("puma560")
    near = wanted_configuration(robot)
    q = np.array([0.3, 0.4, -0.5, 0.5, 0.0, 0.7])
    found = answer(robot, robot.tool_frame, pose_of(robot, q), near)
    assert found.nearest is None
    assert len(found.solutions) == 7  # two have merged
    assert [s.singular for s in found.solutions if s.singular] == [("wrist",)]
    inside = [s for s in found.solutions if s.within_limits]
    assert found.solutions[: len(inside)] == inside
    distances = [np.abs(s.q - near).max() for s in inside]
    assert distances == sorted(distances)
    for s in found.solutions:
        assert max(s.error) <= 1e-9
        assert max(pose_error(pose_of(robot, s.q), pose_of(robot, q))) <= 1e-9
        assert s.within_limits == all(len(values) for values in s.images)


def test_a_free_joint_is_looked_for_where_the_representative_breaks_limits():
    robot = arm("srra")[0]
    ends = np.array([3.0, 3.0, 3.0, 3.0, 3.0, 0.5])
    robot = replace(robot, limits=replace(robot.limits, lower=-ends, upper=ends))
    X_WG = pose_of(robot, [0.3, -0.4, 0.9, 2.0, 0.0, 0.3])  # only q4 + q6 = 2.3 is determined
    found = answer(robot, robot.tool_frame, X_WG, np.zeros(6))
    inside = [s for s in found.solutions if s.within_limits]
    assert found.nearest is None
    assert inside[0].branch == "numeric"
    for k, s in enumerate(inside):
        assert max(pose_error(pose_of(robot, s.q), X_WG)) <= 1e-8
        assert all(apart(robot, s.q, other.q) > 0.1 for other in inside[:k])


def test_solutions_of_many_starts_differ_by_more_than_whole_turns():
    robot = narrowed(load_robot("ur5"), -2 * np.pi, 2 * np.pi)
    model = robot.model.copy()  # as calibrated: without a closed form
    model.jointPlacements[6] *= pin.SE3(pin.exp3(np.array([0.0, 0.02, 0.01])), np.array([0.0, 0.01, 0.0]))
    robot = replace(robot, model=model)
    X_WG = pose_of(robot, [0.3, -1.0, 1.2, 0.4, 0.7, 0.6])
    found = answer(robot, robot.tool_frame, X_WG, np.zeros(6)).solutions
    assert len(found) == 8
    assert all(apart(robot, s.q, other.q) > 0.1 for k, s in enumerate(found) for other in found[:k])


def test_only_the_joints_that_move_the_frame_move():
    robot, near = load_robot("baxter"), wanted_configuration(load_robot("baxter"))
    frame = "left_gripper"
    moving = joints_that_move(robot, frame)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, near + np.where(moving, 0.1, 0.0))
    found = answer(robot, frame, data.oMf[robot.frame_id(frame)].copy(), near).solutions
    assert 0 < moving.sum() < robot.n
    assert found
    assert all((s.q == near)[~moving].all() for s in found)


@pytest.mark.parametrize("name", ["srra", "ur5"])
def test_out_of_reach_the_nearest_is_no_farther_than_many_starts_find(name):
    robot, _ = arm(name)
    for position in ([3.0, 0.5, 0.2], [0.02, 0.01, -2.0]):
        X_WG = pin.SE3(pin.rpy.rpyToMatrix(0.3, 1.2, -0.4), np.array(position))
        found = answer(robot, robot.tool_frame, X_WG, wanted_configuration(robot))
        assert found.solutions == []
        assert "no configuration" in found.reason
        starts = solve_ik(robot, robot.tool_frame, X_WG, seeds_of(robot, 40, seed=9), IkOptions())
        least = np.hypot(starts.position_error, starts.orientation_error)
        miss = np.hypot(found.nearest.position_error, found.nearest.orientation_error)
        assert 0.0 < miss <= least * 1.01
        assert pose_error(pose_of(robot, found.nearest.nearest), X_WG)[0] == pytest.approx(found.nearest.position_error)


def test_without_a_closed_form_what_is_out_of_reach_is_looked_for_once(monkeypatch):
    robot, searches = load_robot("panda"), []
    monkeypatch.setattr(solve, "solve_ik", lambda *given: searches.append(1) or solve_ik(*given))
    found = answer(robot, robot.tool_frame, pin.SE3(np.eye(3), np.array([3.0, 0, 0])), wanted_configuration(robot))
    assert found.nearest.position_error > 1.0
    assert len(searches) == 1


def test_limits_that_shut_every_branch_out_are_named():
    robot = narrowed(arm("ur5")[0], -0.1, 0.1)
    X_WG = pose_of(robot, [0.5, -1.0, 1.0, 0.2, 0.7, 0.1])
    found = answer(robot, robot.tool_frame, X_WG, np.zeros(6))
    assert found.solutions
    assert not any(s.within_limits for s in found.solutions)
    assert found.nearest is not None
    assert "breaks joint limits" in found.reason
    assert "elbow_joint" in found.reason
    assert (np.abs(found.nearest.nearest) <= 0.1).all()


def test_wanted_configuration():
    assert wanted_configuration(load_robot("ur5")) == pytest.approx([0, -1.5708, 1.5708, -1.5708, -1.5708, 0])
    assert wanted_configuration(replace(load_robot("ur5"), configurations={})) == pytest.approx(np.zeros(6))
