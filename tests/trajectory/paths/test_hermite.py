"""Polynomials between any two states."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from optiplan.robot.robot import Limits
from optiplan.trajectory.paths.hermite import Hermite, hermite
from optiplan.trajectory.profiles.laws import CUBIC, QUINTIC, SEPTIC
from optiplan.trajectory.timing.time_scaling import speed_ratio

NUMBER = st.floats(-3.0, 3.0)


@settings(max_examples=50, deadline=None)
@given(st.integers(1, 4), st.lists(NUMBER, min_size=16, max_size=16), st.floats(0.05, 20.0))
def test_both_states_are_met(k, numbers, T):
    start, end = np.array(numbers).reshape(2, 4, 2)[:, :k]
    wide = Limits(*(np.full(2, x) for x in (-np.inf, *[np.inf] * 5)))
    made = Hermite(start, end, wide, ("a", "b")).trajectory(T)
    for order in range(k):
        size = 1.0 + np.abs(np.array(numbers)).max() * max(T, 1.0 / T) ** 3
        assert made(np.array([0.0]), order)[0] == pytest.approx(start[order], abs=1e-12 * size)
        assert made(np.array([T]), order)[0] == pytest.approx(end[order], abs=1e-11 * size)


@pytest.mark.parametrize("law", [CUBIC, QUINTIC, SEPTIC])
def test_at_rest_it_is_the_law(law):
    k = len(law.shape) // 2
    ends = np.zeros((2, k, 1))
    ends[1, 0] = 1.0
    assert hermite(*ends, np.array([3.0]))[0, :, 0] == pytest.approx(law.shape, abs=1e-12)


def limits(v, a, j, room=9.0):
    ones = np.ones(2)
    return Limits(-room * ones, room * ones, v * ones, a * ones, j * ones, ones)


@pytest.mark.parametrize("bounds", [(1.0, 1e3, 1e6), (1e3, 1.0, 1e6), (1e3, 1e3, 1.0), (1.0, 1.0, 1.0)])
def test_the_shortest_just_meets_the_tightest_limit(bounds):
    rest = np.array([[0.7, -1.3], [0.0, 0.0], [0.0, 0.0]])
    moving = rest + np.array([[0.0, 0.0], [0.1, -0.2], [0.05, 0.0]])
    for end in (rest, moving):
        motion = Hermite(np.zeros((3, 2)), end, limits(*bounds), ("a", "b"))
        assert speed_ratio(motion.trajectory(), motion.limits) == pytest.approx(1.0, abs=1e-7)
        assert speed_ratio(motion.trajectory(0.98 * motion.shortest), motion.limits) > 1.0


def test_the_room_to_move_counts():
    """Starting fast towards a near limit, only a quick motion turns back in time."""
    start, end = np.array([[0.0, 0.0], [2.0, 0.0]]), np.array([[0.1, 0.0], [0.0, 0.0]])
    wide, narrow = (Hermite(start, end, limits(3.0, 40.0, 1e4, room), ("a", "b")) for room in (9.0, 0.12))
    assert wide.trajectory().extrema(0)[1][0] <= 9.0
    assert narrow.trajectory().extrema(0)[1][0] <= 0.12 + 1e-9
    assert narrow.trajectory(1.0).extrema(0)[1][0] > 0.12


def test_without_any_good_duration_it_is_the_nearest():
    start, end = np.array([[0.0, 0.0], [5.0, 0.0]]), np.array([[1.0, 0.0], [0.0, 0.0]])
    motion = Hermite(start, end, limits(2.0, 8.0, 80.0), ("a", "b"))
    assert speed_ratio(motion.trajectory(), motion.limits) >= 2.4999
    assert motion.shortest > 0.0
