import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from optiplan.robot.robot import Limits
from optiplan.trajectory.paths.via_splines import (
    continuous_jerk,
    evened_times,
    heuristic_velocities,
    knot_times,
    smooth_spline,
    spline_of_velocities,
)
from optiplan.trajectory.timing.time_scaling import scale_to_limits

NAMES = ("a", "b")
ONES = np.ones(2)
LIMITS = Limits(-9 * ONES, 9 * ONES, 2 * ONES, 5 * ONES, 40 * ONES, ONES)

seeds = st.integers(0, 10**6)
counts = st.integers(2, 7)


def points_and_times(seed, count):
    rng = np.random.default_rng(seed)
    return rng.uniform(-2, 2, (count, 2)), np.concatenate([[0.0], np.cumsum(rng.uniform(0.2, 2.0, count - 1))])


def jumps(trajectory, order):
    return np.abs(trajectory.jumps(order)).max(initial=0.0)


def scale(trajectory, order):
    low, high = trajectory.extrema(order)
    return 1.0 + np.maximum(-low, high).max()


@settings(max_examples=15, deadline=None)
@given(seeds, counts, st.sampled_from([(3, False), (3, True), (5, True)]))
def test_smooth_splines_hit_every_point_at_rest_as_smoothly_as_they_say(seed, count, kind):
    degree, still = kind
    points, times = points_and_times(seed, count)
    trajectory = smooth_spline(points, times, degree, NAMES, still)
    assert trajectory(times) == pytest.approx(points, abs=1e-9)
    ends = times[[0, -1]]
    assert np.abs(trajectory(ends, 1)).max() < 1e-8 * scale(trajectory, 1)
    if still:
        assert np.abs(trajectory(ends, 2)).max() < 1e-8 * scale(trajectory, 2)
    for order in range(degree):
        assert jumps(trajectory, order) < 1e-8 * scale(trajectory, order)


@settings(max_examples=15, deadline=None)
@given(seeds, st.integers(3, 7))
def test_cubic_velocities_solve_the_equation_of_three_diagonals(seed, count):
    """The formula of `smooth_spline`'s docstring, at every inner point of the clamped cubic spline."""
    points, times = points_and_times(seed, count)
    v, h, d = smooth_spline(points, times, 3, NAMES, False)(times, 1), np.diff(times)[:, None], np.diff(points, axis=0)
    left = h[1:] * v[:-2] + 2.0 * (h[:-1] + h[1:]) * v[1:-1] + h[:-1] * v[2:]
    right = 3.0 * (h[1:] * d[:-1] / h[:-1] + h[:-1] * d[1:] / h[1:])
    assert left == pytest.approx(right, abs=1e-8 * (1.0 + np.abs(right).max()))


@settings(max_examples=15, deadline=None)
@given(seeds, counts, st.sampled_from([3, 5]))
def test_splines_have_the_velocities_given(seed, count, degree):
    points, times = points_and_times(seed, count)
    velocities = np.random.default_rng(seed + 1).normal(size=points.shape)
    trajectory = spline_of_velocities(points, times, velocities, degree, NAMES)
    assert trajectory(times) == pytest.approx(points, abs=1e-9)
    assert trajectory(times, 1) == pytest.approx(velocities, abs=1e-8)
    for order in range(2 if degree == 3 else 4):
        assert jumps(trajectory, order) < 1e-8 * scale(trajectory, order)


@settings(max_examples=20, deadline=None)
@given(seeds, st.integers(3, 6))
def test_accelerations_solve_the_equation_of_continuous_jerk(seed, count):
    points, times = points_and_times(seed, count)
    v, h, d = np.random.default_rng(seed).normal(size=points.shape), np.diff(times)[:, None], np.diff(points, axis=0)
    a = continuous_jerk(points, times, v)
    assert np.array_equal(a[[0, -1]], np.zeros((2, 2)))
    left = 3 * a[:-2] / h[:-1] - 9 * (1 / h[:-1] + 1 / h[1:]) * a[1:-1] + 3 * a[2:] / h[1:]
    right = 60 * (d[:-1] / h[:-1] ** 3 - d[1:] / h[1:] ** 3) - (24 * v[:-2] + 36 * v[1:-1]) / h[:-1] ** 2
    right += (36 * v[1:-1] + 24 * v[2:]) / h[1:] ** 2
    assert left == pytest.approx(right, abs=1e-9 * (1.0 + np.abs(right).max()))


def test_heuristic_velocities_are_zero_where_a_joint_turns_round():
    """Biagiotti and Melchiorri, (4.9): points 10, 20, 0, 30, 40 at 0, 2, 4, 8, 10 s, worked out by hand."""
    points, times = np.array([[10.0], [20.0], [0.0], [30.0], [40.0]]), np.array([0.0, 2.0, 4.0, 8.0, 10.0])
    assert heuristic_velocities(points, times).ravel().tolist() == [0.0, 0.0, 0.0, 6.25, 0.0]


@settings(max_examples=15, deadline=None)
@given(seeds, counts)
def test_heuristic_cubics_never_overshoot_where_they_turn(seed, count):
    """Extrema of the motion are those of the points when slopes differ by no more than a factor of three."""
    points, times = points_and_times(seed, count)
    times = np.arange(count, dtype=float)
    points = np.cumsum(np.where(points > 0.0, 1.0, -1.0) * np.random.default_rng(seed).uniform(1, 3, points.shape), 0)
    trajectory = spline_of_velocities(points, times, heuristic_velocities(points, times), 3, NAMES)
    low, high = trajectory.extrema(0)
    assert low == pytest.approx(points.min(axis=0), abs=1e-9)
    assert high == pytest.approx(points.max(axis=0), abs=1e-9)


def test_knot_times_give_each_segment_what_its_slowest_limit_asks():
    points = np.array([[0.0, 0.0], [3.0, 0.1], [3.0, 0.1001]])
    h = np.diff(knot_times(points, LIMITS))
    assert h == pytest.approx([1.5, np.cbrt(1e-4 / 40.0)])


@pytest.mark.parametrize("degree", [3, 5])
@pytest.mark.parametrize("seed", range(4))
def test_evened_times_make_it_no_slower(seed, degree):
    points, _ = points_and_times(seed, 6)
    before = knot_times(points, LIMITS)
    after = evened_times(points, before, LIMITS, degree)
    slow, fast = (scale_to_limits(smooth_spline(points, t, degree, NAMES), LIMITS).duration for t in (before, after))
    assert fast <= slow * (1.0 + 1e-9)
    assert degree == 5 or fast < 0.97 * slow  # these four cubic ones have something to gain
