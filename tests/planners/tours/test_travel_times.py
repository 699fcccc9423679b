"""Times of straight motions are those of the motions, and no shorter than any motion."""

import numpy as np
import pytest

import optiplan as op
from optiplan.planners.tours.travel_times import TravelTimes
from optiplan.trajectory.profiles.laws import SCurve
from optiplan.trajectory.profiles.synchronisation import RestToRest
from optiplan.trajectory.timing.lower_bound import lower_bounds


@pytest.mark.parametrize("jerk", [1.0, "none"])
def test_times_are_the_durations_of_straight_motions(jerk):
    robot = op.load_robot("ur5")
    limits = robot.limits.scaled(jerk=jerk)
    rng = np.random.default_rng(3)
    A, B = rng.uniform(-1, 1, (4, 6)), rng.uniform(-1, 1, (5, 6)) * np.array([[1e-3], [0.1], [1], [2], [3]])
    B[0] = A[0]
    times = TravelTimes(limits)
    found = times.between(A, B)
    for i, a in enumerate(A):
        assert (found[i] >= lower_bounds(a, B, limits) * (1 - 1e-12)).all()
        for j, b in enumerate(B):
            if (a != b).any():
                motion = RestToRest(a, b, limits, robot.joint_names, lambda _: SCurve()).trajectory()
                assert found[i, j] == pytest.approx(motion.duration, rel=1e-9)
    assert found[0, 0] == 0.0
    assert np.allclose(times.along(A), [times.between(A[k : k + 1], A[k + 1 :])[0, 0] for k in range(3)])
