"""Rounded corners: smooth, near the path, within all limits, faster than stopping."""

import numpy as np
import pytest

from optiplan.model.robot import Limits
from optiplan.trajectory.blend import blend_path, time_blended
from optiplan.trajectory.timing import lower_bound, speed_ratio, stop_at_corners

CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.5, -0.2], [1.2, 1.5, 0.4], [0.1, 1.0, 1.0]])
NAMES = ("a", "b", "c")
WEIGHTLESS = None  # the robot is asked for its torques only where there are limits to them


def limits_with(jerk):
    wide = np.full(3, np.inf)
    return Limits(-wide, wide, np.array([2.0, 2.5, 1.5]), np.array([10.0, 15.0, 12.0]), np.full(3, jerk), wide)


@pytest.mark.parametrize("fractions", [[1.0, 1.0], [0.1, 0.7]])
def test_path_is_twice_continuously_differentiable(fractions):
    path = blend_path(CORNERS, np.array(fractions), limits_with(1e3), NAMES)
    for order in range(3):
        assert np.abs(path.jumps(order)).max() < 1e-9, order
    assert path.start == pytest.approx(CORNERS[0])
    assert path.end == pytest.approx(CORNERS[-1])


def test_path_leaves_a_corner_by_the_distance_documented():
    limits = limits_with(1e3)
    path = blend_path(CORNERS[:3], np.array([0.4]), limits, NAMES)
    length = np.linalg.norm(np.diff(CORNERS[:3], axis=0) / limits.velocity, axis=1)
    u, w = np.diff(CORNERS[:3], axis=0) / length[:, None]
    d = 0.4 * 0.5 * length.min()
    middle = path(np.array([length[0]]))[0]  # the blend is as long as the two legs that it replaces
    assert middle == pytest.approx(CORNERS[1] + 0.1875 * d * (w - u), abs=1e-12)


@pytest.mark.parametrize("jerk", [5000.0, 500.0, 100.0])
def test_timing_holds_every_limit_and_ends_at_rest(jerk):
    limits = limits_with(jerk)
    trajectory = time_blended(blend_path(CORNERS, np.ones(2), limits, NAMES), WEIGHTLESS, limits)
    assert speed_ratio(trajectory, limits) == pytest.approx(1.0, abs=1e-9)
    ends = np.array([0.0, trajectory.duration])
    assert trajectory(ends) == pytest.approx(CORNERS[[0, -1]], abs=1e-12)
    for order in (1, 2):
        assert np.abs(trajectory(ends, order)).max() < 1e-9
        assert np.abs(trajectory.jumps(order)).max() < 1e-6
    assert trajectory.duration < stop_at_corners(CORNERS, limits, NAMES).duration
    assert trajectory.duration > lower_bound(CORNERS[0], CORNERS[-1], limits)


def distance_to_curve(points, curve):
    return np.linalg.norm(points[:, None] - curve[None], axis=2).min(axis=1).max()


def test_gentleness_brings_the_motion_nearer_to_the_path():
    limits = limits_with(200.0)
    path = blend_path(CORNERS, np.ones(2), limits, NAMES)
    curve = path(np.linspace(0.0, path.duration, 4000))
    gaps = []
    for gentleness in (1.0, 0.5):
        trajectory = time_blended(path, WEIGHTLESS, limits, gentleness)
        gaps.append(distance_to_curve(trajectory(np.linspace(0.0, trajectory.duration, 300)), curve))
    assert gaps[1] < 0.3 * gaps[0] < 0.05


def test_it_is_nearly_as_fast_as_the_path_allows():
    """On a straight path the fastest motion is known: one S-curve."""
    limits = limits_with(5000.0)
    ends = np.array([[0.0, 0.0, 0.0], [0.5, 0.5, 0.5], [1.0, 1.0, 1.0]])
    trajectory = time_blended(blend_path(ends, np.ones(1), limits, NAMES), WEIGHTLESS, limits)
    assert trajectory.duration < 1.02 * stop_at_corners(ends[[0, 2]], limits, NAMES).duration
