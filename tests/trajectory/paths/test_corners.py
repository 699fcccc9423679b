from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from optiplan.robot.robot import Limits
from optiplan.trajectory.paths.corners import (
    BEZIER,
    BSPLINE,
    bezier_corners,
    blend_path,
    bspline_corners,
    reversals,
    through_corners,
)

NAMES = ("a", "b", "c")
ONES = np.ones(3)
LIMITS = Limits(-9 * ONES, 9 * ONES, np.array([1.0, 2.0, 0.7]), ONES, ONES, ONES)
curves = pytest.mark.parametrize(("curve", "factor"), [(bezier_corners, BEZIER), (bspline_corners, BSPLINE)])
CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.5, -0.2], [1.2, 1.5, 0.4], [0.1, 1.0, 1.0]])


def random_points(seed, count):
    points = np.random.default_rng(seed).uniform(-1, 1, (count, 3))
    while reversals(points, LIMITS).any():
        seed += 10**6
        points = np.random.default_rng(seed).uniform(-1, 1, (count, 3))
    return points


def off(path, waypoints):
    """Largest distance, in the largest joint, of 200 points of a path from finely sampled segments."""
    t = np.linspace(0.0, 1.0, 200)[:, None]
    line = np.concatenate([a + t * (b - a) for a, b in pairwise(waypoints)])
    Q = path(np.linspace(0.0, path.duration, 200))
    return max(np.abs(line - q).max(axis=1).min() for q in Q)


@curves
def test_deviation_of_one_corner_is_exact(curve, factor):
    """Legs of 1 s along two joints: |w - u| in the largest joint is the speed; half way the corner is missed by it."""
    waypoints = np.array([[0.0, 0, 0], [1, 0, 0], [1, 2, 0]])
    path = curve(waypoints, np.array([0.1]), LIMITS, NAMES)
    assert np.abs(path(np.array([1.0]))[0] - waypoints[1]).max() == pytest.approx(0.1, abs=1e-12)
    size = 0.1 / (factor * 2.0)
    assert size < 0.5
    sharp = path(np.array([1.0 - 1.01 * size, 1.0 - 0.9 * size]))
    assert sharp[0, 1] == pytest.approx(0.0, abs=1e-12)
    assert sharp[1, 1] > 1e-7


@curves
@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 6), st.floats(1e-3, 0.3))
def test_never_farther_off_than_stated(curve, factor, seed, count, deviation):
    waypoints = random_points(seed, count)
    path = curve(waypoints, np.full(count - 2, deviation), LIMITS, NAMES)
    assert off(path, waypoints) <= deviation + 5.1e-3  # the samples of the segments lie 10 mrad apart
    assert path.start == pytest.approx(waypoints[0], abs=1e-12)
    assert path.end == pytest.approx(waypoints[-1], abs=1e-9)
    for order in range(3):
        assert np.abs(path.jumps(order)).max(initial=0.0) < 1e-6 * (1.0 + np.abs(path.extrema(order)).max())


@curves
@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.integers(3, 6), st.floats(0.01, 0.3))
def test_vias_to_be_hit_are_hit_within_the_same_deviation(curve, factor, seed, count, deviation):
    waypoints = random_points(seed, count)
    hit = np.random.default_rng(seed).random(count) < 0.7
    corners, shares = through_corners(waypoints, hit, deviation, LIMITS)
    assert len(corners) == count + hit[1:-1].sum() == len(shares) + 2
    path = curve(corners, shares, LIMITS, NAMES)
    assert off(path, waypoints) <= deviation + 5.1e-3
    for via in waypoints[1:-1][hit[1:-1]]:
        assert np.abs(path(path.breakpoints) - via).max(axis=1).min() < 1e-9 or through_line(path, via) < 1e-9


def through_line(path, via):
    """Distance of a via from the straight pieces of a path."""
    c, h = path.coefficients, np.diff(path.breakpoints)
    straight = np.abs(c[:, 2:]).max(axis=(1, 2)) < 1e-9
    q, v = c[straight, 0], c[straight, 1]
    s = np.clip(((via - q) * v).sum(axis=1) / (v * v).sum(axis=1), 0.0, h[straight])
    return np.abs(q + s[:, None] * v - via).max(axis=1).min(initial=np.inf)


def test_the_bspline_runs_along_straight_segments_with_its_parameter():
    waypoints = np.array([[0.0, 0, 0], [1, 0, 0], [1, 2, 0]])
    path = bspline_corners(waypoints, np.array([0.01]), LIMITS, NAMES)
    s = np.linspace(0.0, 0.9, 50)
    assert path(s) == pytest.approx(np.outer(s, [1.0, 0.0, 0.0]), abs=1e-12)


def test_a_path_turns_back():
    waypoints = np.array([[0.0, 0, 0], [1, 0, 0], [0.2, 0.05, 0], [0.2, 1, 0]])
    assert reversals(waypoints, LIMITS).tolist() == [True, False]


@pytest.mark.parametrize("fractions", [[1.0, 1.0], [0.1, 0.7]])
def test_path_is_twice_continuously_differentiable(fractions):
    path = blend_path(CORNERS, np.array(fractions), LIMITS, NAMES)
    for order in range(3):
        assert np.abs(path.jumps(order)).max() < 1e-9, order
    assert path.start == pytest.approx(CORNERS[0])
    assert path.end == pytest.approx(CORNERS[-1])


def test_path_leaves_a_corner_by_the_distance_documented():
    path = blend_path(CORNERS[:3], np.array([0.4]), LIMITS, NAMES)
    length = np.linalg.norm(np.diff(CORNERS[:3], axis=0) / LIMITS.velocity, axis=1)
    u, w = np.diff(CORNERS[:3], axis=0) / length[:, None]
    d = 0.4 * 0.5 * length.min()
    middle = path(np.array([length[0]]))[0]  # the blend is as long as the two legs that it replaces
    assert middle == pytest.approx(CORNERS[1] + 0.1875 * d * (w - u), abs=1e-12)
