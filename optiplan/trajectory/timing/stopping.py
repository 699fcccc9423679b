"""How far a moving joint goes on before it can turn back, by its limits of acceleration and jerk alone."""

import numpy as np

from optiplan.arrays import Array
from optiplan.robot.limits import Limits


def furthest(q: Array, v: Array, a: Array, limits: Limits) -> tuple[Array, Array]:
    """Return the least and the greatest position (n,) that no admissible motion from a state (n,) each avoids.

    Upwards, no motion is below the one with the least acceleration at every instant, a(t) = max(a - J t, -A). So every
    motion reaches its maximum. Downwards is the mirror image. Exact.
    """
    high = np.array([_highest(*state) for state in zip(q, v, a, limits.acceleration, limits.jerk, strict=True)])
    low = np.array([-_highest(*state) for state in zip(-q, -v, -a, limits.acceleration, limits.jerk, strict=True)])
    return low, high


def fastest_reached(v: Array, a: Array, limits: Limits) -> tuple[Array, Array]:
    """Return the least and the greatest velocity (n,) that no admissible motion avoids: v -+ a² / 2 J beyond v."""
    rise = np.where(np.isinf(limits.jerk), 0.0, a * np.abs(a) / (2.0 * limits.jerk))
    return v + np.minimum(rise, 0.0), v + np.maximum(rise, 0.0)


def _highest(q: float, v: float, a: float, most: float, jerk: float) -> float:
    """Greatest position of one joint on its hardest way down."""
    if np.isinf(jerk):
        return q + max(v, 0.0) ** 2 / (2.0 * most)
    first = max(0.0, (a + most) / jerk)  # until the acceleration is -most
    best = q
    for t in _roots(v, a, -jerk):
        if 0.0 < t <= first:
            best = max(best, q + t * (v + t * (a / 2.0 - t * jerk / 6.0)))
    then = v + first * (a - first * jerk / 2.0)
    if then > 0.0:
        best = max(best, q + first * (v + first * (a / 2.0 - first * jerk / 6.0)) + then * then / (2.0 * most))
    return best


def _roots(v: float, a: float, jerk: float) -> list[float]:
    """Times at which v + a t + jerk t² / 2 vanishes."""
    under = a * a - 2.0 * jerk * v
    if under < 0.0:
        return []
    return [(-a + sign * under**0.5) / jerk for sign in (-1.0, 1.0)]
