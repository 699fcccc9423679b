"""The quickest stop of a joint within acceleration and jerk limits, and how far it travels.

A stop is a motion in continuous time: the acceleration changes steadily from a to -α, stays there if α is its limit,
and comes back to zero as the joint stands. With s the sign of v + a|a| / 2j, which is the velocity that is left when
the acceleration alone is turned back to zero, and counted along s,

    α = min(A, sqrt(j v + a² / 2)),    (A² as far as it goes:) hold for (v + a² / 2j - A² / j) / A seconds.

It depends on v and a alone, hence what is left of a stop is the stop from there, whenever one looks: a robot that can
stop now can do so after a step of *any* length, by going on along its stop for so long. That a joint halts before its
end is therefore a bound that can always be kept, and no length of a later step enters it.

A step that does not brake has a constant acceleration a', with which v' = v + dt a'. So that a' can be turned back to
zero as the velocity reaches u later, whatever steps follow, the velocity dt a' of the step itself and a'² / 2j count:

    F(a') = dt a' + a'² / 2j <= u.
"""

import math
from typing import TypeAlias

import numpy as np

from optiplan.arrays import Array

Phase: TypeAlias = tuple[float, float, float]
"""(duration, first, jerk): s in which the acceleration is first + jerk t."""


def velocity_to_zero(alpha: float, jerk: float, dt: float) -> float:
    """F(alpha), see above: what an acceleration of size alpha adds in a step and until it has come back to zero."""
    return alpha * (dt + 0.5 * alpha / jerk)


def braking_accelerations(u: Array, jerk: Array, dt: float) -> Array:
    """F⁻¹(u): accelerations (n,) that leave no more than u (n,) >= 0 to be turned back within `jerk` (n,)."""
    return np.asarray(2.0 * u / (dt + np.sqrt(dt * dt + 2.0 * u / jerk)))


def stop_phases(v: float, a: float, limit: float, jerk: float) -> tuple[Phase, ...]:
    """The stop from velocity v and acceleration a: three phases at most; none where it takes no time.

    An acceleration beyond `limit` comes back to it at once: jerk is given up first.
    """
    if jerk == math.inf:
        if limit == math.inf or v == 0.0:
            return ()
        return ((abs(v) / limit, -math.copysign(limit, v), 0.0),)
    a = min(max(a, -limit), limit)
    if v + 0.5 * a * abs(a) / jerk >= 0.0:
        return _falling(v, a, limit, jerk)
    return tuple([(duration, -first, -change) for duration, first, change in _falling(-v, -a, limit, jerk)])


def _falling(v: float, a: float, limit: float, jerk: float) -> tuple[Phase, ...]:
    """The stop where the acceleration falls at first."""
    square = max(0.0, jerk * v + 0.5 * a * a)
    size = math.sqrt(square)
    if size > limit:
        hold = (square - limit * limit) / (jerk * limit)
        return ((a + limit) / jerk, a, -jerk), (hold, -limit, 0.0), (limit / jerk, -limit, jerk)
    return (max(0.0, (a + size) / jerk), a, -jerk), (size / jerk, -size, jerk)


def travel(phases: tuple[Phase, ...], v: float) -> float:
    """How far a stop from velocity v leads, rad or m: sum of v t + first t² / 2 + jerk t³ / 6 of its phases."""
    total = 0.0
    for t, first, change in phases:
        total += t * (v + t * (0.5 * first + t * (change / 6.0)))
        v += t * (first + 0.5 * change * t)
    return total


def after(phases: tuple[Phase, ...], q: float, v: float, left: float) -> tuple[float, float, float]:
    """Position, velocity and acceleration when the stop from position q and velocity v has lasted `left` s."""
    for duration, first, change in phases:
        t = min(left, duration)
        q += t * (v + t * (0.5 * first + t * (change / 6.0)))
        v += t * (first + 0.5 * change * t)
        if left < duration:
            return q, v, first + change * t
        left -= duration
    return q, 0.0, 0.0


def farthest(v: float, a: float, limit: float, jerk: float) -> float:
    """How far a joint gets in the positive direction at most while it brakes, rad or m, >= 0.

    A velocity changes its sign during a stop only where the acceleration cannot be turned back in time.
    """
    if jerk < math.inf and v > 0.0:
        a = min(max(a, -limit), limit)
        if v + 0.5 * a * abs(a) / jerk < 0.0:
            return _turn(v, a, jerk)
    return max(0.0, travel(stop_phases(v, a, limit, jerk), v))


def _turn(v: float, a: float, jerk: float) -> float:
    """How far a joint gets from v > 0 that brakes so hard, with a < 0, that its velocity changes its sign."""
    t = 2.0 * v / (math.sqrt(max(0.0, a * a - 2.0 * jerk * v)) - a)
    return t * (v + t * (0.5 * a + t * (jerk / 6.0)))


def farthest_way(phases: tuple[Phase, ...], v: float, a: float, limit: float, jerk: float) -> float:
    """How far a joint gets at most, either way, in its stop from velocity v and acceleration a, rad or m, >= 0."""
    total = abs(travel(phases, v))
    a = min(max(a, -limit), limit)
    if jerk == math.inf or v == 0.0 or v * (v + 0.5 * a * abs(a) / jerk) >= 0.0:
        return total
    return max(total, _turn(abs(v), -abs(a), jerk))
