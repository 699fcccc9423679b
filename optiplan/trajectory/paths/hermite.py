"""One polynomial a joint between any two states: cubic (velocities), quintic (+ accelerations), septic (+ jerks)."""

from functools import cached_property
from math import comb, factorial

import numpy as np

from optiplan.arrays import Array
from optiplan.records import dataclass
from optiplan.robot.robot import Limits
from optiplan.trajectory import polynomial
from optiplan.trajectory.tolerances import LIMIT_ROUNDING
from optiplan.trajectory.trajectory import Trajectory

_RANGE = 1e3  # factor on the characteristic time, either way, within which durations are searched
_GRID = 400  # durations in that range
_SAMPLES = 257  # of a motion, for its largest share of a limit
_HALVINGS = 40  # of the interval of durations, at the end


def hermite(start: Array, end: Array, T: Array) -> Array:
    """Return coefficients of the polynomials of degree 2k - 1 that join two states in the times T.

    With tau = t / T, q = sum_j c_j tau^j. For j < k, c_j = x_j T^j / j!. The others solve, for i < k,

        sum_{j>=k} C(j, i) c_j = y_i T^i / i! - sum_{j<k} C(j, i) c_j,

    whose matrix has an inverse in whole numbers. For k = 2 these are the lecture's
    a_2 = (3 (y_0 - x_0) - (2 x_1 + y_1) T) / T^2 and a_3 = (2 (x_0 - y_0) + (x_1 + y_1) T) / T^3, times T^2 and T^3.

    Args:
        start: (k, n) position x_0 and derivatives x_1 …, in rad or m and s; or (N, k, n), one for each time.
        end: the same, y.
        T: (N,) s.

    Returns:
        (N, 2k, n) in powers of tau.
    """
    k = start.shape[-2]
    powers = (T[:, None] ** np.arange(k) / [factorial(i) for i in range(k)])[:, :, None]  # (N, k, 1)
    binomial = np.array([[comb(j, i) for j in range(2 * k)] for i in range(k)], dtype=float)
    low = powers * start
    rest = powers * end - np.einsum("ij,Njn->Nin", binomial[:, :k], low)
    inverse = np.rint(np.linalg.inv(binomial[:, k:]))
    return np.concatenate([low, np.einsum("ij,Njn->Nin", inverse, rest)], axis=1)


def hermite_trajectory(joint_names: tuple[str, ...], t: Array, states: Array) -> Trajectory:
    """Return the motion through states (m + 1, k, n) at times t (m + 1,), s: polynomials of degree 2k - 1."""
    h = np.diff(t)
    pieces = hermite(states[:-1], states[1:], h)
    return Trajectory(joint_names, t, pieces / h[:, None, None] ** np.arange(pieces.shape[1])[:, None])


@dataclass(frozen=True, eq=False)
class Hermite:
    """Motion between two states, (k, n) each: position, velocity, … in rad or m and s; all joints take one duration."""

    start: Array
    end: Array
    limits: Limits
    joint_names: tuple[str, ...]
    stretchable = False
    """Slowed down as a whole it would not have its end velocities."""

    @cached_property
    def shortest(self) -> float:
        """First duration within all limits, positions included, s, or the nearest to it.

        Found on a grid of 3.5 % from one duration to the next, then by bisection, to about 1e-8. A narrower set of good
        durations may be missed. Longer durations need not be good as well, since an end acceleration held for long is a
        large velocity.
        """
        rates = self.limits.rates
        sizes = [np.abs(self.end[0] - self.start[0]), *np.maximum(np.abs(self.start[1:]), np.abs(self.end[1:]))]
        times = [1e-3]
        for i, size in enumerate(sizes):
            times += [float(((size / rates[k - 1]) ** (1.0 / (k - i))).max()) for k in range(i + 1, 4)]
        grid = max(times) * np.geomspace(1.0 / _RANGE, _RANGE, _GRID)
        ratio = self._ratio(grid)
        good = ratio <= 1.0 + LIMIT_ROUNDING
        if not good.any():
            return float(grid[ratio.argmin()])
        first = int(good.argmax())
        low, high = grid[max(first - 1, 0)], grid[first]
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if self._ratio(np.array([middle]))[0] <= 1.0 + LIMIT_ROUNDING else (middle, high)
        return float(high)

    def trajectory(self, duration: float | None = None) -> Trajectory:
        """Return the motion, in that duration (s) or as fast as can be."""
        T = self.shortest if duration is None else duration
        return hermite_trajectory(self.joint_names, np.array([0.0, T]), np.array([self.start, self.end]))

    def _ratio(self, T: Array) -> Array:
        """Largest share of any limit that the motion takes in the durations T (N,): (N,), good to about 1e-6."""
        c = np.swapaxes(hermite(self.start, self.end, T), 1, 2)  # (N, n, 2k)
        lower, upper = self.limits.lower, self.limits.upper
        half_width = np.where(np.isfinite(upper - lower), np.maximum(0.5 * (upper - lower), 1e-9), np.inf)
        centre = np.where(np.isfinite(half_width), lower + half_width, 0.0)
        tau = np.linspace(0.0, 1.0, _SAMPLES)
        ratio = np.zeros(len(T))
        for order in range(4):
            value = c @ (tau ** np.arange(c.shape[2])[:, None])  # (N, n, samples)
            if order == 0:
                share = (value - centre[:, None]) / half_width[:, None]
            else:
                limit = self.limits.rates[order - 1]
                share = value / (T[:, None] ** order * limit)[:, :, None]
            ratio = np.maximum(ratio, _peaks(share).max(axis=1))
            c = polynomial.derivative(c)
        return ratio


def _peaks(f: Array) -> Array:
    """Largest |f| along the last axis of samples (N, n, samples), with the vertex of the parabola about it: (N, n)."""
    at = np.abs(f).argmax(axis=2)
    inner = np.clip(at, 1, f.shape[2] - 2)
    low, middle, high = (np.take_along_axis(f, (inner + k)[:, :, None], 2)[:, :, 0] for k in (-1, 0, 1))
    curvature = np.sign(middle) * (low - 2.0 * middle + high)
    gain = np.divide(
        (high - low) ** 2, -8.0 * curvature, out=np.zeros_like(curvature), where=(curvature < 0.0) & (at == inner)
    )
    return np.take_along_axis(np.abs(f), at[:, :, None], 2)[:, :, 0] + gain
