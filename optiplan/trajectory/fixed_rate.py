"""Samples for controllers with a fixed cycle, and the error of interpolating between them."""

from math import ceil, factorial

import numpy as np

from optiplan.arrays import Array, distinct
from optiplan.trajectory.from_samples import from_samples
from optiplan.trajectory.paths.hermite import hermite_trajectory
from optiplan.trajectory.tolerances import SAME_TIME
from optiplan.trajectory.trajectory import Trajectory


def on_cycle(trajectory: Trajectory, rate: float) -> Trajectory:
    """Return the motion slowed down by less than one cycle, so that it ends on a multiple of 1 / `rate`, Hz.

    The path stays the same and every derivative becomes smaller; torque lies between that of the motion and that of
    gravity alone, which may be more. The result needs a proof of its own.
    """
    cycles = max(1, ceil(trajectory.duration * rate * (1.0 - SAME_TIME)))
    return trajectory.scaled(cycles / rate)


def interpolation_errors(trajectory: Trajectory, t: Array) -> dict[str, Array]:
    """Return the largest deviation of each joint, over all time, of a controller's interpolation from the motion.

    Exact: the extrema of the difference of two piecewise polynomials.

    Args:
        trajectory: q(t) of n joints.
        t: (k,) times of the samples, s, from 0 to the duration.

    Returns:
        (n,) in rad or m, for `linear` (straight lines between positions), `cubic` (from positions and velocities) and
        `quintic` (accelerations too).
    """
    q, v, a = (trajectory(t, order) for order in range(3))
    h = np.diff(t)
    lines = np.stack([q[:-1], np.diff(q, axis=0) / h[:, None]], axis=1)
    names = trajectory.joint_names
    played = {
        "linear": Trajectory(names, t, lines),
        "cubic": hermite_trajectory(names, t, np.stack([q, v], axis=1)),
        "quintic": from_samples(names, t, q, v, a),
    }
    return {key: np.abs(difference(motion, trajectory).extrema(0)).max(axis=0) for key, motion in played.items()}


def difference(a: Trajectory, b: Trajectory) -> Trajectory:
    """Return a - b, motions of the same joints and duration, on the breakpoints of both."""
    merged = distinct(np.append(a.breakpoints, b.breakpoints[:-1]))
    apart = np.diff(merged, prepend=-np.inf) > SAME_TIME * a.duration
    breakpoints = merged[apart]
    size = max(a.coefficients.shape[1], b.coefficients.shape[1])
    begins = breakpoints[:-1] + 0.5 * SAME_TIME * a.duration  # not on the piece before, where breakpoints were merged
    taylor = [(a(begins, k) - b(begins, k)) / factorial(k) for k in range(size)]
    return Trajectory(a.joint_names, breakpoints, np.stack(taylor, axis=1))
