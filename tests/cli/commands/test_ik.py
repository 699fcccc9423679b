"""`optiplan ik`."""

import numpy as np
import pinocchio as pin
import pytest

from optiplan.robot.robot import load_robot

REACHED = "0.4,0.2,0.3,3.1416,0,0"
FAR = "2,0,0,0,0,0"


def reached(name, frame, q, group=None):
    robot = load_robot(name, group=group)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, np.array(q))
    return data.oMf[robot.model.getFrameId(frame)]


def test_one_solution_within_limits_nearest_to_ready(optiplan_json):
    code, data = optiplan_json("ik", "ur5", "--pose", REACHED)
    assert code == data["exit_code"] == 0
    assert data["frame"] == "tool0"
    assert data["joint_names"][0] == "shoulder_pan_joint"
    (solution,) = data["solutions"]
    assert solution["branch"] == "shoulder left, elbow up, wrist no flip"
    assert solution["within_limits"] is True
    assert solution["error"] <= 1e-9
    X = reached("ur5", "tool0", solution["q"])
    assert X.translation == pytest.approx([0.4, 0.2, 0.3], abs=1e-9)
    expected = pin.AngleAxis(3.1416, np.array([1.0, 0.0, 0.0])).toRotationMatrix()
    assert X.rotation == pytest.approx(expected, abs=1e-9)


def test_all_branches_and_their_images(optiplan_json):
    code, data = optiplan_json("ik", "srra", "--pose", "0.8,0.3,0.5,0,1.57,0", "--all")
    assert code == 0
    assert len({solution["branch"] for solution in data["solutions"]}) == len(data["solutions"]) == 8
    for solution in data["solutions"]:
        assert [len(values) for values in solution["images"]] == [2] * 6  # limits of ±360°
        last = [values[-1] for values in solution["images"]]
        for q in (solution["q"], last):
            assert reached("srra", data["frame"], q).translation == pytest.approx([0.8, 0.3, 0.5], abs=1e-9)


def test_a_frame_a_group_and_fixed_axes(optiplan_json):
    code, data = optiplan_json(
        "ik", "delbot", "--group", "arm", "--frame", "hand", "--pose", "0.36,-0.11,0.6,3,0.2,-1.5"
    )
    assert code == 0
    assert (data["frame"], len(data["joint_names"])) == ("hand", 6)
    X = reached("delbot", "hand", data["solutions"][0]["q"], "arm")
    fixed = pin.rpy.rpyToMatrix(3.0, 0.2, -1.5)  # Rz(yaw) Ry(pitch) Rx(roll)
    assert X.rotation == pytest.approx(fixed, abs=1e-9)


def test_other_arms_are_solved_by_numbers(optiplan_json):
    code, data = optiplan_json("ik", "panda", "--pose", REACHED)
    assert code == 0
    assert data["solutions"][0]["branch"] == "numeric"
    assert reached("panda", data["frame"], data["solutions"][0]["q"]).translation == pytest.approx(
        [0.4, 0.2, 0.3], abs=1e-7
    )


def test_out_of_reach_says_so_with_the_nearest_pose(optiplan, optiplan_json):
    code, data = optiplan_json("ik", "ur5", "--pose", FAR, "--all")
    assert code == data["exit_code"] == 3
    assert data["solutions"] == []
    assert "no configuration" in data["reason"]
    nearest = data["nearest"]
    assert reached("ur5", "tool0", nearest["q"]).translation == pytest.approx(nearest["pose"][:3], abs=1e-9)
    assert np.linalg.norm(np.array(nearest["pose"][:3]) - [2, 0, 0]) == pytest.approx(
        nearest["position_error"], abs=1e-9
    )
    code, out, _ = optiplan("ik", "ur5", "--pose", FAR)
    assert code == 3
    assert "nearest pose: " in out


def test_branches_that_break_limits_are_told_with_all(optiplan_json):
    puma = ("ik", "puma560", "--pose", "0.4,0.2,0.67183,3.141592653589793,0,0")
    code, data = optiplan_json(*puma, "--all")
    assert code == 0
    assert [solution["within_limits"] for solution in data["solutions"]] == [True] + [False] * 7
    assert len(optiplan_json(*puma)[1]["solutions"]) == 1


