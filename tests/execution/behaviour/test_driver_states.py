"""States of a driver that cannot be: each ends in the stop along the path, with its reason."""

import numpy as np
import pytest

from optiplan.execution.measurement import Measurement
from tests.execution.in_process import FollowingRobot, executed, steps_within_limits

FAULTS = {
    "jump": (lambda q, now: Measurement(q + 0.3, 0.0 * q, now), "jumped by"),
    "backwards": (lambda q, now: Measurement(q, 0.0 * q, now - 1.0), "ran backwards by"),
    "old": (lambda q, now: Measurement(q, 0.0 * q, now, 0.5), "0.500 s old"),
    "frozen": (lambda q, now: Measurement(q, 0.0 * q, 100.0), "s of states"),
    "nan": (lambda q, now: Measurement(q * np.nan, 0.0 * q, now), "finite positions"),
    "size": (lambda q, now: Measurement(q[:3], q[:3], now), "expected 7 finite positions"),
    "words": (lambda q, now: Measurement("home", None, now), "expected 7 finite positions"),
    "none": (lambda q, now: None, "no state for"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_each_ends_in_the_stop_along_the_path(run_of, fault):
    make, reason = FAULTS[fault]

    class Faulty(FollowingRobot):
        def state(self):
            if len(self.ticks) < 200:
                return super().state()
            return make(self.q, self.clock.now())

    run = run_of("01_reach")
    robot = Faulty(run)
    found = executed(run, robot).snapshot()
    assert (found["phase"], found["speed"]) == ("stopped", 0.0)
    if fault != "frozen":
        assert reason in found["reason"]
    assert steps_within_limits(robot.ticks, 1e-3, run.problem.limits)
    assert robot.stopped == [found["reason"]]
