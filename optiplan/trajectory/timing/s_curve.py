"""The fastest motion of one coordinate from rest to rest over a distance D: seven phases of constant jerk.

It is optimal under symmetric bounds V, A, J on velocity, acceleration and jerk. Its acceleration rises for t_j, stays
for t_a, falls for t_j; then the velocity stays for t_v; then all of it backwards:

    t_j = min(A / J, sqrt(V / J), cbrt(D / 2J)),   a = J t_j,
    t_a = max(0, min(V / a - t_j, (sqrt(t_j^2 + 4 D / a) - 3 t_j) / 2)),   v = a (t_j + t_a),
    t_v = max(0, D / v - 2 t_j - t_a),   T = 4 t_j + 2 t_a + t_v.

Without a bound on jerk (J infinite) t_j = 0 and a = A: the acceleration jumps.
"""

from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array
from optiplan.trajectory.tolerances import SAME_TIME

_ZERO_DISTANCE = 1e-60  # m or rad: stands for "no distance", so that the formulas above need no branch
_BRIEFEST = 1e-8  # share of the duration that a phase of a law takes at least
_ACCELERATION = np.array([0.0, 1.0, 1.0, 0.0, 0.0, -1.0, -1.0, 0.0])  # around the seven phases, over its peak


class Phases(NamedTuple):
    """Times t_j, t_a and t_v of the module's curve, s."""

    jerk: Array
    acceleration: Array
    velocity: Array

    @property
    def total(self) -> Array:
        """T = 4 t_j + 2 t_a + t_v, s."""
        return np.asarray(4.0 * self.jerk + 2.0 * self.acceleration + self.velocity)


def phases(distance: Array, velocity: Array, acceleration: Array, jerk: Array) -> Phases:
    """Return the times of the module's curve, element by element; all arrays of one shape."""
    D = np.maximum(distance, _ZERO_DISTANCE)
    t_j = np.minimum(np.minimum(acceleration / jerk, np.sqrt(velocity / jerk)), np.cbrt(D / (2.0 * jerk)))
    with np.errstate(invalid="ignore"):
        a = np.where(np.isinf(jerk), acceleration, jerk * t_j)
    t_a = np.maximum(0.0, np.minimum(velocity / a - t_j, (np.sqrt(t_j**2 + 4.0 * D / a) - 3.0 * t_j) / 2.0))
    t_v = np.maximum(0.0, D / (a * (t_j + t_a)) - 2.0 * t_j - t_a)
    return Phases(t_j, t_a, t_v)


def with_digits(distance: float, velocity: float, acceleration: float, jerk: float) -> tuple[float, float]:
    """Return bounds of acceleration and jerk with which each phase takes at least 1e-8 of a motion over a distance.

    Seconds have sixteen digits, and a phase needs some of them. The cost is as small a share of the duration.
    """
    a = min(acceleration, velocity**2 / (_BRIEFEST * distance))
    longest = max(distance / velocity, 2.0 * (distance / a) ** 0.5)
    return a, jerk if np.isinf(jerk) else min(jerk, a / (_BRIEFEST * longest))


def s_curve(distance: float, velocity: float, acceleration: float, jerk: float) -> tuple[Array, Array]:
    """The module's curve in pieces: durations (m,) in s and ascending coefficients (m, 4) of s(t) from 0 to distance.

    All four are positive; the jerk may be infinite. Acceleration and jerk are those of `with_digits`.
    """
    acceleration, jerk = with_digits(distance, velocity, acceleration, jerk)
    t_j, t_a, t_v = phases(np.array(distance), np.array(velocity), np.array(acceleration), np.array(jerk))
    times = np.array([t_j, t_a, t_j, t_v, t_j, t_a, t_j])
    peak = acceleration if np.isinf(jerk) else jerk * t_j
    pieces = np.zeros((7, 4))
    s = v = 0.0
    for i, (h, a, b) in enumerate(zip(times, peak * _ACCELERATION[:-1], peak * _ACCELERATION[1:], strict=True)):
        j = (b - a) / h if h > 0.0 else 0.0
        pieces[i] = s, v, a / 2.0, j / 6.0
        s, v = s + h * (v + h * (a / 2.0 + h * j / 6.0)), v + h * (a + h * j / 2.0)
    kept = times > SAME_TIME * times.sum()
    return times[kept], pieces[kept]
