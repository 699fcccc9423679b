"""Robots with some planned joints standing still."""

import pickle

import numpy as np
import pinocchio as pin
import pytest

from optiplan.errors import InputError, UnknownChoiceError
from optiplan.problem.problem import Problem
from optiplan.robot.robot import load_robot


def bodies(robot, q):
    data, placed = robot.model.createData(), robot.geometry.createData()
    pin.updateGeometryPlacements(robot.model, data, robot.geometry, placed, q)
    return {body.name: X.homogeneous for body, X in zip(robot.geometry.geometryObjects, placed.oMg, strict=True)}


@pytest.mark.parametrize(
    ("name", "group", "held"),
    [
        ("panda", "arm+hand", {"panda_finger_joint1": 0.02}),
        ("panda", "arm+hand", {"panda_joint3": 0.3, "panda_joint5": -0.4}),
        ("delbot", "arm+hand", {"finger_left": 0.01, "joint_2": -1.0}),
    ],
)
def test_bodies_are_where_they_were_and_pairs_stay(name, group, held):
    robot = load_robot(name, group=group)
    still = robot.holding(held)
    q = np.clip(np.linspace(-0.5, 0.7, robot.n), robot.limits.lower, robot.limits.upper)
    for joint, value in held.items():
        q[robot.joint_names.index(joint)] = value
    own = np.array([q[robot.joint_names.index(joint)] for joint in still.joint_names])
    before, after = bodies(robot, q), bodies(still, own)
    assert before.keys() == after.keys()
    assert max(np.abs(before[body] - after[body]).max() for body in before) < 1e-12
    assert len(still.geometry.collisionPairs) == len(robot.geometry.collisionPairs)
    assert still.n == robot.n - len(held)
    assert len(still.limits.velocity) == still.n
    assert still.locked[next(iter(held))] == next(iter(held.values()))


def test_a_follower_stands_still_with_what_it_follows():
    robot = load_robot("panda", group="arm+hand")
    assert "panda_finger_joint2" in robot.followers
    assert not robot.holding({"panda_finger_joint1": 0.01}).followers


def test_torques_are_those_of_the_whole_robot():
    robot = load_robot("panda", group="arm+hand")
    still = robot.holding({"panda_finger_joint1": 0.02})
    q = np.append(robot.configurations["ready"][:7], 0.02)
    whole = pin.computeGeneralizedGravity(robot.model, robot.model.createData(), q)
    own = pin.computeGeneralizedGravity(still.model, still.model.createData(), q[:7])
    assert np.abs(whole[:7] - own).max() < 1e-9


def test_it_can_be_sent_to_another_process():
    robot = load_robot("delbot", group="arm+hand").holding({"finger_left": 0.01})
    again = pickle.loads(pickle.dumps(robot))
    assert (again.joint_names, dict(again.held)) == (robot.joint_names, {"finger_left": 0.01})


def test_only_planned_joints_can_be_held():
    with pytest.raises(UnknownChoiceError, match="finger_left"):
        load_robot("delbot", group="arm").holding({"finger_left": 0.01})


def test_a_joint_held_beyond_its_limits_has_all_pairs_checked():
    robot = load_robot("panda")
    assert "proved" in robot.holding({"panda_joint4": -0.5}).allowed.values()
    beyond = robot.holding({"panda_joint4": 0.5})
    assert "proved" not in beyond.allowed.values()
    assert len(beyond.geometry.collisionPairs) > len(robot.geometry.collisionPairs)
    assert pickle.loads(pickle.dumps(beyond)).allowed == beyond.allowed


@pytest.mark.parametrize("value", [float("nan"), "0.5", None])
def test_a_joint_is_held_at_a_number(value):
    with pytest.raises(InputError, match=r"values\['panda_joint4'\]: .*; expected a number, rad or m"):
        load_robot("panda").holding({"panda_joint4": value})


def test_a_problem_of_a_held_robot_is_refused_since_no_file_can_state_it():
    robot = load_robot("panda").holding({"panda_joint4": -1.0})
    with pytest.raises(InputError, match=r"panda_joint4 are fixed by `holding`; expected op\.load_robot"):
        Problem(robot, np.zeros(6), 0.1 * np.ones(6))


def test_groups_together_are_joints_of_all():
    robot = load_robot("delbot", group="base+hand")
    assert robot.joint_names == ("base_x", "base_y", "base_yaw", "finger_left", "finger_right")
    assert robot.tool_frame == "chassis"
