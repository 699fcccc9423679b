"""A task that begins while the robot moves: its first step is a move that takes the motion over."""

import numpy as np
import pytest

import optiplan as op

MOVE = {"move": {"joints": [0.6, -0.4, 0.1, -2.0, 0.1, 1.8, 0.7]}}
BACK = {"move": {"configuration": "ready"}}
STATE = {"velocity": [0.4, 0.1, 0, 0, 0, 0, 0], "acceleration": [0.5, 0, 0, 0, 0, 0, 0]}
GRIPPER = {"gripper": {"group": "hand", "joints": [0.02]}}


def task(*steps, start=STATE):
    return op.Problem("panda", {"configuration": "ready", **start}, task=list(steps))


@pytest.fixture(scope="module")
def run():
    return op.plan(task(MOVE, {"dwell": 0.1}, BACK), budget=20.0)


def test_the_first_move_takes_the_motion_over(run):
    assert run.verified, (run.failure, run.report)
    q, v, a = (run.trajectory(0.0, order)[:7] for order in range(3))
    assert q == pytest.approx(run.problem.start[:7], abs=1e-9)
    assert v == pytest.approx(STATE["velocity"], abs=1e-9)
    assert a == pytest.approx(STATE["acceleration"], abs=1e-9)
    first, dwell, _ = run.trajectory.segments
    assert np.abs(run.trajectory(first.end, 1)).max() < 1e-6
    assert dwell.end - dwell.begin == pytest.approx(0.1)
    assert run.ratio >= 1.0


def test_a_motion_from_rest_is_refused(run):
    at_rest = op.plan(task(MOVE, {"dwell": 0.1}, BACK, start={}), budget=20.0)
    assert at_rest.verified
    report = op.verify(run.problem, at_rest.trajectory)
    assert [check.name for check in report.failures] == ["ends"]


@pytest.mark.parametrize(
    ("first", "also"),
    [({"dwell": 0.1}, []), (GRIPPER, [0]), ({"line": {"by": [0, 0, 0.05]}}, [])],
    ids=["dwell", "gripper", "line"],
)
def test_what_cannot_take_it_over_is_bad_input(first, also):
    start = {key: values + also for key, values in STATE.items()}  # a task with a gripper has its joints too
    with pytest.raises(op.InputError, match=r"start\.velocity: .*joint1.*moving before.*a `move` of these joints"):
        task(first, MOVE, start=start)


def test_planners_that_begin_at_rest_say_so(run):
    found = op.plan(run.problem, "rrtconnect", budget=5.0)
    assert found.failure is not None
    assert found.failure.kind == "unsupported"
