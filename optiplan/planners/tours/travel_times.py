"""Times of straight joint motions from rest to rest, between many configurations at once."""

import numpy as np

from optiplan.arrays import Array
from optiplan.robot.limits import Limits
from optiplan.trajectory.timing.s_curve import phases

_NONE = 1e-30
"""Stands for no distance, so that the formulas need no branch."""


class TravelTimes:
    """Least durations of straight motions within limits of velocity, acceleration and jerk.

    On a straight line all joints share one law s(t) from 0 to 1. A joint that moves by d_j leaves it |ds/dt| <= v_j /
    |d_j|, and so on, so that with the largest ratio of each kind,

        r_v = max_j |d_j| / v_j,   r_a = max_j |d_j| / a_j,   r_j = max_j |d_j| / j_j,

    the time is that of an S-curve over the distance 1 within 1 / r_v, 1 / r_a and 1 / r_j; without limits of jerk it is
    2 sqrt(r_a) where r_v² <= r_a, else r_v + r_a / r_v. Where one joint has all three ratios, no motion is shorter.
    """

    def __init__(self, limits: Limits) -> None:
        self._slowness = [1.0 / limits.velocity, 1.0 / limits.acceleration]
        if np.isfinite(limits.jerk).any():
            self._slowness.append(1.0 / limits.jerk)

    def between(self, A: Array, B: Array) -> Array:
        """Return the times (m, k), s, from each of A (m, n) to each of B (k, n), rad or m."""
        ratios = [np.zeros((len(A), len(B))) for _ in self._slowness]
        for j in range(A.shape[1]):
            distance = np.abs(A[:, j, None] - B[None, :, j])
            for ratio, slowness in zip(ratios, self._slowness, strict=True):
                np.maximum(ratio, distance * slowness[j], out=ratio)
        return self._seconds(ratios)

    def along(self, Q: Array) -> Array:
        """Return the times (m - 1,), s, from each of the configurations Q (m, n) to the next."""
        distance = np.abs(np.diff(Q, axis=0))
        return self._seconds([(distance * slowness).max(axis=1, initial=0.0) for slowness in self._slowness])

    def _seconds(self, ratios: list[Array]) -> Array:
        r_v, r_a = (np.maximum(ratio, _NONE) for ratio in ratios[:2])
        if len(ratios) == 2:
            times = np.where(r_v * r_v <= r_a, 2.0 * np.sqrt(r_a), r_v + r_a / r_v)
        else:
            with np.errstate(divide="ignore"):
                times = phases(np.ones_like(r_v), 1.0 / r_v, 1.0 / r_a, 1.0 / ratios[2]).total
        return np.where(ratios[0] == 0.0, 0.0, times)
