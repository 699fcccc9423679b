"""Straight joint-space segments with a stop at every corner."""

from collections.abc import Sequence

import numpy as np

from optiplan.arrays import Array
from optiplan.robot.limits import Limits
from optiplan.trajectory.timing.s_curve import s_curve
from optiplan.trajectory.tolerances import SHORTEST_DURATION
from optiplan.trajectory.trajectory import Trajectory

_NO_STEP = 1e-100  # rad or m: quotients of limits and smaller steps overflow


def stop_at_corners(waypoints: Array, limits: Limits, joint_names: Sequence[str]) -> Trajectory:
    """Straight joint-space segments, each from rest to rest in the shortest time, in exact cubic pieces.

    Along a segment of direction d = q_b - q_a the one coordinate s from 0 to 1 has the bounds
    min_j limit_j / |d_j| of velocity, acceleration and jerk.

    Args:
        waypoints: (k, n), rad or m; neighbours that are equal, to 1e-100, are passed over. When none differ, the robot
            rests for 1 ms.
        limits: of the n joints.
        joint_names: of the n joints.
    """
    steps = np.diff(waypoints, axis=0)
    durations, coefficients = [], []
    for q, d in zip(waypoints[:-1], steps, strict=True):
        if np.any(np.abs(d) > _NO_STEP):
            times, pieces = _segment(q, d, limits)
            durations.append(times)
            coefficients.append(pieces)
    if not durations:
        return Trajectory(tuple(joint_names), np.array([0.0, SHORTEST_DURATION]), waypoints[:1, None])
    breakpoints = np.concatenate([[0.0], np.cumsum(np.concatenate(durations))])
    return Trajectory(tuple(joint_names), breakpoints, np.concatenate(coefficients))


def _segment(q: Array, d: Array, limits: Limits) -> tuple[Array, Array]:
    """Durations (m,) and cubic coefficients (m, 4, n) of the fastest rest-to-rest motion from q to q + d."""
    moving = np.abs(d) > _NO_STEP
    size = np.abs(d[moving])
    velocity, acceleration, jerk = (float(np.min(bound[moving] / size)) for bound in limits.rates)
    times, scalar = s_curve(1.0, velocity, acceleration, jerk)
    pieces = scalar[:, :, None] * d
    pieces[:, 0] += q
    return times, pieces