def test_the_table_names_branches(optiplan):
    code, out, _ = optiplan("ik", "ur5", "--pose", REACHED, "--all")
    assert code == 0
    assert "left, up, no flip" in out
    assert "shoulder_pan_joint" in out
    code, out, _ = optiplan("ik", "srra", "--pose", "0.8899,0,1.1309,3.141592653589793,-1.5707963267948966,0")
    assert code == 0
    assert "*: singular (wrist)" in out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("ur5", "--pose", "1,2,3"), "six numbers"),
        (("ur5", "--pose", "1,2,3,4,5,x"), "six numbers"),
        (("ur5", "--pose", "1,2,3,4,5,nan"), "six numbers"),
        (("ur5", "--pose", FAR, "--frame", "nose"), "unknown frame 'nose'; choose from: "),
        (("ur6", "--pose", FAR), "unknown robot"),
        (("delbot", "--pose", FAR, "--group", "leg"), "leg"),
        (("ur5",), "found none; expected one of --pose, --quaternion, --matrix"),
        (("ur5", "--pose", FAR, "--matrix", "1"), "found --pose and --matrix; expected one of"),
        (("ur5", "--quaternion", "1,2,3,0,0,1"), "seven numbers with commas between them: X,Y,Z,QX,QY,QZ,QW"),
        (("ur5", "--quaternion", "1,2,3,0,0,1,1"), "found length 1.41421; expected unit length"),
        (("ur5", "--matrix", "1,0,0,0"), "12 or 16 numbers"),
        (("ur5", "--matrix", "nowhere.txt"), "'nowhere.txt'; expected 12 or 16 numbers"),
        (("ur5", "--matrix", "1,0,0,0,0,1,0,0,0,0,2,0"), "found RᵀR off from the identity by 3"),
        (("ur5", "--matrix", "1,0,0,0,0,1,0,0,0,0,-1,0"), "a reflection"),
        (("ur5", "--matrix", "1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,2"), "last row 0, 0, 0, 2"),
    ],
)
def test_bad_input_is_told(optiplan, arguments, words):
    code, out, err = optiplan("ik", *arguments)
    assert (code, out) == (2, "")
    assert words in err


def test_help_teaches(optiplan):
    code, out, _ = optiplan("ik", "--help")
    assert code == 0
    for words in ("fixed", "metres and radians", "optiplan ik ur5", "--all", "Exit code"):
        assert words in out


PUMA_T1 = "1,0,0,0.4,0,-1,0,0.2,0,0,-1,0.67183"  # a lecture's pose of the PUMA 560, z from its foot


@pytest.mark.parametrize(
    "pose",
    [
        ("--quaternion", "0.4,0.2,0.67183,1,0,0,0"),  # the scalar last, as in problem files
        ("--matrix", PUMA_T1),
        ("--matrix", PUMA_T1 + ",0,0,0,1"),
        ("--matrix", "file"),
    ],
)
def test_a_pose_as_quaternion_as_matrix_and_as_a_file(optiplan_json, tmp_path, pose):
    expected = optiplan_json("ik", "puma560", "--pose", "0.4,0.2,0.67183,3.141592653589793,0,0")[1]["solutions"]
    if pose[1] == "file":
        (tmp_path / "pose.txt").write_text("[[1, 0, 0, 0.4],\n [0 -1 0 0.2];\n 0, 0, -1, 0.67183\n]")
        pose = ("--matrix", tmp_path / "pose.txt")
    code, data = optiplan_json("ik", "puma560", *pose)
    assert code == 0
    assert data["solutions"][0]["q"] == pytest.approx(expected[0]["q"], abs=1e-9)


def test_a_rotation_with_four_digits_is_replaced_by_the_nearest(optiplan_json):
    """As of the worked example of the SRRA report: its entries are off by up to 7.5e-5."""
    R = pin.rpy.rpyToMatrix(0.3, -0.7, 1.1)
    rows = np.column_stack([np.round(R, 4), [0.5, 0.4, 0.3]])
    code, data = optiplan_json("ik", "srra", "--matrix", ",".join(map(str, rows.ravel())))
    assert code == 0
    X = reached("srra", data["frame"], data["solutions"][0]["q"])
    assert X.translation == pytest.approx([0.5, 0.4, 0.3], abs=1e-9)
    assert X.rotation == pytest.approx(R, abs=1e-4)
    assert X.rotation.T @ X.rotation == pytest.approx(np.eye(3), abs=1e-12)


def test_a_matrix_of_many_digits_is_no_file_name(optiplan):
    digits = ",".join(["0.3333333333333333333333333333333"] * 12)
    code, _, err = optiplan("ik", "ur5", "--matrix", digits)
    assert code == 2
    assert "expected a rotation" in err
