"""Named groups of joints: of bundled robots, in robot files and in problem files."""

import pickle

import numpy as np
import pinocchio as pin
import pytest

from optiplan.errors import InputError, UnknownChoiceError
from optiplan.problem.load import load_problem, problem_from_dict
from optiplan.robot.robot import load_robot
from tests.robot.robots import TWO, write_robot

GROUPS = "groups: {front: [j1], back: [j2]}\n"


def problem(**changes):
    data = {"version": 1, "robot": "delbot", "start": {"configuration": "home"}, "goal": {"configuration": "home"}}
    return problem_from_dict({**data, **changes})


@pytest.mark.parametrize(
    ("name", "group", "n", "tool"),
    [
        ("delbot", None, 9, "grasp"),
        ("delbot", "all", 9, "grasp"),
        ("delbot", "arm", 6, "grasp"),
        ("delbot", "base", 3, "chassis"),
        ("baxter", None, 14, "left_gripper"),
        ("baxter", "dual", 14, "left_gripper"),
        ("baxter", "left", 7, "left_gripper"),
        ("baxter", "right", 7, "right_gripper"),
    ],
)
def test_a_group_has_its_joints_limits_configurations_and_tool(name, group, n, tool):
    robot, whole = load_robot(name, group=group), load_robot(name)
    assert robot.n == n == len(robot.limits.velocity)
    assert robot.tool_frame == tool
    assert robot.group == (group or whole.group)
    assert list(robot.joint_names) == robot.groups[robot.group]
    columns = [whole.joint_names.index(joint) for joint in robot.joint_names]
    for key in ("lower", "upper", "velocity", "acceleration", "jerk", "torque"):
        assert np.array_equal(getattr(robot.limits, key), getattr(whole.limits, key)[columns]), key
    for key, q in robot.configurations.items():
        assert np.array_equal(q, whole.configurations[key][columns])


def test_the_arm_of_baxter_is_that_of_baxter_left():
    alone, arm = load_robot("baxter_left"), load_robot("baxter", group="left")
    assert alone.joint_names == arm.joint_names
    one, two = alone.model.createData(), arm.model.createData()
    for q in np.random.default_rng(0).uniform(alone.limits.lower, alone.limits.upper, (50, 7)):
        pin.framesForwardKinematics(alone.model, one, q)
        pin.framesForwardKinematics(arm.model, two, q)
        for frame in ("left_gripper", "right_gripper"):
            a, b = one.oMf[alone.model.getFrameId(frame)], two.oMf[arm.model.getFrameId(frame)]
            assert np.allclose(a.homogeneous, b.homogeneous, atol=1e-12)


def test_the_arms_of_baxter_are_checked_against_each_other():
    robot = load_robot("baxter")
    pairs = {frozenset((robot.link_of(p.first), robot.link_of(p.second))) for p in robot.geometry.collisionPairs}
    assert frozenset(("left_wrist", "right_wrist")) in pairs
    assert frozenset(("left_wrist", "torso")) in pairs


def test_the_first_group_is_planned_without_a_word(tmp_path):
    path = str(write_robot(tmp_path, TWO, GROUPS))
    assert load_robot(path).joint_names == ("j1",)
    assert load_robot(path, group="back").joint_names == ("j2",)


def test_lists_hold_a_value_for_every_joint_of_any_group(tmp_path):
    text = GROUPS + "limits: {velocity: [1, 2]}\nconfigurations: {home: [0.1, 0.2]}\n"
    robot = load_robot(str(write_robot(tmp_path, TWO, text)), group="back")
    assert robot.limits.velocity.tolist() == [2]
    assert robot.configurations["home"].tolist() == [0.2]


def test_locked_of_the_file_is_for_groups_that_do_not_plan_the_joint(tmp_path):
    path = str(write_robot(tmp_path, TWO, GROUPS + "locked: {j1: 0.5}\n"))
    assert load_robot(path).locked == {"j2": 0}
    assert load_robot(path, group="back").locked == {"j1": 0.5}
    with pytest.raises(InputError, match="the planned joint 'j1'"):
        load_robot(path, locked={"j1": 0.1})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("groups: {a: [j2, j1]}\n", "groups.a: [j2, j1]; expected base-to-tip order: [j1, j2]"),
        ("groups: {a: [j1], b: [j9]}\n", "groups.b[0]: unknown joint 'j9'; expected one of: j1, j2"),
        (GROUPS + "tool_frames: {up: c}\n", "tool_frames.up: unknown group 'up'; expected one of: front, back"),
        (GROUPS + "tool_frames: {back: d}\n", "tool_frames.back: unknown frame 'd'; expected one of"),
        (GROUPS + "limits: {jerk: [1]}\n", "a list of 1 values; expected 2, one a planned joint"),
    ],
)
def test_what_is_wrong_with_groups_is_said(tmp_path, text, words):
    with pytest.raises(InputError) as caught:
        load_robot(str(write_robot(tmp_path, TWO, text)))
    assert words in str(caught.value)


def test_an_unknown_group_names_the_known():
    with pytest.raises(UnknownChoiceError, match="unknown group 'legs'; choose from: all, arm, base, hand"):
        load_robot("delbot", group="legs")
    with pytest.raises(
        UnknownChoiceError, match="unknown group 'arm'; choose from: none, since the robot file has no groups"
    ):
        load_robot("ur5", group="arm")


def test_a_group_survives_pickling():
    robot = load_robot("delbot", group="arm")
    again = pickle.loads(pickle.dumps(robot))
    assert (again.group, again.joint_names, again.locked) == (robot.group, robot.joint_names, robot.locked)


def test_a_problem_names_its_group():
    whole, arm = problem(), problem(group="arm")
    assert (whole.robot.n, arm.robot.n) == (9, 6)
    assert whole.hash != arm.hash
    assert problem_from_dict(arm.source).robot.joint_names == arm.robot.joint_names
    assert problem_from_dict(arm.source).hash == arm.hash


def test_a_problem_with_an_unknown_group_says_where(tmp_path):
    path = tmp_path / "p.yaml"
    path.write_text(
        "version: 1\nrobot: delbot\ngroup: amr\nstart: {configuration: home}\ngoal: {configuration: home}\n"
    )
    with pytest.raises(InputError) as caught:
        load_problem(path)
    issue = caught.value.issues[0]
    assert (issue.line, issue.field) == (3, "group")
    assert "did you mean 'arm'?" in issue.expected
