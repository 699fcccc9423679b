"""States that are old, run backwards or jump."""

import math

import numpy as np
import pytest
from optiplan.execution.state_watch import JUMP, OLDEST, StateWatch

from optiplan.execution.measurement import Measurement
from tests.execution.in_process import FollowingRobot, executed, steps_within_limits


def state(q, stamp, age=0.0):
    return Measurement(np.array([0.0, q]), np.zeros(2), stamp, age)


@pytest.fixture
def watch():
    watch = StateWatch(("shoulder", "elbow"), np.array([1.0, 2.0]))
    assert watch.fault(state(0.0, 5.0)) == ""
    return watch


@pytest.mark.parametrize("q", [0.0, 0.2, -0.2 - 0.9 * JUMP])
def test_what_can_be(watch, q):
    assert watch.fault(state(q, 5.1, 0.9 * OLDEST)) == ""
    assert watch.fault(state(q, 5.1, 0.9 * OLDEST)) == ""  # the same once more


@pytest.mark.parametrize(
    ("seen", "reason"),
    [
        (state(0.0, 5.1, 1.1 * OLDEST), "the driver's state is 0.110 s old; expected at most 0.1 s"),
        (state(0.0, 5.1, math.nan), "is the float nan old"),
        (state(0.0, math.inf), "has the float inf as its time"),
        (state(0.0, 4.9), "run backwards in time by 0.100 s"),
        (state(0.2 + 1.1 * JUMP, 5.1), "jumps: elbow by 0.222"),
    ],
)
def test_what_cannot_be(watch, seen, reason):
    assert reason in watch.fault(seen)


@pytest.mark.parametrize("fault", ["jump", "backwards", "old", "nan"])
def test_each_ends_in_the_stop_along_the_path(run_of, fault):
    class Faulty(FollowingRobot):
        def state(self):
            now, q = self.clock.now(), self.q
            if len(self.ticks) < 200:
                return Measurement(q, 0.0 * q, now)
            return {
                "jump": Measurement(q + 0.3, 0.0 * q, now),
                "backwards": Measurement(q, 0.0 * q, now - 1.0),
                "old": Measurement(q, 0.0 * q, now, 0.5),
                "nan": Measurement(q * np.nan, 0.0 * q, now),
            }[fault]

    run = run_of("01_reach")
    robot = Faulty(run)
    found = executed(run, robot).snapshot()
    assert (found["phase"], found["speed"]) == ("stopped", 0.0)
    assert {"jump": "jumps", "backwards": "backwards", "old": "s old", "nan": "finite"}[fault] in found["reason"]
    assert steps_within_limits(robot.ticks, 1e-3, run.problem.limits)
    assert robot.stopped == [found["reason"]]
