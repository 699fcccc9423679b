"""The quickest stop of a joint within acceleration and jerk limits, step by step, and how far it travels.

Time goes in steps of dt. In a step the acceleration is constant, v' = v + dt a', and from one step to the next it
changes by at most d = dt · jerk. From a velocity u >= 0 the acceleration can run back to zero, d a step, exactly as the
joint stops, if it is -alpha with F(alpha) = u, where

    F(alpha) = dt (alpha + (alpha - d) + (alpha - 2d) + …), positive terms only.

So braking is one rule: a' = -sign(v) F⁻¹(|v|), as far as limits of acceleration and jerk let it. It is a feedback law,
hence what is left of a stop is the stop from there: whoever can stop now can do so in the next step too, to the last
bit. That a joint halts before its end is therefore a bound on its velocity that can always be kept.
"""

import math
from typing import TypeAlias

import numpy as np

from optiplan.arrays import Array

Phase: TypeAlias = tuple[int, float, float]
"""(count, first, change): steps of a stop whose accelerations are first + (i - 1) change, i = 1 … count."""


def velocity_to_zero(alpha: float, change: float, dt: float) -> float:
    """F(alpha), see above: velocity that is gone when an acceleration of size alpha runs back to zero."""
    if change == math.inf or alpha <= change:
        return dt * alpha
    m = math.ceil(alpha / change)
    return dt * (m * alpha - 0.5 * change * m * (m - 1))


def braking_acceleration(u: float, change: float, dt: float) -> float:
    """F⁻¹(u): the size of acceleration that stops a velocity u >= 0 while it runs back to zero."""
    if change == math.inf:
        return u / dt
    m = max(1, math.ceil(0.5 * (math.sqrt(1.0 + 8.0 * u / (change * dt)) - 1.0) - 1e-12))
    return (u / dt + 0.5 * change * m * (m - 1)) / m


def braking_accelerations(u: Array, change: Array, dt: float) -> Array:
    """`braking_acceleration` of many velocities u (n,) >= 0 with changes (n,)."""
    m = np.maximum(np.ceil(0.5 * np.sqrt(1.0 + (8.0 / dt) * u / change) - (0.5 + 1e-12)), 1.0)
    # Where a change is without limit, m is 1 and inf · 0 is no number.
    return np.asarray(u / (m * dt) + 0.5 * np.minimum(change, 1e12) * (m - 1.0))


def stop_phases(v: float, a: float, limit: float, change: float, dt: float) -> tuple[Phase, ...]:
    """The stop from velocity v and acceleration a: accelerations of at most `limit`, that change by `change` a step.

    Three phases at most: away from a, at the limit, and back to zero.
    """
    best = -math.copysign(braking_acceleration(abs(v), change, dt), v)
    if best <= a:
        return _falling(v, a, limit, change, dt)
    return tuple([(count, -first, -change) for count, first, change in _falling(-v, -a, limit, change, dt)])


def _falling(v: float, a: float, limit: float, change: float, dt: float) -> tuple[Phase, ...]:
    """The stop where the acceleration falls at first."""
    phases: tuple[Phase, ...] = ()
    if change != math.inf:
        steps = _falling_steps(v, a, limit, change, dt)
        if steps:
            phases = ((steps, a - change, -change),)
            v += dt * (steps * a - 0.5 * change * steps * (steps + 1))
    hold = velocity_to_zero(limit, change, dt)
    if v >= hold:
        steps = int((v - hold) / (limit * dt)) + 1
        phases = (*phases, (steps, -limit, 0.0))
        v -= steps * limit * dt
    size = braking_acceleration(abs(v), change, dt)
    if size > 0.0:
        steps = 1 if change == math.inf else max(1, math.ceil(size / change - 1e-12))
        sign = -math.copysign(1.0, v)
        phases = (*phases, (steps, sign * size, 0.0 if steps == 1 else -sign * change))
    return phases


def _falling_steps(v: float, a: float, limit: float, change: float, dt: float) -> int:
    """How many whole changes the acceleration falls before the limit, or before it has to run back to zero."""

    def runs_out(k: int) -> bool:
        """Whether k steps are too many: the velocity would be below zero once the acceleration is back at zero."""
        last = a - k * change
        after = v + dt * (k * a - 0.5 * change * k * (k + 1))
        back = velocity_to_zero(abs(last), change, dt) - dt * abs(last)
        return after + math.copysign(back, last) < 0.0

    jerk = change / dt
    most = max(0, int((a + limit) / change + 1e-12))
    k = int(max(0.0, a + math.sqrt(max(0.0, 0.5 * a * a + v * jerk))) / change)
    k = min(k, most)
    while k < most and not runs_out(k + 1):
        k += 1
    while k > 0 and runs_out(k):
        k -= 1
    return k


def travel(phases: tuple[Phase, ...], v: float, dt: float, steps: int | None = None) -> float:
    """Sum of dt v_i over the steps of a stop from velocity v, rad or m; of the first `steps` of them alone if given.

    With a_i = b + (i - 1) g:  v_k = v + dt (k b + g k (k - 1) / 2), and the sum over k steps is
    dt (k v + dt (b k (k + 1) / 2 + g (k - 1) k (k + 1) / 6)).
    """
    total, left = 0.0, math.inf if steps is None else steps
    for count, b, g in phases:
        k = count if count <= left else int(left)
        total += dt * (k * v + dt * (0.5 * b * k * (k + 1) + g * (k - 1) * k * (k + 1) / 6.0))
        v += dt * (k * b + 0.5 * g * k * (k - 1))
        left -= k
        if left <= 0:
            break
    return total


def farthest(v: float, a: float, limit: float, change: float, dt: float) -> float:
    """How far a joint gets in the positive direction at most while it brakes, rad or m, >= 0.

    A velocity changes its sign during a stop only where the acceleration cannot be turned back in time.
    """
    if v == 0.0 and abs(a) <= change:
        return 0.0
    phases = stop_phases(v, a, limit, change, dt)
    total = travel(phases, v, dt)
    if v > 0.0 and phases and phases[0][2] > 0.0:  # over-braked: forward first, then back
        return max(0.0, total, _forward(phases, v, dt))
    return max(0.0, total)


def farthest_way(phases: tuple[Phase, ...], v: float, a: float, change: float, dt: float) -> float:
    """How far a joint gets at most, either way, in a stop from velocity v and acceleration a, rad or m, >= 0."""
    if v == 0.0 and abs(a) <= change:
        return 0.0
    total = abs(travel(phases, v, dt))
    if not (phases and v * phases[0][2] > 0.0):
        return total
    if v > 0.0:
        return max(total, _forward(phases, v, dt))
    return max(total, _forward(tuple([(count, -first, -change) for count, first, change in phases]), -v, dt))


def _forward(phases: tuple[Phase, ...], v: float, dt: float) -> float:
    """Travel until the velocity of a stop changes its sign for the first time."""
    best = total = 0.0
    for count, first, change in phases:
        for i in range(count):
            v += dt * (first + i * change)
            if v <= 0.0:
                return best
            total += dt * v
            best = max(best, total)
    return best
