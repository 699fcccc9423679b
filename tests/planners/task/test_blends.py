"""Corners of lines that are rounded off: passed without stopping, within the radius that was said, and proved."""

from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.planners.task.blends import BlendedLine, Corner, LineSegment
from optiplan.verify.verify import verify
from tests.checks import named

BLEND = 0.03


def task(blend):
    """Up, sideways, down again."""
    return (
        op.Task()
        .move(begin("panda", (0.5, -0.15, 0.3)))
        .line(by=(0, 0, 0.15), name="up", blend=blend)
        .line(op.Pose((0.5, 0.15, 0.45), rpy=(np.pi, 0, 0)), name="over", blend=blend)
        .line(by=(0, 0, -0.15), name="down", speed=0.3)
    )


@cache
def begin(robot, position):
    """Where the lines begin: one configuration, as the choice among several is not what is looked at here."""
    return op.ik(robot, op.Pose(position, rpy=(np.pi, 0, 0)))


def problem(blend):
    return op.Problem("panda", "ready", task=task(blend))


@pytest.fixture(scope="module")
def run():
    found = op.plan(problem(BLEND), budget=60.0)
    assert found.verified, (found.failure, found.report)
    return found


@pytest.fixture(scope="module")
def exact():
    found = op.plan(problem(None), budget=60.0)
    assert found.verified, (found.failure, found.report)
    return found


def corner(run, name):
    """Time and distance at which the tool is nearest to the corner at the end of a step."""
    X = {"up": (0.5, -0.15, 0.45), "over": (0.5, 0.15, 0.45)}[name]
    segment = next(segment for segment in run.trajectory.segments if segment.name == name)
    return segment.end, np.array(X)


def tool(run, t):
    model = run.problem.robot.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, run.trajectory(t))
    return data.oMf[run.problem.robot.frame_id(run.problem.robot.tool_frame)].translation.copy()


def test_corners_are_passed_within_the_radius(run):
    for name in ("up", "over"):
        t, X = corner(run, name)
        assert np.abs(run.trajectory(t, 1)).max() > 0.1
        assert 1e-3 < np.linalg.norm(tool(run, t) - X) < BLEND
    assert run.info["stops"] == []


def test_it_is_quicker_than_exact_corners_which_stop_and_say_so(run, exact):
    assert run.duration < exact.duration
    stops = exact.info["stops"]
    assert [stop["after"] for stop in stops if "exact corner of two lines" in stop["why"]] == [2, 3]
    for stop in stops:
        assert np.abs(exact.trajectory(stop["t"], 1)).max() < 1e-6


def test_the_verdict_is_about_the_radius(run, exact):
    check = named(run.report, "line")
    assert check.kind == "continuous"
    for blend in (None, 0.4 * BLEND):
        report = verify(problem(blend), run.trajectory)
        assert not report.verified
        assert "line" in {check.name for check in report.failures}
    assert verify(problem(2.0 * BLEND), run.trajectory).verified
    assert verify(problem(BLEND), exact.trajectory).verified


def test_a_corner_cut_outside_its_ball_is_refused(run):
    motion = run.trajectory
    t, _ = corner(run, "up")
    piece = int(np.searchsorted(motion.breakpoints, t)) - 1
    coefficients = np.array(motion.coefficients)
    coefficients[piece, 0] += 0.05
    bent = replace(motion, coefficients=coefficients)
    assert not verify(run.problem, bent).verified


def test_a_robot_without_a_joint_to_spare_turns_its_tool():
    lines = (
        op.Task()
        .move(begin("ur5", (0.3, -0.1, 0.3)))
        .line(by=(0, 0, 0.1), blend=0.02)
        .line(op.Pose((0.3, 0.1, 0.4), rpy=(np.pi, 0, 0.6)), blend=0.02)
        .line(by=(0, 0, -0.1))
    )
    found = op.plan(op.Problem("ur5", "ready", task=lines), budget=60.0)
    assert found.verified, (found.failure, found.report)
    assert found.info["stops"] == []


def corner_of(turns=(0.0, 0.0)):
    start = pin.SE3(pin.rpy.rpyToMatrix(0.3, 0.2, 0.1), np.array([0.1, 0.2, 0.3]))
    middle = pin.SE3(pin.exp3(np.array([turns[0], 0.1 * turns[0], 0.0])) @ start.rotation, np.array([0.3, 0.2, 0.3]))
    end = pin.SE3(pin.exp3(np.array([0.0, turns[1], 0.0])) @ middle.rotation, np.array([0.35, 0.5, 0.2]))
    ways = LineSegment.between(start, middle), LineSegment.between(middle, end)
    return Corner.of(*ways, 0.05), ways


@pytest.mark.parametrize("turns", [(0.0, 0.0), (0.7, -0.9)])
def test_the_path_of_a_corner_has_its_derivatives_and_no_jumps(turns):
    found, (first, second) = corner_of(turns)
    before, after = BlendedLine(first, None, found), BlendedLine(second, found, None)
    h = 1e-6
    for path in (before, after):
        for s in np.linspace(0.05, 0.95, 23):
            X, Y = path.pose(s - h), path.pose(s + h)
            twist = np.concatenate([Y.translation - X.translation, pin.log3(Y.rotation @ X.rotation.T)]) / (2 * h)
            assert path.twist(s) == pytest.approx(twist, abs=1e-6)
            assert path.twist_rate(s) == pytest.approx((path.twist(s + h) - path.twist(s - h)) / (2 * h), abs=1e-4)
    assert before.pose(1.0).homogeneous == pytest.approx(after.pose(0.0).homogeneous, abs=1e-12)
    assert before.twist(1.0) / first.length == pytest.approx(after.twist(0.0) / second.length, abs=1e-12)
    across = np.linspace(-0.05, 0.05, 99)
    away = [np.linalg.norm(found.state(x)[0].translation - found.X_WC.translation) for x in across]
    assert max(away) <= 0.05
    assert max(np.linalg.norm(found.state(x)[1][:3]) for x in across) <= 1.0 + 1e-9


def test_a_line_straight_back_has_no_blend():
    start, end = pin.SE3.Identity(), pin.SE3(np.eye(3), np.array([0.1, 0, 0]))
    assert Corner.of(LineSegment.between(start, end), LineSegment.between(end, start), 0.05) is None


@pytest.mark.parametrize(
    ("steps", "words"),
    [
        (op.Task().line(by=(0, 0, 0.1), blend=0.01), "no line after it"),
        (op.Task().line(by=(0, 0, 0.1), blend=0.01).dwell(0.1).line(by=(0, 0.1, 0)), "no line after it"),
        (op.Task().line(by=(0, 0, 0.1), blend=0.01).line(by=(0, 0.1, 0), frame="panda_link7"), "another frame"),
    ],
)
def test_a_blend_needs_a_line_after_it(steps, words):
    with pytest.raises(op.InputError, match=words):
        op.Problem("panda", "ready", task=steps)
