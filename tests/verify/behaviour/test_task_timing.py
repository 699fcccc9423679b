"""Steps of a task that take next to no time: whose they are, and that nothing is left out beside a long wait."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import optiplan as op
from optiplan.robot.frames import frame_pose
from optiplan.trajectory.segments import Segment
from tests.checks import named

START, END = np.array([0.0, -1.5, 1.5, -1.5, -1.5, 0.0]), np.array([0.6, -1.2, 1.2, -1.5, -1.5, 0.3])
NAMES = tuple(f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"))


def quintic_after(wait, lasts, segments):
    """The arm stands for `wait`, s, then goes straight in joint space."""
    c = np.zeros((2, 6, 6))
    c[:, 0] = START
    for power, factor in ((3, 10.0), (4, -15.0), (5, 6.0)):
        c[1, power] = factor * (END - START) / lasts**power
    return op.Trajectory(NAMES, [0.0, wait, wait + lasts], c, segments)


@pytest.mark.parametrize("wait", [1.0, 1e6, 1e10])
def test_a_bent_line_is_refused_however_long_the_wait_before_it(wait):
    """Of 10^10 s it is less than a billionth."""
    robot = op.load_robot("ur5")
    end = op.Pose.from_matrix(frame_pose(robot, END, robot.tool_frame))
    problem = op.Problem(robot, START, task=op.Task().dwell(0.5).line(end))
    steps = [(step.number, step.kind, step.name) for step in problem.task]
    segments = (Segment(*steps[0], 0.0, wait), Segment(*steps[1], wait, wait + 4.0))
    report = op.verify(problem, quintic_after(wait, 4.0, segments))
    assert not report.verified
    assert {check.name for check in report.failures} & {"line", "standstill"}


@pytest.mark.parametrize("off", [-1e-13, 1e-14, 1e-13, 1e-12, 1e-11, 1e-10])
def test_an_event_may_be_a_rounding_off(off):
    """A part of the motion too short to be cut out may lie between two segments: it is the next one's, and no error."""
    scene = op.Scene([op.Box("cube", size=(0.04, 0.04, 0.04), position=(0.0, 0.0, 1.5))])
    task = op.Task().attach("cube", "wrist_3_link").move(END)
    problem = op.Problem("ur5", START, scene=scene, task=task)
    run = op.plan(problem, budget=3.0)
    assert run.verified, run.failure
    first, second = run.trajectory.segments
    assert first.begin == first.end == second.begin == 0.0
    moved = (replace(first, begin=off, end=off), replace(second, begin=off))
    report = op.verify(problem, replace(run.trajectory, segments=moved))
    assert report.verified
    assert any(re.fullmatch(r"taken though .* near: cube by wrist_3_link, 1.1 m away", said) for said in report.scope)


LONG_TASK = op.load_problem(Path(__file__).parents[2] / "attacks/longtask/problem.yaml")


def swung(lasts, wait):
    """The held cube goes into the wall and back within `lasts`, s; then all waits, s."""
    c = np.zeros((3, 7, 1))
    c[0, 3:, 0] = 0.9 * 64.0 * np.array([1.0, -3.0, 3.0, -1.0]) / lasts ** np.arange(3, 7)  # 0.9 (4 x (1 - x))^3
    at = (0.0, 0.0, lasts, lasts, 2.0, wait)
    segments = tuple(
        Segment(step.number, step.kind, step.name, begin, end)
        for step, begin, end in zip(LONG_TASK.task, (0.0, 0.0, lasts, lasts, 2.0), at[1:], strict=True)
    )
    return op.Trajectory(("j",), [0.0, lasts, 2.0, wait], c, segments)


@pytest.mark.parametrize(("lasts", "wait"), [(9e-4, 1e6 + 2.0), (9e-4, 1e12), (1e-6, 1e6 + 2.0), (1e-9, 3.0)])
def test_a_step_is_judged_in_its_own_scene_however_short_it_is(lasts, wait):
    report = op.verify(LONG_TASK, swung(lasts, wait))
    collision = named(report, "collision")
    assert not collision.passed
    assert "cube" in collision.place
    assert "step 2" in collision.detail
    assert not report.verified


def test_a_step_that_others_take_is_named():
    """Segments overlap by less than rounding, and the shorter of them has no part of the motion."""
    motion = swung(9e-4, 3.0)
    attach, first, detach, second, dwell = motion.segments
    late = replace(detach, begin=first.end + 5e-10, end=first.end + 5e-10)
    hidden = replace(second, begin=first.end + 1e-10, end=first.end + 2e-10)
    moved = (attach, replace(first, end=first.end + 5e-10), late, hidden, replace(dwell, begin=hidden.end))
    report = op.verify(LONG_TASK, replace(motion, segments=moved))
    check = named(report, "steps")
    assert not check.passed
    assert "which other steps take" in check.detail
