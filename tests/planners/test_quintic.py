import numpy as np
import pytest

from optiplan.planners.quintic import straight
from optiplan.trajectory.timing import speed_ratio
from tests.planners import cases


@pytest.mark.parametrize(("velocity", "acceleration", "jerk"), [(1, 1e3, 1e6), (1e3, 1, 1e6), (1e3, 1e3, 1)])
def test_duration_just_meets_the_tightest_of_the_three_limits(velocity, acceleration, jerk):
    from optiplan.model.robot import Limits

    ones = np.ones(2)
    limits = Limits(-9 * ones, 9 * ones, velocity * ones, acceleration * ones, jerk * ones, ones)
    trajectory = straight(np.zeros(2), np.array([0.7, -1.3]), limits, ("a", "b"))
    assert speed_ratio(trajectory, limits) == pytest.approx(1.0, rel=1e-9)


def test_all_joints_move_in_proportion():
    problem = cases.free()
    trajectory = straight(problem.start, cases.LEFT, problem.limits, problem.robot.joint_names)
    share = (trajectory(np.linspace(0.0, trajectory.duration, 50)) - problem.start)[:, [0, 3]] / (
        cases.LEFT - problem.start
    )[[0, 3]]
    assert share[:, 0] == pytest.approx(share[:, 1], abs=1e-12)
    assert np.abs(trajectory(np.array([0.0, trajectory.duration]), 2)).max() < 1e-9
