"""Rounded corners: smooth, and near their corner."""

import numpy as np
import pytest

from optiplan.robot.robot import Limits
from optiplan.trajectory.paths.corner_blends import blend_path

CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.5, -0.2], [1.2, 1.5, 0.4], [0.1, 1.0, 1.0]])
NAMES = ("a", "b", "c")


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
