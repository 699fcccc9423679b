"""Paths to be timed, with limits."""

import numpy as np

from optiplan.robot.robot import Limits
from optiplan.trajectory.paths.corners import blend_path
from optiplan.trajectory.trajectory import Trajectory

CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.5, -0.2], [1.2, 1.5, 0.4], [0.1, 1.0, 1.0]])
NAMES = ("a", "b", "c")


def limits_of(jerk: float) -> Limits:
    """Limits of three joints, without torque."""
    wide = np.full(3, np.inf)
    return Limits(-wide, wide, np.array([2.0, 2.5, 1.5]), np.array([10.0, 15.0, 12.0]), np.full(3, jerk), wide)


def rounded(fractions: tuple[float, float] = (1.0, 1.0)) -> Trajectory:
    """Through CORNERS with rounded corners."""
    return blend_path(CORNERS, np.array(fractions), limits_of(1e3), NAMES)


def straight() -> Trajectory:
    """From the first of CORNERS to the second, at a constant slope."""
    return Trajectory(NAMES, np.array([0.0, 2.0]), np.stack([CORNERS[0], 0.5 * (CORNERS[1] - CORNERS[0])])[None])


def wave() -> Trajectory:
    """A closed figure as a cubic spline, twice continuously differentiable, its parameter no length at all."""
    u = np.linspace(0.0, 1.0, 60)
    points = np.column_stack([np.sin(2.0 * np.pi * u), 0.6 * np.sin(4.0 * np.pi * u), u * (1.0 - u)])
    knots = np.concatenate([np.zeros(3), np.linspace(0.0, 7.0, 58), np.full(3, 7.0)])
    return Trajectory.from_bspline(NAMES, knots, points, 3)


PATHS = {"rounded": rounded(), "sharp": rounded((0.05, 0.4)), "straight": straight(), "wave": wave()}
