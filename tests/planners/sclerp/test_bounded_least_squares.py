import numpy as np
import pytest
from scipy.optimize import lsq_linear

from optiplan.planners.sclerp.bounded_least_squares import bounded_least_squares


@pytest.mark.parametrize("seed", range(60))
def test_it_is_the_optimum_that_another_solver_finds(seed):
    rng = np.random.default_rng(seed)
    A, b, towards = rng.normal(size=(6, 7)), 3.0 * rng.normal(size=6), rng.normal(size=7)
    low, high = -rng.uniform(0.0, 1.0, 7), rng.uniform(0.0, 1.0, 7)
    low[rng.integers(7)] = 0.0  # a joint at its limit
    weight = 10.0 ** rng.uniform(-8, 0)
    x = bounded_least_squares(A, b, (low, high), towards, weight)
    stacked = np.vstack([A, np.sqrt(weight) * np.eye(7)]), np.concatenate([b, np.sqrt(weight) * towards])
    other = lsq_linear(*stacked, bounds=(low, high + 1e-12), method="bvls", tol=1e-14).x
    cost = [float(np.sum((stacked[0] @ y - stacked[1]) ** 2)) for y in (x, other)]
    assert (low <= x).all()
    assert (x <= high).all()
    assert cost[0] <= cost[1] * (1.0 + 1e-9) + 1e-12
    assert np.abs(x - other).max() < 1e-5


def test_a_joint_that_cannot_move_stays_and_the_others_do_its_work():
    A, low, high = np.array([[1.0, 1.0]]), np.array([0.0, -1.0]), np.array([0.0, 1.0])
    assert bounded_least_squares(A, np.array([0.5]), (low, high), np.zeros(2), 1e-9) == pytest.approx([0.0, 0.5])


def test_bounds_that_leave_out_zero_are_kept():
    low, high = np.array([0.2, -1.0]), np.array([0.3, -0.4])
    x = bounded_least_squares(np.eye(2), np.zeros(2), (low, high), np.zeros(2), 1e-6)
    assert x == pytest.approx([0.2, -0.4])
