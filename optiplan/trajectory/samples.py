"""Samples of a motion for quantities without exact extrema: torques, and the speed of the tool."""

import numpy as np

from optiplan.arrays import Array, parts_of
from optiplan.trajectory.trajectory import Trajectory

_STEP = 1e-3  # s, at most, between samples
_LEAST, _LEAST_IN_ALL = 5, 256  # samples in a piece; in a trajectory
_MOST = 20_000  # samples in all, but for the least: a long motion is slow, so what is looked for changes slowly


def sample_times(trajectory: Trajectory) -> Array:
    """Return times (k,), s, at most 1 ms apart (in motions of up to 20 s), at least 256 in all.

    Every polynomial piece has both of its ends, and at least three within.
    """
    return samples_of_pieces(trajectory, _STEP, max(_LEAST, _LEAST_IN_ALL // len(trajectory.coefficients)))


def samples_of_pieces(trajectory: Trajectory, step: float, least: int, most: int = _MOST) -> Array:
    """Return times (k,), s, of every piece: `step` apart at most (in motions of up to `most` steps), `least` or more.

    The ends of a piece are among them. The second is just before it, because there the acceleration may jump.
    """
    edges, widths = trajectory.breakpoints, trajectory.widths
    step = max(step, trajectory.duration / most)
    counts = np.maximum(least, np.ceil(widths / step).astype(int) + 1)
    piece, place = parts_of(counts)
    t = edges[piece] + widths[piece] * (place / (counts - 1)[piece])
    return np.asarray(np.minimum(t, np.nextafter(edges[1:], edges[:-1])[piece]))
