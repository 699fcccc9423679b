"""`taskspace`: the controller alone, and led along a path where it stands still before an obstacle."""

import numpy as np
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


@pytest.mark.parametrize(
    ("name", "seed", "count"),
    [
        ("05_cage", 1, 1),  # the configuration that was found for the goal's pose lies on the end of a joint
        ("12_planar", 0, 2),  # follows only what leads it closely
        ("16_delbot", 0, 1),  # far away in tolerances for long, while the path goes round
    ],
)
def test_it_gets_there_whatever_the_seed_and_twice_alike(name, seed, count):
    problem = op.load_problem(name)
    first, *again = (op.plan(problem, planner="taskspace", budget=120, seed=seed) for _ in range(count))
    assert first.verified
    times = np.linspace(0.0, first.trajectory.duration, 200)
    for second in again:
        np.testing.assert_array_equal(first.trajectory(times), second.trajectory(times))
