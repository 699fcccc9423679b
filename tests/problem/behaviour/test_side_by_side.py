"""Problems whose file puts robots side by side."""

import numpy as np
import pytest

import optiplan as op
from optiplan.errors import InputError
from optiplan.problem.load import check_file, load_problem
from tests.checks import named

HEAD = """version: 1
name: two
robots:
  a: {use: planar2r}
  b: {use: planar2r, base: {position: [0, 1.0, 0]}}
"""
REST = """start: {configuration: out}
goal: {joints: {a/shoulder: 0.5, a/elbow: 1, b/shoulder: -0.5, b/elbow: 0}}
"""


@pytest.fixture
def write(tmp_path):
    def make(text):
        path = tmp_path / "two.yaml"
        path.write_text(text)
        return path

    return make


def test_file_python_and_saved_file_are_the_same_problem(write, tmp_path):
    problem = load_problem(write(HEAD + REST))
    assert problem.robot.joint_names == ("a/shoulder", "a/elbow", "b/shoulder", "b/elbow")
    np.testing.assert_array_equal(problem.goal[0].q, [0.5, 1.0, -0.5, 0.0])
    problem.save(tmp_path / "saved.yaml")
    assert load_problem(tmp_path / "saved.yaml").hash == problem.hash
    arms = op.Robot.side_by_side({"b": {"use": "planar2r", "base": op.Pose((0, 1.0, 0))}, "a": "planar2r"})
    assert op.Problem(arms, "out", [0.5, 1.0, -0.5, 0.0], name="two").hash == problem.hash
    assert load_problem(write(HEAD.replace("1.0", "1.1") + REST)).hash != problem.hash


def test_bases_may_be_in_frames_and_the_whole_may_stand_elsewhere(write):
    text = HEAD.replace("base: {position: [0, 1.0, 0]}", "base: {in: rail, position: [0, 0.5, 0]}")
    placed = load_problem(write(text + REST + "base: {position: [0, 0, 2]}\nframes: {rail: {position: [0, 0.5, 0]}}\n"))
    plain = load_problem(write(HEAD + REST))
    q = placed.start
    np.testing.assert_allclose(
        placed.robot.fk(q, "b/tool").position, np.add(plain.robot.fk(q, "b/tool").position, (0, 0, 2))
    )


@pytest.mark.parametrize(
    ("old", "new", "line", "field", "found"),
    [
        ("b: {use: planar2r", "b: {use: planar9r", 5, "robots.b.use", "unknown robot 'planar9r'"),
        ("1.0, 0]", "0.0, 0]", 5, "robots.b.base", "an arm that stands in"),
        ("b: {use: planar2r", "b: {use: {robots: {x: planar2r, y: planar2r}}", 5, "robots.b.use", "several robots"),
        ("use: planar2r, base", "base", 5, "robots.b.use", "nothing"),
        ("name: two", "robot: panda", 3, "robots", "`robots` beside `robot`"),
        ("start:", "group: c\nstart:", 6, "group", "unknown group 'c'"),
        ("start:", "locked: {a/elbow: 0.1}\nstart:", 6, "locked.a/elbow", "the planned joint"),
        ("b/elbow: 0", "b/elbows: 0", 7, "goal.joints.b/elbows", "unknown joint"),
    ],
)
def test_errors_name_line_and_key_of_the_file(write, old, new, line, field, found):
    text = HEAD + REST
    assert old in text
    issues = check_file(write(text.replace(old, new)))
    assert (line, field) in [(issue.line, issue.field) for issue in issues], issues
    assert any(found in issue.found for issue in issues), issues


def test_a_file_of_several_robots_does_not_use_itself(tmp_path):
    cell = tmp_path / "cell.yaml"
    cell.write_text("version: 1\nrobots: {a: {use: cell.yaml}, b: {use: planar2r}}\n")
    with pytest.raises(InputError, match=r"cell.yaml:2: robots.a.use: several robots; expected one robot"):
        op.load_robot(cell)


def test_arms_that_meet_are_no_start_and_no_motion(write):
    near = HEAD.replace("1.0", "0.15")
    with pytest.raises(InputError, match="the start is in collision: 'a/"):
        load_problem(write(near + REST))


def test_a_motion_through_the_other_arm_is_not_verified(write):
    """The forearm of b turns through that of a, which stands still and points at it."""
    base = "position: [1.6, 0.36, 0], rpy: [0, 0, 3.141592653589793]"
    robots = HEAD.replace("position: [0, 1.0, 0]", base)
    turn = "start: {joints: [0, 0, -1.2, 0]}\ngoal: {joints: [0, 0, 1.2, 0]}\n"
    problem = load_problem(write(robots + turn))
    run = op.retime(problem, [[0, 0, -1.2, 0], [0, 0, 1.2, 0]])
    contact = named(run.report, "collision")
    assert not contact.passed
    assert "a/" in contact.place
    assert "b/" in contact.place
    apart = load_problem(write(robots.replace("0.36", "0.56") + turn))
    assert op.retime(apart, [[0, 0, -1.2, 0], [0, 0, 1.2, 0]]).verified
