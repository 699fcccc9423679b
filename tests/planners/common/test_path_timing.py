"""Paths of straight segments in time, with rounded corners."""

import numpy as np
import pytest

from optiplan.collision.model import CollisionModel
from optiplan.geometry.scene import Scene
from optiplan.planners.base import Budget
from optiplan.planners.common.path_timing import timed_path
from optiplan.robot.robot import load_robot


@pytest.mark.parametrize("step", [1e-300, 1e-14, 1e-12, 1e-10])
def test_points_side_by_side_are_one_corner(step: float) -> None:
    """Between two of them no corner can be rounded: the velocity jumped there, or the arm nearly stopped."""
    robot = load_robot("ur5")
    model, limits = CollisionModel(robot, Scene(())), robot.limits
    a = np.array([0.0, -1.2, 1.2, 0.0, 0.5, 0.0])
    b, c = a + np.array([[0.5, 0.2, 0.2, 0.3, 0.5, 0.2], [1.5, -0.2, 0.4, 0.3, 0.5, 1.0]])
    beside = step * np.array([1.0, -1.0, 0.0, 0.0, 1.0, 0.0])
    plain = timed_path(model, np.array([a, b, c]), limits, Budget(20.0))
    motion = timed_path(model, np.array([a, a + beside, b, b + beside, c, c + beside]), limits, Budget(20.0))
    assert plain is not None
    assert motion is not None
    assert motion.duration == pytest.approx(plain.duration, rel=1e-3)
    assert np.abs(motion.jumps(1)).max() < 1e-9
    assert motion.end == pytest.approx(c + beside, abs=1e-15)
    there = timed_path(model, np.array([a * 0.0, beside]), limits, Budget(20.0))
    assert there is not None
    assert there.end == pytest.approx(beside, abs=1e-15)
