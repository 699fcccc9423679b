"""Joints without limits of position: whole turns are one configuration only of joints that turn wholly."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import optiplan as op
from optiplan._core import core
from optiplan.kinematics.ik.joint_wraps import images
from optiplan.problem.load import load_problem
from optiplan.problem.problem import JointGoal, Problem
from optiplan.robot.mimic_joints import Mimic
from optiplan.robot.robot import load_robot
from optiplan.robot.urdf.export import export_urdf
from optiplan.runs.run_folder import load_run
from optiplan.verify.verify import verify
from tests.checks import failed
from tests.robot.robots import chain, joint, write_robot
from tests.robot.test_mimic_joints import follower
from tests.unchecked_problem import unchecked_problem
from tests.verify.motions import quintic

ATTACK = Path(__file__).parents[2] / "attacks" / "endless"
WIDE = '<limit lower="-1e30" upper="1e30" velocity="3" effort="400"/>'


def test_a_slide_that_ends_a_turn_off_its_goal_is_refused():
    problem, stored = load_problem(ATTACK / "sliding.yaml"), load_run(ATTACK / "pris.json")
    report = verify(problem, stored.trajectory)
    assert failed(report) == ["goal"]
    (goal,) = report.failures
    assert goal.worst == pytest.approx(2 * np.pi)
    assert not problem.robot.endless.any()
    assert problem.one_end


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_limits_of_a_file_are_never_infinite(tmp_path, kind):
    robot = load_robot(str(write_robot(tmp_path, chain(joint("j", "a", "b", kind, inside=WIDE)))))
    assert robot.limits.upper.tolist() == [1e30]
    assert not robot.endless.any()
    problem = Problem(robot, start=[0.0], goal=[1.0])
    off = quintic(robot.joint_names, [0.0], [1.0 - 2 * np.pi], 20.0)
    assert "goal" in failed(verify(problem, off))


@pytest.mark.parametrize(("kind", "multiplier"), [("revolute", 0.5), ("prismatic", 1.0), ("prismatic", 0.5)])
def test_a_leader_with_wide_limits_is_where_it_says(tmp_path, kind, multiplier):
    parts = chain(
        joint("j", "a", "b", kind, inside=WIDE), joint("k", "b", "c", inside=follower("j", multiplier, 0, WIDE))
    )
    robot = load_robot(str(write_robot(tmp_path, parts)))
    problem = Problem(robot, start=[0.0], goal=[1.0])
    off = quintic(robot.joint_names, [0.0], [1.0 - 2 * np.pi], 20.0)
    assert "goal" in failed(verify(problem, off))


def test_a_follower_whose_angle_has_no_digits_left_is_refused(tmp_path):
    """At 2e7 rad it is known to 4e-9 rad, of a long link more than the proof subtracts for rounding."""
    parts = chain(joint("j", "a", "b", inside=WIDE), joint("k", "b", "c", inside=follower("j", 1e3, 0, WIDE)))
    robot = load_robot(str(write_robot(tmp_path, parts)))
    for start, verdict, outcome in ((20.0, [], "proved"), (2e4, ["collision"], "refused")):
        problem = Problem(robot, start=[start], goal=[start + 1e-3])
        assert failed(verify(problem, quintic(robot.joint_names, problem.start, [start + 1e-3], 2.0))) == verdict
        if core is not None:
            assert op.certify(problem, [[start + 1e-3]]).outcome == outcome


def test_infinite_limits_put_together_by_hand_ask_what_turns(planar):
    free = replace(planar.limits, lower=np.full(2, -np.inf), upper=np.full(2, np.inf))
    broken = {"k": Mimic(planar.joint_names[0], 0.5, 0.0)}
    robot = replace(planar, limits=free, followers=broken)
    motion = quintic(robot.joint_names, [0.0, 0.0], [0.5, 0.5], 2.0)
    for turns, verdict in (([0.0, 2 * np.pi], True), ([2 * np.pi, 0.0], False)):
        goal = (JointGoal(motion.end + turns),)
        problem = unchecked_problem(robot, start=motion.start, goal=goal, limits=free)
        assert ("goal" not in failed(verify(problem, motion))) is verdict


def test_a_joint_that_turns_without_end_is_where_it_was_after_a_turn(tmp_path):
    robot = load_robot(str(write_robot(tmp_path, chain(joint("j", "a", "b", "continuous", inside="")))))
    assert robot.endless.tolist() == [True]
    problem = Problem(robot, start=[0.0], goal=[1.0])
    assert "goal" not in failed(verify(problem, quintic(robot.joint_names, [0.0], [1.0 - 2 * np.pi], 20.0)))


def test_a_coupling_is_judged_where_the_motion_ends(tmp_path):
    robot = load_robot(str(write_robot(tmp_path, chain(joint("j", "a", "b", "continuous", inside="")))))
    coupling = [{"coupling": {"joints": {"j": 1.0}, "equals": 0.5, "within": 0.6}}]
    problem = op.Problem(robot, [0.0], [1.0 + 2 * np.pi], path_constraints=coupling)  # 6.8 off, a whole turn away 0.5
    for end, failures in ((1.0, []), (1.0 + 2 * np.pi, ["coupling constraint"])):
        assert failed(verify(problem, quintic(robot.joint_names, [0.0], [end], 20.0))) == failures
    with pytest.raises(op.InputError, match="a start that is uncoupled"):
        op.Problem(robot, [2 * np.pi], [1.0], path_constraints=coupling)


def test_a_joint_of_a_wide_range_has_a_few_images(tmp_path):
    robot = load_robot(str(write_robot(tmp_path, chain(joint("j", "a", "b", inside=WIDE)))))
    (found,) = images(robot, np.array([0.5]), np.array([7.0]))
    assert found[0] == pytest.approx(0.5 + 2 * np.pi)
    assert len(found) < 1000


def test_an_exported_joint_without_end_is_read_again(tmp_path):
    """Also one that is not planned."""
    parts = chain(joint("j", "a", "b", "continuous", inside=""), joint("k", "b", "c", "continuous", inside=""))
    robot = load_robot(str(write_robot(tmp_path, parts, "group: [j]\n")))
    text = export_urdf(robot)
    assert text.count('type="continuous"') == 2
    (tmp_path / "again").mkdir()
    (tmp_path / "again" / "robot.urdf").write_text(text)
    again = load_robot({"urdf": str(tmp_path / "again" / "robot.urdf"), "group": ["j", "k"]})
    assert again.endless.all()
