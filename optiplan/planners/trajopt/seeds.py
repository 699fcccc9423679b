"""Curves to start from."""

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.trajopt.spline import SplineBasis

_POINTS = 200
_RAMP = 0.2  # share of the time for speeding up, and for slowing down


def along_path(basis: SplineBasis, waypoints: Array, velocity: Array) -> Array:
    """Control points (K, n) of a spline near the straight segments between waypoints (k, n), at rest at both ends.

    The path is measured in time at full joint speed, sum of max_j |dq_j| / velocity_j, and run through with constant
    acceleration, constant speed and constant deceleration.
    """
    length = np.concatenate([[0.0], np.cumsum((np.abs(np.diff(waypoints, axis=0)) / velocity).max(axis=1))])
    u = np.linspace(0.0, 1.0, _POINTS)
    speed = np.minimum(1.0, np.minimum(u, 1.0 - u) / _RAMP)
    travelled = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))])
    places = travelled * length[-1] / travelled[-1]
    points = np.column_stack([np.interp(places, length, column) for column in waypoints.T])
    return basis.fit(u, points)
