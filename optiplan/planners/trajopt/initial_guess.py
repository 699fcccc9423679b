"""Initial guesses of the optimiser."""

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.trajopt.bspline_basis import SplineBasis
from optiplan.robot.robot import Limits

_POINTS = 200
_RAMP = 0.2  # share of the time for acceleration, and for deceleration
_BUMP = 0.15  # amplitude: share of the motion's time at full joint speed
_WIDTHS = 0.15, 0.5  # half widths of bumps, in shares of the motion


def along_path(basis: SplineBasis, waypoints: Array, velocity: Array) -> Array:
    """Return control points (K, n) of a spline near straight segments between waypoints (k, n), at rest at both ends.

    The length of the path is its time at full joint speed, the sum of max_j |dq_j| / velocity_j. The motion along it
    has constant acceleration, constant speed and constant deceleration.
    """
    length = np.concatenate([[0.0], np.cumsum((np.abs(np.diff(waypoints, axis=0)) / velocity).max(axis=1))])
    u = np.linspace(0.0, 1.0, _POINTS)
    speed = np.minimum(1.0, np.minimum(u, 1.0 - u) / _RAMP)
    travelled = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))])
    places = travelled * length[-1] / travelled[-1]
    points = np.column_stack([np.interp(places, length, column) for column in waypoints.T])
    return basis.fit(u, points)


def with_bump(basis: SplineBasis, control: Array, duration: float, limits: Limits, rng: np.random.Generator) -> Array:
    """Return the curve with a random smooth bump: a seed away from a local optimum, perhaps beyond an obstacle.

    Control points (K, n) at places u along the curve move by cos²(pi (u - m) / 2 w) v_j r_j within w of m. The middle
    m, the half width w and the amplitudes r_j are random; r_j is normal, of 15 % of the curve's `duration` (s).
    """
    place = np.convolve(basis.knots[1:-1], np.full(4, 0.25), mode="valid")[: len(control)]
    middle, width = rng.uniform(0.1, 0.9), rng.uniform(*_WIDTHS)
    window = np.where(np.abs(place - middle) < width, np.cos(0.5 * np.pi * (place - middle) / width) ** 2, 0.0)
    height = _BUMP * duration * limits.velocity * rng.standard_normal(control.shape[1])
    moved = control.copy()
    moved[basis.free] += window[basis.free, None] * height
    return np.clip(moved, limits.lower, limits.upper)
