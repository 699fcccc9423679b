"""A part of a motion."""

import numpy as np

from optiplan.trajectory.timing.compose import shifted
from optiplan.trajectory.trajectory import SAME_TIME, Trajectory


def cut(trajectory: Trajectory, begin: float, end: float) -> Trajectory:
    """Return the motion between two times, s; its own time starts at 0, and its segments are left out.

    Breakpoints nearer to its ends than the share `SAME_TIME` of the duration fall on them.

    Raises:
        ValueError: the part is empty.
    """
    near = SAME_TIME * trajectory.duration
    if not end - begin > 2.0 * near:
        raise ValueError(f"found a part from {begin} to {end} s; expected an end after the beginning")
    own = trajectory.breakpoints
    inner = own[(own > begin + near) & (own < end - near)]
    t = np.concatenate([[begin], inner, [end]])
    piece = np.searchsorted(own[1:-1], 0.5 * (t[:-1] + t[1:]), side="right")
    coefficients = shifted(trajectory.coefficients[piece], t[:-1] - own[piece])
    return Trajectory(trajectory.joint_names, t - begin, coefficients)
