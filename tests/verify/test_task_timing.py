"""Steps of a task that take next to no time: whose they are, and that nothing is left out beside a long wait."""

import re
from dataclasses import replace

import numpy as np
import pytest

import optiplan as op
from optiplan.kinematics.jacobians import frame_pose
from optiplan.trajectory.segments import Segment

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
    """A part of the motion too short to be cut out is nobody's but the next one's, and no error."""
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
