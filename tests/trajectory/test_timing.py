"""Timing: the bound against Ruckig, straight lines with stops against the bound, scaling against exact extrema."""

import numpy as np
import pytest
import ruckig

from optiplan.robot.robot import Limits
from optiplan.trajectory.timing.lower_bound import lower_bound, lower_bounds
from optiplan.trajectory.timing.stops import stop_at_corners
from optiplan.trajectory.timing.time_scaling import scale_to_limits, speed_ratio


def limits_of(velocity, acceleration, jerk):
    wide = np.full(len(velocity), np.inf)
    return Limits(-wide, wide, np.array(velocity), np.array(acceleration), np.array(jerk), wide)


def ruckig_duration(distance, velocity, acceleration, jerk):
    request = ruckig.InputParameter(1)
    request.current_position, request.target_position = [0.0], [distance]
    request.max_velocity, request.max_acceleration, request.max_jerk = [velocity], [acceleration], [jerk]
    answer = ruckig.Trajectory(1)
    ruckig.Ruckig(1).calculate(request, answer)
    return answer.duration


def test_lower_bound_is_ruckigs_in_every_regime():
    rng = np.random.default_rng(1)
    for _ in range(300):
        v, a, j = (float(x) for x in 10.0 ** rng.uniform([-1, -1, 0], [1, 1, 2]))
        d = float(10.0 ** rng.uniform(-4, 1))
        ours = lower_bound(np.zeros(1), np.array([-d]), limits_of([v], [a], [j]))
        assert ours == pytest.approx(ruckig_duration(d, v, a, j), rel=1e-9)


def test_lower_bounds_takes_the_slowest_joint_of_each_goal():
    limits = limits_of([1.0, 0.1], [5.0, 5.0], [50.0, 50.0])
    bounds = lower_bounds(np.zeros(2), np.array([[1.0, 0.0], [1.0, 1.0], [0.0, 0.0]]), limits)
    expected = [ruckig_duration(1.0, 1.0, 5.0, 50.0), ruckig_duration(1.0, 0.1, 5.0, 50.0), 0.0]
    assert bounds == pytest.approx(expected, abs=1e-12)
    assert bounds[2] == 0.0


def test_a_straight_line_takes_exactly_the_bound_of_its_slowest_joint():
    limits = limits_of([1.0, 2.0, 1.5], [4.0, 9.0, 3.0], [30.0, 90.0, 40.0])
    goal = np.array([1.0, -0.2, 0.3])
    trajectory = stop_at_corners(np.stack([np.zeros(3), goal]), limits, "abc")
    assert trajectory.duration == pytest.approx(lower_bound(np.zeros(3), goal, limits), rel=1e-12)
    assert speed_ratio(trajectory, limits) == pytest.approx(1.0, rel=1e-9)


def test_corners_are_straight_lines_with_stops():
    limits = limits_of([1.0, 2.0], [4.0, 9.0], [30.0, 90.0])
    corners = np.array([[0.0, 0.0], [1.0, 0.5], [1.0, 0.5], [0.2, 0.5001]])
    trajectory = stop_at_corners(corners, limits, "ab")
    t = np.linspace(0.0, trajectory.duration, 2001)
    q = trajectory(t, 0)
    off_line = np.minimum(abs(q[:, 1] - 0.5 * q[:, 0]), abs(q[:, 1] - 0.5 - 1e-4 * (1.0 - q[:, 0]) / 0.8))
    assert off_line.max() < 1e-12
    assert q[[0, -1]] == pytest.approx(corners[[0, -1]], abs=1e-12)
    assert np.abs(trajectory(np.array([0.0, trajectory.duration]), 1)).max() < 1e-12
    assert speed_ratio(trajectory, limits) <= 1.0 + 1e-9
    stop = np.argmin(np.abs(q - corners[1]).max(axis=1))
    assert np.abs(trajectory(t[stop : stop + 1], 1)).max() < 0.05


def test_going_nowhere_is_a_short_rest():
    trajectory = stop_at_corners(np.ones((2, 2)), limits_of([1, 1], [1, 1], [1, 1]), "ab")
    assert trajectory(np.array([0.0, trajectory.duration]), 0) == pytest.approx(np.ones((2, 2)))


@pytest.mark.parametrize("factor", [0.2, 5.0])
def test_scaling_just_meets_the_tightest_limit(factor):
    limits = limits_of([1.0, 2.0], [4.0, 9.0], [30.0, 90.0])
    fast = stop_at_corners(np.array([[0.0, 0.0], [1.0, 0.5], [0.0, 1.0]]), limits, "ab")
    scaled = scale_to_limits(fast.scaled(fast.duration * factor), limits)
    assert scaled.duration == pytest.approx(fast.duration, rel=1e-9)
    assert speed_ratio(scaled, limits) <= 1.0 + 1e-12
