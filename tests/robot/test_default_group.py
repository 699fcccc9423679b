"""Which joints are planned, and which frame is the tool, when the robot file says neither."""

import pytest

from optiplan.robot.default_group import longest_chain
from optiplan.robot.description_files import package_robots
from optiplan.robot.joint_groups import MOVABLE
from optiplan.robot.robot import load_robot
from optiplan.robot.urdf.reader import build_model, read_urdf
from tests.robot.robots import BARE, BODILESS, joint, write_robot

G1_LEFT = ["shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_roll", "wrist_pitch", "wrist_yaw"]
G1 = ["waist_yaw_joint", "waist_roll_joint", "waist_pitch_joint", *(f"left_{name}_joint" for name in G1_LEFT)]
PR2_ARM = ("shoulder_pan", "shoulder_lift", "upper_arm_roll", "elbow_flex", "forearm_roll", "wrist_flex", "wrist_roll")
PR2 = [f"l_{name}_joint" for name in PR2_ARM]
CHAINS = {
    "kinova": [f"j2s6s200_joint_{k}" for k in range(1, 7)],
    "z1": [f"joint{k}" for k in range(1, 7)],
    "tiago": ["torso_lift_joint", *(f"arm_{k}_joint" for k in range(1, 8))],
    "tiago_pro": ["torso_lift_joint", *(f"arm_left_{k}_joint" for k in range(1, 8))],
    "g1_29dof_rev_1_0": G1,
    "g1_29dof_with_hand_rev_1_0": G1,
    "ur10": [f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")],
    "panda": [f"panda_joint{k}" for k in range(1, 8)],
    "talos_reduced": ["torso_1_joint", "torso_2_joint", *(f"arm_left_{k}_joint" for k in range(1, 8))],
    "centauro": ["torso_yaw", *(f"j_arm1_{k}" for k in range(1, 7))],
    "pr2": ["torso_lift_joint", *PR2],
    "so100": ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"],
}


@pytest.mark.parametrize("name", CHAINS)
def test_the_arm_of_a_known_robot_is_found(name):
    robots = package_robots()
    if name not in robots:
        pytest.skip("example-robot-data is not installed")
    urdf = read_urdf(robots[name], robots[name].parent)
    model = build_model(urdf)
    movable = [j for j in model.names if urdf.joint_types.get(j) in MOVABLE and j not in urdf.mimics]
    assert longest_chain(model, urdf, movable) == CHAINS[name]


def load(tmp_path, links, *joints):
    return load_robot(str(write_robot(tmp_path, [*(BARE.format(link) for link in links), *joints], BODILESS)))


def test_unnamed_fingers_of_a_fork_are_left_out(tmp_path):
    arm = [joint("p", "a", "b"), joint("q", "b", "c", x=0.4)]
    fork = [joint("r", "c", "d", "prismatic", x=0.05), joint("s", "c", "e", "prismatic", x=0.05)]
    robot = load(tmp_path, "abcde", *arm, *fork)
    assert robot.joint_names == ("p", "q")
    assert robot.locked == {"r": 0, "s": 0}
    assert robot.tool_frame == "c"


def test_a_fork_of_arms_is_no_hand(tmp_path):
    arms = [joint("l", "b", "c"), joint("r", "b", "d"), joint("r2", "d", "e")]
    robot = load(tmp_path, "abcde", joint("p", "a", "b", x=0.2), *arms)
    assert robot.joint_names == ("p", "r", "r2")


def test_wheels_and_their_rollers_are_left_out(tmp_path):
    wheels = [
        joint("w", "a", "x", "continuous"),
        joint("roll", "x", "y", "continuous"),
        joint("v", "a", "z", "continuous"),
    ]
    assert load(tmp_path, "abxyz", *wheels, joint("p", "a", "b")).joint_names == ("p",)


def test_an_arm_of_endless_joints_stays(tmp_path):
    arm = [joint("p", "a", "b", "continuous"), joint("q", "b", "c", "continuous")]
    assert load(tmp_path, "abc", *arm).joint_names == ("p", "q")


def test_a_gripper_alone_is_planned(tmp_path):
    fingers = [joint("left_finger", "a", "b", "prismatic"), joint("right_finger", "a", "c", "prismatic")]
    assert load(tmp_path, "abc", *fingers).joint_names == ("left_finger",)


def test_the_tool_is_what_nothing_but_fixed_joints_carry(tmp_path):
    arm = [joint("p", "a", "b"), joint("q", "b", "c")]
    rest = [joint("mount", "c", "tool0", "fixed", ""), joint("cam", "c", "camera", "fixed", "")]
    rest.append(joint("finger", "c", "f", "prismatic"))
    robot = load(tmp_path, ["a", "b", "c", "tool0", "camera", "f"], *arm, *rest)
    assert robot.tool_frame == "tool0"
    assert "no tool frame is given: tool0, at the end of q, is taken" in robot.notes
    assert "no group is given: planned is the longest chain of joints, p, q" in robot.notes
