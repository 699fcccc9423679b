import numpy as np

from optiplan.planners.point_to_point.polynomials import AccelerationOptions
from optiplan.planners.point_to_point.quintic import Quintic
from tests.planners import cases


def test_all_joints_move_in_proportion():
    problem = cases.free()
    trajectory = Quintic(AccelerationOptions()).profile(problem, cases.LEFT).trajectory()
    share = (trajectory(np.linspace(0.0, trajectory.duration, 50)) - problem.start)[:, [0, 3]] / (
        cases.LEFT - problem.start
    )[[0, 3]]
    assert np.abs(share[:, 0] - share[:, 1]).max() < 1e-12
    assert np.abs(trajectory(np.array([0.0, trajectory.duration]), 2)).max() < 1e-9
