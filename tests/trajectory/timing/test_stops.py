"""Motions that stop at every corner."""

import numpy as np
import pytest

from optiplan.robot.limits import Limits
from optiplan.trajectory.timing.stops import stop_at_corners

LIMITS = Limits(*(np.full(2, bound) for bound in (-3.0, 3.0, 2.0, 10.0, 100.0, np.inf)))


@pytest.mark.parametrize("step", [0.0, 5e-324, 1e-310, 1e-200, 1e-60, 1e-17])
def test_steps_next_to_nothing_are_motions(step):
    motion = stop_at_corners(np.array([[0.0, 1.0], [step, 1.0]]), LIMITS, ("a", "b"))
    assert motion.duration > 0.0
    assert np.abs(motion.end - [step, 1.0]).max() <= 1e-15
    beside = stop_at_corners(np.array([[0.0, 1.0], [step, 2.0]]), LIMITS, ("a", "b"))
    assert np.abs(beside.end - [step, 2.0]).max() <= 1e-12
