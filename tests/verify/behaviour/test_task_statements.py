"""What steps of a task state besides their ends: the speed of lines, and distances from what moves."""

import numpy as np
import pytest

import optiplan as op

START = [0.0, -1.5, 1.5, -1.5, -1.5, 0.0]

ABOVE = (0.5, 0.2, 1.1)
"""m: over the hand."""


def lines(speed):
    task = op.Task().line(by=(0.0, 0.0, 0.15), speed=speed).retreat(0.05, speed=1.0)
    return op.Problem("ur5", START, task=task)


def checked(report, name):
    return next(check for check in report.checks if check.name == name)


def test_a_line_that_is_faster_than_its_speed_is_refused():
    run = op.plan(lines(0.5), budget=5.0)
    assert run.verified
    assert checked(run.report, "line speed").worst <= 0.5 * 1.001
    slower = op.verify(lines(0.1), run.trajectory)
    assert [check.name for check in slower.failures] == ["line speed"]
    (refused,) = slower.failures
    assert refused.limit == pytest.approx(0.1, rel=2e-3)
    assert refused.worst > 0.2
    assert "step 1 (line)" in refused.detail
    assert refused.time < run.trajectory.segments[0].end


@pytest.mark.parametrize(("wait", "holds"), [(0.0, True), (2.0, False)])
def test_a_clearance_of_a_step_counts_where_things_are_then(wait, holds):
    """A ball falls at 0.2 m/s: while the arm waits it comes nearer than the step allows."""
    ball = op.Sphere("ball", 0.05, position=ABOVE).moving([[0], [0], [0, -0.2]], until=2.0)
    keep = op.PairClearance([("ball", "wrist_3_link")], at_least=0.3)
    end = [*START[:5], 0.05]
    task = op.Task().dwell(wait or 1e-3).move(end, path_constraints=[keep])
    run = op.plan(op.Problem("ur5", START, scene=[ball], task=task), budget=5.0)
    begin = run.trajectory.segments[1].begin
    assert begin == pytest.approx(wait or 1e-3)
    found = checked(run.report, "clearance constraint")
    assert found.passed is holds
    assert run.verified is holds
    if not holds:
        assert found.time >= begin
        place = np.array(found.witness["points"])[found.witness["pair"].index("ball")]
        assert place[2] < ABOVE[2] - 0.2 * begin + 0.05 + 1e-3
