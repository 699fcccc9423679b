"""Scale motions in time until they keep their limits: a whole curve, or the times of its points."""

from collections.abc import Callable

import numpy as np

from optiplan.arrays import Array
from optiplan.records import dataclass
from optiplan.robot.limits import Limits
from optiplan.trajectory.trajectory import Trajectory

_FIRST, _RATIO, _MOST = 1.0 / 16.0, 1.25, 1e4
_HALVINGS = 24


def speed_ratio(trajectory: Trajectory, limits: Limits) -> float:
    """Return the factor by which a trajectory must be slowed down (> 1) or may be sped up (< 1) to touch its limits.

    It is the maximum over joints of v / v_max, sqrt(a / a_max) and cbrt(j / j_max), with the exact extrema v, a, j over
    all time. Stretching time by s divides these extrema by s, s^2 and s^3.
    """
    peaks = [np.abs(trajectory.extrema(order)).max(axis=0) / limits.rates[order - 1] for order in (1, 2, 3)]
    return float(max(peaks[0].max(), np.sqrt(peaks[1].max()), np.cbrt(peaks[2].max())))


def scale_to_limits(trajectory: Trajectory, limits: Limits, least: float = 0.0) -> Trajectory:
    """Scale a curve uniformly in time until its tightest limit is just met (all time).

    `least` is a lower bound on the factor on the duration.
    """
    ratio = max(speed_ratio(trajectory, limits), least)
    return trajectory if ratio == 0.0 else trajectory.scaled(trajectory.duration * ratio * (1.0 + 1e-12))


@dataclass(frozen=True, eq=False)
class FreeTimes:
    """Times of points. All may be stretched, or only those after the last via if the vias have given times.

    Attributes:
        base: (k,) increasing from 0, s.
        given: whether all but the last are.
    """

    base: Array
    given: bool

    @classmethod
    def of(cls, vias: Array, base: Array) -> "FreeTimes":
        """Those given at the vias (k - 2,), or none; base times (k,) stand for what is not given."""
        if not len(vias):
            return cls(base, False)
        return cls(np.concatenate([[0.0], vias, [vias[-1] + base[-1] - base[-2]]]), True)

    def at(self, factor: float) -> Array:
        """Return the times (k,) with the free ones stretched by the factor."""
        begin = self._begin
        return np.asarray(np.where(self.base > begin, begin + factor * (self.base - begin), self.base))

    def factor(self, duration: float) -> float:
        """The factor with which the last time is `duration`, s."""
        return float((duration - self._begin) / (self.base[-1] - self._begin))

    @property
    def _begin(self) -> float:
        return float(self.base[-2]) if self.given else 0.0


def least_stretch(good: Callable[[float], bool]) -> float | None:
    """Return the first good factor >= 1/16, found in steps of 25 % and then by bisection; None when none up to 1e4 is.

    Longer times need not be good as well: a velocity kept at a via for long is a long way.
    """
    low = high = _FIRST
    while not good(high):
        low, high = high, high * _RATIO
        if high > _MOST:
            return None
    for _ in range(_HALVINGS if high > low else 0):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if good(middle) else (middle, high)
    return high
