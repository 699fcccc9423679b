"""Motions through bodies that were once not checked: they are refused, whoever plans them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from optiplan.errors import InputError
from optiplan.geometry.scene import HalfSpace, Obstacle, Scene, Sphere
from optiplan.problem.load import load_problem
from optiplan.problem.problem import derived
from optiplan.robot.robot import load_robot
from optiplan.robot.self_collision.pairs import PROVED
from optiplan.verify.report import VerifyPolicy
from optiplan.verify.verify import verify
from tests.robot.robots import BARE, LINK, joint, write_robot
from tests.verify.motions import problem_of, quintic, within_limits

ATTACKS = Path(__file__).parents[2] / "attacks"


@pytest.mark.parametrize("name", ["never2", "never_pair"])
def test_the_tip_of_a_crane_does_not_pass_through_its_base(name):
    problem = load_problem(ATTACKS / name / "problem.yaml")
    assert ("base", "tip") not in problem.robot.allowed
    motion = quintic(problem.robot.joint_names, problem.start, problem.goal[0].q, 1.0)
    report = verify(problem, within_limits(motion, problem.limits))
    assert [check.name for check in report.failures] == ["collision"]
    assert report.failures[0].place == "base – tip"
    assert report.failures[0].witness["contact"]


def small_motion(robot):
    q = robot.configurations["ready"]
    return within_limits(quintic(robot.joint_names, q, q + 0.1, 1.0), robot.limits)


def with_ball(robot, height, **scene):
    """The Panda beside or around a ball of 6 cm at this height on its first axis."""
    ball = Obstacle("ball", Sphere(0.06), pin.SE3(np.eye(3), np.array([0.0, 0.0, height])))
    return problem_of(robot, small_motion(robot), Scene((ball,), **scene))


def test_a_ball_inside_the_base_link_is_refused(panda):
    with pytest.raises(InputError, match=r"p\.yaml:3: .*'panda_link0' and 'ball' overlap by 110 mm"):
        load_problem(ATTACKS / "base/p.yaml")
    report = verify(with_ball(panda, 0.05), small_motion(panda))
    assert [(check.name, check.place) for check in report.failures] == [("collision", "panda_link0 – ball")]


def test_a_ball_inside_the_base_link_is_told_where_it_is_allowed(panda):
    allowed = frozenset({frozenset({"panda_link0", "ball"})})
    report = verify(with_ball(panda, 0.05, allowed=allowed), small_motion(panda))
    assert report.verified
    assert "contacts allowed by the problem, not checked: ball – panda_link0" in report.scope


def test_a_robot_may_stand_on_the_floor(panda):
    floor = Obstacle("floor", HalfSpace((0.0, 0.0, 1.0), 0.0), pin.SE3.Identity())
    assert verify(problem_of(panda, small_motion(panda), Scene((floor,))), small_motion(panda)).verified
    sunk = Obstacle("floor", HalfSpace((0.0, 0.0, 1.0), 0.01), pin.SE3.Identity())
    report = verify(problem_of(panda, small_motion(panda), Scene((sunk,))), small_motion(panda))
    assert report.failures[0].place == "panda_link0 – floor"


def test_what_is_not_checked_is_counted_in_the_report(panda):
    report = verify(problem_of(panda, small_motion(panda), Scene()), small_motion(panda))
    told = report.to_dict()
    assert told["unchecked_pairs"] == dict(report.unchecked_pairs)
    assert sum(told["unchecked_pairs"].values()) == len(panda.allowed)
    assert set(told["unchecked_pairs"]) == {"adjacent", "proved", "fixed"}
    assert told["links_without_geometry"] == ["panda_link8", "panda_hand_tcp"]


def test_pairs_that_touch_at_zero_are_checked(panda):
    """Hand and link 5, link 5 and link 7 of the Panda touch at q = 0 and are free in nine of ten configurations."""
    for pair in (("panda_hand", "panda_link5"), ("panda_link5", "panda_link7")):
        assert pair not in panda.allowed
        assert 0.02 < panda.survey.rates[pair] < 0.2


def test_a_clearance_asked_for_holds_for_proved_pairs_too(panda):
    """A proof leaves a tenth of a millimetre; who wants more has the pair checked."""
    report = verify(problem_of(panda, small_motion(panda), Scene()), small_motion(panda), VerifyPolicy(clearance=0.001))
    assert "proved" not in report.unchecked_pairs
    assert not report.verified  # neighbours of the Panda are nearer than that
    assert PROVED in panda.allowed.values()


def test_no_geometry_is_told_beside_the_verdict(tmp_path):
    parts = [LINK.format("a"), BARE.format("x"), LINK.format("b"), joint("j1", "a", "x"), joint("j2", "x", "b")]
    robot = load_robot(str(write_robot(tmp_path / "some", parts)))
    motion = within_limits(quintic(robot.joint_names, np.zeros(2), np.ones(2), 1.0), robot.limits)
    problem = problem_of(robot, motion, Scene())
    assert verify(problem, motion).links_without_geometry == ("x",)
    none = load_robot(str(write_robot(tmp_path / "none", parts, "collision: none\n")))
    report = verify(derived(problem, robot=none), motion)
    assert "collision: none: the robot has no bodies, and no contact of it is checked" in report.notes
    assert report.links_without_geometry == ("a", "x", "b")


def test_a_proof_does_not_outlive_the_limits_it_is_about(panda):
    """A problem with wider limits of position than the robot's has the proved pairs checked."""
    problem = problem_of(panda, small_motion(panda), Scene())
    wide = derived(problem, limits=replace(problem.limits, upper=problem.limits.upper + 1.0))
    assert "proved" in verify(problem, small_motion(panda)).unchecked_pairs
    assert "proved" not in verify(wide, small_motion(panda)).unchecked_pairs


def test_a_proof_does_not_outlive_a_generous_policy(panda):
    """A policy that lets a motion pass its limits by more than the box proved has the proved pairs checked."""
    problem, motion = problem_of(panda, small_motion(panda), Scene()), small_motion(panda)
    assert "proved" not in verify(problem, motion, VerifyPolicy(position_tolerance=0.01)).unchecked_pairs
