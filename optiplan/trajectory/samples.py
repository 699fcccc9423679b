"""Samples of a motion for quantities without exact extrema: torques, and the speed of the tool."""

from itertools import pairwise

import numpy as np

from optiplan.arrays import Array
from optiplan.trajectory.trajectory import Trajectory

_STEP = 1e-3  # s, at most, between samples
_LEAST, _LEAST_IN_ALL = 5, 256  # samples in a piece; in a trajectory
_MOST = 20_000  # samples in all, but for the least: a long motion is slow, so what is looked for changes slowly


def sample_times(trajectory: Trajectory) -> Array:
    """Return times (k,), s, at most 1 ms apart (in motions of up to 20 s), at least 256 in all.

    Every polynomial piece has both of its ends, and at least three within. The end of a piece is just before it,
    because there the acceleration may jump.
    """
    step = max(_STEP, trajectory.duration / _MOST)
    least = max(_LEAST, _LEAST_IN_ALL // len(trajectory.coefficients))
    counts = [max(least, int(np.ceil((b - a) / step)) + 1) for a, b in pairwise(trajectory.breakpoints)]
    ends = zip(pairwise(trajectory.breakpoints), counts, strict=True)
    return np.concatenate([np.linspace(a, np.nextafter(b, a), count) for (a, b), count in ends])
