"""Speeds on lines: held where they can be, and where not the report says which limit is in the way."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.problem.problem import derived
from tests.checks import named

HOME = [0.0, -1.5, 1.5, -1.5, -1.5, 0.0]
BUDGET = 60.0
"""s, far more than is needed."""


def glued(speed, length):
    """A line of glue, from rest to rest."""
    start = op.Pose(position=(0.45, -0.5 * length, 0.3), rpy=(np.pi, 0.0, 0.0))
    task = op.Task().move(start).dwell(0.1).line(by=[0.0, length, 0.0], speed=speed).dwell(0.1)
    return op.plan(op.Problem("ur5", HOME, task=task), budget=BUDGET)


def line_speed(run):
    check = named(run.report, "line speed")
    (line,) = check.witness["lines"]
    return check, line


def test_a_speed_that_can_be_held_is_held():
    """A spline that passed the limit at its ends used to slow the whole line down."""
    run = glued(0.1, 0.4)
    assert run.verified
    check, line = line_speed(run)
    assert line["asked"] == 0.1
    assert line["held"] == pytest.approx(0.1, rel=2e-3)
    assert line["why"] == ""
    assert check.detail.endswith("0.1 m/s asked, 0.0999 held")


def test_a_speed_that_cannot_be_held_has_a_reason():
    run = glued(2.0, 0.1)
    assert run.verified
    check, line = line_speed(run)
    assert line["held"] < 0.5 * line["asked"]
    assert "is at its limit" in line["why"]
    assert line["why"] in check.detail
    assert any("lines slower than asked: step 3" in words and line["why"] in words for words in run.report.scope)


def test_an_approach_ends_where_it_began_before():
    """A nearer end than the one before which the move stopped, along another way, is not the end of its line."""
    near, other = (op.Pose(position=at, rpy=(np.pi, 0.0, 0.0)) for at in ((0.5, 0.0, 0.30), (0.45, 0.0, 0.25)))
    before = op.Pose(position=(0.45, 0.0, 0.35), rpy=(np.pi, 0.0, 0.0))
    problem = op.Problem("ur5", HOME, task=op.Task().approach([near, other], 0.1))
    found = {}
    for name, end in (("askew", near), ("along", other)):
        run = op.plan(op.Problem("ur5", HOME, task=op.Task().move(before).line(end)), planner="quintic", budget=BUDGET)
        parts = tuple(replace(part, step=1, kind="approach", name="approach") for part in run.trajectory.segments)
        found[name] = op.verify(problem, replace(run.trajectory, segments=parts))
    assert found["along"].verified
    assert [check.name for check in found["askew"].checks if not check.passed] == ["goal"]


def test_an_approach_to_a_region_ends_in_it():
    """The poses at which it may end have tolerances of their own."""
    flat = op.Region((0.45, 0.0, 0.25), along={"x": 0.05, "y": 0.05, "z": 0.0005}, rpy=(np.pi, 0.0, 0.0))
    problem = op.Problem("ur5", HOME, task=op.Task().approach(flat, 0.1))
    run = op.plan(problem, planner="quintic", budget=BUDGET)
    assert run.verified
    move, line = problem.task
    lower = line.action.region.moved(pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.001])))
    other = derived(problem, task=(move, replace(line, action=replace(line.action, region=lower))))
    assert [check.name for check in op.verify(other, run.trajectory).checks if not check.passed] == ["goal"]
