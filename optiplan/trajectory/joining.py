"""Motions one after another, and a motion that stands still."""

from collections.abc import Sequence

import numpy as np

from optiplan.arrays import Array
from optiplan.trajectory.trajectory import Trajectory


def join_trajectories(parts: Sequence[Trajectory]) -> Trajectory:
    """Concatenate motions; each begins where the one before ends. Segments are left out."""
    size = max(part.coefficients.shape[1] for part in parts)
    padded = [np.pad(part.coefficients, ((0, 0), (0, size - part.coefficients.shape[1]), (0, 0))) for part in parts]
    begins = np.concatenate([[0.0], np.cumsum([part.duration for part in parts])])
    breakpoints = [part.breakpoints[1:] + begin for part, begin in zip(parts, begins, strict=False)]
    return Trajectory(parts[0].joint_names, np.concatenate([[0.0], *breakpoints]), np.concatenate(padded))


def standstill(joint_names: tuple[str, ...], q: Array, seconds: float) -> Trajectory:
    """Return the motion of joints that stay at q (n,)."""
    return Trajectory(joint_names, np.array([0.0, seconds]), q[None, None])
