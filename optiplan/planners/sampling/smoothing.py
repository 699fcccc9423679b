"""Smooth a path of straight segments by a B-spline whose control points lie on the path."""

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.sampling.shortcutting import costs_along
from optiplan.trajectory.trajectory import Trajectory

DEGREE = 5  # the curve's third derivative is continuous, so that jerk can be limited along it
SPANS = (4, 8, 16, 32, 64, 128)  # few are smooth, many follow the path closely


def smooth_path(model: CollisionModel, waypoints: Array, velocity: Array, budget: Budget) -> Trajectory | None:
    """Return the smoothest B-spline that is proved free, over a path parameter in s; None if none is.

    Control point i is the path's point at the Greville abscissa (t_{i+1} + … + t_{i+d}) / d of its knots. So straight
    stretches are kept, and the spline cuts corners within the convex hull of d + 1 neighbouring points. This is
    Schoenberg's variation-diminishing approximation (de Boor, A Practical Guide to Splines, ch. XI).

    Args:
        model: of the robot in its scene.
        waypoints: (k, n), rad or m.
        velocity: (n,) limits, which measure the path's parameter (`shortcutting.path_time`).
        budget: once it is over, None is returned.
    """
    along = costs_along(waypoints, velocity)
    if along[-1] == 0.0:
        return None
    for spans in SPANS:
        if budget.over:
            return None
        path = spline_along(model.robot.joint_names, along, waypoints, spans)
        if first_contact(model, path, lambda: budget.over) is None:
            return path
    return None


def spline_along(joint_names: tuple[str, ...], along: Array, waypoints: Array, spans: int) -> Trajectory:
    """Return the spline near waypoints (k, n) at parameters `along` (k,), on equal spans of [0, along[-1]]."""
    inner = np.linspace(0.0, along[-1], spans + 1)
    knots = np.concatenate([np.zeros(DEGREE), inner, np.full(DEGREE, along[-1])])
    greville = np.convolve(knots[1:-1], np.full(DEGREE, 1.0 / DEGREE), mode="valid")
    greville[[0, -1]] = along[[0, -1]]
    control = np.column_stack([np.interp(greville, along, q) for q in waypoints.T])
    return Trajectory.from_bspline(joint_names, knots, control, DEGREE)
