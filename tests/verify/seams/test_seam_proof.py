"""Proof of a path: what follows it passes, and what is off its place, its axis or its speed is refused."""

from dataclasses import replace

import numpy as np
import pytest

from optiplan.geometry.scene import Scene
from optiplan.problem.seams.actions import Passing, PathEvent, SeamPart, SeamPath
from optiplan.problem.seams.building import SeamShape
from optiplan.problem.task.steps import TaskStep
from optiplan.robot.frames import frame_pose
from optiplan.trajectory.joining import cut_trajectory
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import VerifyPolicy
from optiplan.verify.seams.seam_check import seam_checks
from optiplan.verify.seams.seam_proof import SeamProof
from tests.verify.motions import problem_of

BEND, RATE, T = 0.6, 0.5, 2.0
"""rad of the elbow, rad/s of the shoulder, s."""

POLICY = VerifyPolicy()


@pytest.fixture(scope="module")
def turning(planar):
    """The shoulder turns evenly: the tool goes round evenly."""
    coefficients = np.array([[[0.0, BEND], [RATE, 0.0]]])
    return Trajectory(planar.joint_names, np.array([0.0, T]), coefficients)


@pytest.fixture(scope="module")
def path(planar, turning):
    """The arc of that tool, at its speed."""
    poses = [frame_pose(planar, turning(t), "tool") for t in np.linspace(0.0, T, 41)]
    points = np.array([X.translation for X in poses[::2]])
    through = {k: poses[2 * k - 1].translation for k in range(1, len(points))}
    curve = SeamShape(points, through, False, 0.0, np.array([X.rotation[:, 2] for X in poses[::2]]), None).curve()
    speed = curve.length / T
    return SeamPath(planar.joint_names, "tool", curve, speed, 0.01, 0.0, 0.0, 1e-4, 1e-3)


def checks(planar, path, motion, low=0.0, high=None):
    part = SeamPart(path, low, path.curve.length if high is None else high)
    return {check.name: check for check in SeamProof(part, planar, motion, POLICY).checks()}


def failed(found):
    return [name for name, check in found.items() if not check.passed]


def changed(motion, by, power):
    """The motion with a power of time added to the elbow."""
    c = np.zeros((1, power + 1, 2))
    c[:, :2] = motion.coefficients
    c[0, power, 1] += by
    return Trajectory(motion.joint_names, motion.breakpoints, c)


def test_a_tool_that_follows_is_proved(planar, path, turning):
    found = checks(planar, path, turning)
    assert list(found) == ["path", "path axis", "path speed"]
    assert not failed(found)
    assert all(check.kind == "continuous" for check in found.values())
    assert found["path"].worst < 1e-6
    assert found["path speed"].limit == pytest.approx(0.01 * path.speed)


@pytest.mark.parametrize("factor", [1.02, 0.98])
def test_another_speed_is_refused(planar, path, turning, factor):
    assert failed(checks(planar, path, turning.scaled(T * factor))) == ["path speed"]


def test_a_speed_that_swings_is_refused_and_one_within_the_share_is_not(planar, path, turning):
    """s(t) swings about its mean once: between samples that miss it the proof looks."""
    for share, passes in ((0.008, True), (0.012, False)):
        w = share * RATE
        c = np.zeros((1, 4, 2))
        c[0, 0, 1] = BEND
        c[0, 1:, 0] = RATE - w, 3.0 * w / T, -2.0 * w / T**2  # the rate is RATE - w + 6 w (t / T - (t / T)²)
        found = checks(planar, path, Trajectory(turning.joint_names, turning.breakpoints, c))
        assert found["path speed"].passed is passes, share
        assert found["path"].passed is True


@pytest.mark.parametrize("power", [1, 2])
def test_a_tool_that_leaves_its_path_is_refused(planar, path, turning, power):
    assert "path" in failed(checks(planar, path, changed(turning, 4e-4, power)))
    assert "path" not in failed(checks(planar, path, changed(turning, 1e-6, power)))


def test_a_path_backwards_or_in_part_is_refused(planar, path, turning):
    back = np.array([[[RATE * T, BEND], [-RATE, 0.0]]])
    found = failed(checks(planar, path, Trajectory(turning.joint_names, turning.breakpoints, back)))
    assert "path" in found
    half = Trajectory(turning.joint_names, np.array([0.0, 0.5 * T]), turning.coefficients)
    assert "path" in failed(checks(planar, path, half))
    assert not failed(checks(planar, path, half, 0.0, 0.5 * path.curve.length))


