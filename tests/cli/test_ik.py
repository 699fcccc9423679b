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
        (("ur5",), "--pose"),
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
