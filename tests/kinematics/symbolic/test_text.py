"""Formulas to read: evaluated as they are printed, they are pinocchio's numbers."""

import re

import numpy as np
import pytest

from optiplan.errors import OptiPlanError, UnknownChoiceError
from optiplan.kinematics.symbolic.functions import SymbolicRobot
from optiplan.kinematics.symbolic.text import multiplied_out, parallel_blocks, symbolic_text
from optiplan.robot.frames import frame_pose, geometric_jacobian
from optiplan.robot.robot import load_robot
from tests.robot.robots import chain, joint, write_robot

ARMS = [("planar2r", None), ("two_links", None), ("srra", None), ("puma560", None), ("ur5", None), ("delbot", "arm")]


def evaluate(text, q):
    """c23 is cos(q2 + q3), s2-3 is sin(q2 - q3), q4 is q4."""

    def word(found):
        angle, sign = 0.0, 1.0
        for character in found[2]:
            if character == "-":
                sign = -1.0
            else:
                angle, sign = angle + sign * q[int(character) - 1], 1.0
        return repr({"c": np.cos, "s": np.sin, "q": float}[found[1]](angle).item() if found[1] != "q" else angle)

    return eval(re.sub(r"\b([csq])(\d(?:-?\d)*)\b", word, text))


def check(robot, frame, tolerance):
    text = symbolic_text(robot, frame)
    for q in np.random.default_rng(1).uniform(-2.0, 2.0, (10, robot.n)):
        for found, wanted in (
            (text.pose, frame_pose(robot, q, frame).homogeneous),
            (text.jacobian, geometric_jacobian(robot, q, frame)),
        ):
            values = np.array([[evaluate(cell, q) for cell in row] for row in found])
            assert np.abs(values - wanted).max() < tolerance
    return text


@pytest.mark.parametrize(("name", "group"), ARMS)
def test_the_formulas_give_pose_and_jacobian(name, group):
    robot = load_robot(name, group=group)
    check(robot, robot.tool_frame, 1e-8)


def test_two_links_are_as_in_the_textbook():
    text = symbolic_text(load_robot("two_links"), "forearm")
    assert [row[3] for row in text.pose] == ["c1 + 0.7*c12", "s1 + 0.7*s12", "0", "1"]
    assert text.pose[0][:3] == ["c12", "-s12", "0"]
    assert text.jacobian[:2] == [["-s1 - 0.7*s12", "-0.7*s12"], ["c1 + 0.7*c12", "0.7*c12"]]
    assert text.jacobian[5] == ["1", "1"]


def test_the_puma_is_as_in_the_textbook():
    """r33 = c23 c5 - s23 c4 s5, d4 and a3 in the position of the wrist; axis 6 is the last column of R."""
    text = symbolic_text(load_robot("puma560"), "flange")
    assert text.pose[2][2] == "c23*c5 - s23*c4*s5"
    assert text.pose[0][3] == "c1*(0.4318*c2 + 0.0203*c23 - 0.4318*s23) + 0.15005*s1"
    assert [row[5] for row in text.jacobian[3:]] == [row[2] for row in text.pose[:3]]
    assert [row[3:] for row in text.jacobian[:3]] == [["0", "0", "0"]] * 3


def test_sliding_joints_and_joints_that_turn_against_each_other(tmp_path):
    slide, first = joint("slide", "a", "b", kind="prismatic"), joint("first", "b", "c", x=0.2)
    second = joint("second", "c", "d", x=0.3).replace('xyz="0 0 1"', 'xyz="0 0 -1"')
    robot = load_robot(str(write_robot(tmp_path, chain(slide, first, second))))
    assert parallel_blocks(robot) == [[0], [1, 2]]
    text = check(robot, "d", 1e-8)
    assert [row[3] for row in text.pose[:3]] == ["0.3*c2 + 0.7", "0.3*s2", "q1"]
    assert text.pose[0][:2] == ["c2-3", "-s2-3"]


def test_other_robots_are_refused_in_words():
    with pytest.raises(OptiPlanError, match="'panda': found 7 joints; expected at most 6 joints, as of planar2r"):
        symbolic_text(load_robot("panda"), "panda_hand_tcp")
    with pytest.raises(UnknownChoiceError, match="unknown frame 'nose'"):
        symbolic_text(load_robot("srra"), "nose")


def test_what_is_no_polynomial_is_refused():
    import casadi

    x = casadi.SX.sym("x")
    for expression in (casadi.sqrt(x), casadi.sin(2 * x)):
        with pytest.raises(ValueError, match="not a sum or product"):
            multiplied_out(expression, ("x",), {})
    assert multiplied_out(casadi.sin(x) ** 2 + casadi.cos(x) ** 2, ("x",), {}) == {(0, 0): 1.0}


def test_the_twin_is_the_source():
    """The same numbers from CasADi itself."""
    robot, q = load_robot("srra"), np.linspace(0.1, 1.1, 6)
    text = symbolic_text(robot, robot.tool_frame)
    values = np.array([[evaluate(cell, q) for cell in row] for row in text.pose])
    assert np.array(SymbolicRobot(robot.model, machine_code=False).pose(robot.tool_frame)(q)) == pytest.approx(
        values, abs=1e-8
    )
