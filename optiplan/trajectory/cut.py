"""A part of a motion, and a motion with more pieces."""

import numpy as np

from optiplan.arrays import Array
from optiplan.trajectory.timing.compose import shifted
from optiplan.trajectory.trajectory import Trajectory


def cut_trajectory(trajectory: Trajectory, begin: float, end: float) -> Trajectory:
    """Return the motion between two times, s; its own time starts at 0, and its segments are left out.

    Exact however short the part is: no breakpoint is moved.

    Raises:
        ValueError: the part is empty.
    """
    if not end > begin:
        raise ValueError(f"found a part from {begin} to {end} s; expected an end after the beginning")
    own = trajectory.breakpoints
    t = np.concatenate([[begin], own[(own > begin) & (own < end)], [end]])
    return Trajectory(trajectory.joint_names, t - begin, coefficients_between(trajectory, t))


def coefficients_between(trajectory: Trajectory, t: Array) -> Array:
    """Return the coefficients (k, degree + 1, n) of a motion on pieces from t_i to t_{i+1}; t (k + 1,), s.

    Every breakpoint of the motion between the first and the last time must be among them.
    """
    own = trajectory.breakpoints
    piece = np.searchsorted(own[1:-1], t[:-1], side="right")
    return shifted(trajectory.coefficients[piece], t[:-1] - own[piece])
