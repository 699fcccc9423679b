"""Lower bounds of the duration of a motion from rest to rest: each joint's own fastest S-curve."""

import numpy as np

from optiplan.arrays import Array
from optiplan.robot.limits import Limits
from optiplan.trajectory.timing.s_curve import phases


def lower_bounds(start: Array, goals: Array, limits: Limits) -> Array:
    """Shortest duration conceivable from `start` to each goal, obstacles and position limits ignored.

    The slowest joint's own minimum time from rest to rest; no trajectory of the robot is shorter.

    Args:
        start: (n,) rad or m.
        goals: (k, n) rad or m.
        limits: of the n joints.

    Returns:
        (k,) in s.
    """
    times: Array = joint_times(np.abs(goals - start), limits).max(axis=1)
    return times


def joint_times(distances: Array, limits: Limits) -> Array:
    """Shortest time from rest to rest, s, of each joint over distances (k, n) >= 0, rad or m: (k, n)."""
    t_j, t_a, t_v = phases(distances, *limits.rates)
    return np.where(distances == 0.0, 0.0, 4.0 * t_j + 2.0 * t_a + t_v)


def lower_bound(start: Array, goal: Array, limits: Limits) -> float:
    """Return the bound of one goal of shape (n,): a duration in s, the denominator of `duration / lower_bound`."""
    return float(lower_bounds(start, goal[None], limits)[0])
