"""`taskspace`: the controller alone, and led along a path where it stands still before an obstacle."""

import pytest

import optiplan as op


@pytest.fixture(scope="module")
def table():
    return op.load_problem("03_table")


def test_alone_it_says_where_it_ends(table):
    run = op.plan(table, planner="taskspace", budget=60, options={"lead": False})
    assert run.trajectory is None
    assert run.failure.kind == "no-path"
    assert "does not get to the goal" in run.failure.detail
    assert "nearest:" in run.failure.detail
    assert len(run.failure.witness["q"]) == table.robot.n


def test_led_along_a_path_it_gets_there(table):
    run = op.plan(table, planner="taskspace", budget=60)
    assert run.verified
    assert run.trajectory.duration < 6.0