def test_a_detour_and_back_along_the_path_is_refused(planar, path, turning):
    """The tool is on the curve at all times and fast enough, but goes back and forth on it."""
    w = 2.0 * RATE
    c = np.zeros((1, 4, 2))
    c[0, 0, 1] = BEND
    c[0, 1:, 0] = RATE + w, -3.0 * w / T, 2.0 * w / T**2
    assert set(failed(checks(planar, path, Trajectory(turning.joint_names, turning.breakpoints, c)))) & {
        "path",
        "path speed",
    }


def test_a_tilted_axis_is_refused_beyond_its_cone(planar, path, turning):
    tilted = replace(path.curve, axis=path.curve.axis + np.array([0.0, 0.1, 0]) * (np.arange(4) == 0)[:, None])
    assert failed(checks(planar, replace(path, curve=tilted), turning)) == ["path axis"]
    assert not failed(checks(planar, replace(path, curve=tilted, cone=0.11), turning))


def test_a_turn_that_is_given_counts(planar, path, turning):
    """The tool turns about its y axis: its x axis keeps to a plane, and is nowhere along y."""
    for axis, wrong in ((0, []), (1, ["path axis"])):
        heading = np.zeros_like(path.curve.axis)
        heading[:, 0] = frame_pose(planar, turning(0.0), "tool").rotation[:, axis]
        given = replace(path, curve=replace(path.curve, heading=heading))
        assert failed(checks(planar, given, turning)) == wrong


def test_slow_parts_are_near_ends_and_corners_alone(planar, path, turning):
    """From rest to rest by a quintic: slow near the ends, too fast in the middle unless the speed is its largest."""
    tau = np.array([0, 0, 0, 10.0, -15.0, 6.0])
    c = np.zeros((1, 6, 2))
    c[0, 0, 1] = BEND
    c[0, :, 0] += RATE * T * tau / T ** np.arange(6)
    motion = Trajectory(turning.joint_names, turning.breakpoints, c)
    length = path.curve.length
    assert "path speed" in failed(checks(planar, replace(path, ramp=0.1 * length), motion))
    fastest = replace(path, speed=1.875 * path.speed * 1.001, ramp=0.51 * length)
    assert not failed(checks(planar, fastest, motion))
    assert "path speed" in failed(checks(planar, replace(fastest, speed=1.8 * path.speed), motion))


def test_an_event_is_at_its_place(planar, path, turning):
    problem = problem_of(planar, turning, Scene())
    whole = replace(path, events=(PathEvent(0.5 * path.curve.length, "on"),))
    step = TaskStep(1, "passing", "on", Passing(whole, 0.5 * path.curve.length))
    for share, passes in ((0.5, True), (0.501, False)):
        (check,) = seam_checks(0, step, problem, (None, turning(share * T)), POLICY)
        assert (check.name, check.passed, check.covers) == ("path event", passes, ("task[0].event",))


def test_a_part_that_takes_no_time_is_refused(planar, path, turning):
    problem = problem_of(planar, turning, Scene())
    for high, passes in ((path.curve.length, False), (0.0, True)):
        step = TaskStep(1, "path", "path", SeamPart(path, 0.0, high))
        (check,) = seam_checks(0, step, problem, (None, turning(0.0)), POLICY)
        assert check.passed is passes
        assert bool(check.covers) is passes


def test_a_step_of_the_curve_between_its_pieces_counts(planar, path, turning):
    """A piece of a nanometre that no sample meets, in which the place or the axis is elsewhere."""
    curve, k = path.curve, len(path.curve.position) // 2
    h = np.diff(curve.breakpoints)[k]
    edges = np.insert(curve.breakpoints, k + 1, curve.breakpoints[k] + np.array([0.3183 * h, 0.3183 * h + 1e-9]))
    spiked = {}
    for name in ("position", "axis"):
        c = getattr(curve, name)
        parts = [Trajectory(("x", "y", "z"), np.array([0.0, h]), c[k : k + 1]) for _ in range(3)]
        ends = (0.0, edges[k + 1] - edges[k], edges[k + 2] - edges[k], h)
        cut = [cut_trajectory(one, a, b).coefficients for one, a, b in zip(parts, ends[:-1], ends[1:], strict=True)]
        spiked[name] = np.concatenate([c[:k], *cut, c[k + 1 :]])
    same = replace(curve, breakpoints=edges, **spiked)
    assert not failed(checks(planar, replace(path, curve=same), turning))
    for name, wrong in (("position", "path"), ("axis", "path axis")):
        off = spiked[name].copy()
        off[k + 1, 0] += np.array([0.0, 0.3, 0.0])
        assert failed(checks(planar, replace(path, curve=replace(same, **{name: off})), turning)) == [wrong]
