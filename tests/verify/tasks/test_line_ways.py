"""Speeds on lines: held where they can be, and where not the report says which limit is in the way."""

import numpy as np
import pytest

import optiplan as op

HOME = [0.0, -1.5, 1.5, -1.5, -1.5, 0.0]
BUDGET = 60.0
"""s, far more than is needed."""


def glued(speed, length):
    """A line of glue, from rest to rest."""
    start = op.Pose(position=(0.45, -0.5 * length, 0.3), rpy=(np.pi, 0.0, 0.0))
    task = op.Task().move(start).dwell(0.1).line(by=[0.0, length, 0.0], speed=speed).dwell(0.1)
    return op.plan(op.Problem("ur5", HOME, task=task), budget=BUDGET)


def line_speed(run):
    (check,) = [check for check in run.report.checks if check.name == "line speed"]
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
