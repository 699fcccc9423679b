"""The fastest time law along a path under velocity, acceleration, torque and tool limits: TOPP-RA.

Pham & Pham 2018, A new approach to time-optimal path parameterization based on reachability analysis.
At point i of a grid the state is x_i = sd². Up to the next point sdd = u_i, so x_(i+1) = x_i + 2 ds u_i. The limits
|A u + B x + G| <= bound hold at both ends of the interval with the same u:

    |A_i u + B_i x + G_i| <= bound,   |A_(i+1) u + B_(i+1) (x + 2 ds u) + G_(i+1)| <= bound.

As rows bottom_j + slope_j x <= u <= top_j + slope_j x, these are a convex polygon of x and u.

Backward: the controllable set at i is the range of x from which some u of the polygon leads into the set at i + 1.
Three ranges that meet pairwise have a number in common (Helly), so it is enough that every bottom is below every top,
and that each alone lets x + 2 ds u reach the next set. The former does not depend on the next set. It is solved for all
intervals at once, by Newton's method on the concave function min_j top - max_j bottom.

Forward from rest: the largest u that leads into the next set. Where all 1 + 2 ds slope_j >= 0, a larger x leads to a
larger next one, so no law on this grid is faster at any point. Else, where a row has nearly no u, it is nearly the
fastest.
"""

from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array
from optiplan.trajectory.timing.path_constraints import Rows
from optiplan.trajectory.trajectory import Trajectory

_UNBOUNDED = 1e6  # stands for a speed without a limit
_FLAT = 1e-12  # share of the largest factor of u in an interval below which a factor counts as 0


def fastest_law(rows: Rows) -> Trajectory | None:
    """Return the time law s(t) from rest at s[0] to rest at s[-1] that is the fastest on this grid.

    Between neighbouring points of the grid sdd is constant: s(t) in exact quadratic pieces.

    Holds at: the points of the grid, from both sides; in between nearly, see `slowness`.

    Args:
        rows: the limits at the points of the grid.

    Returns:
        None where there is none.
    """
    speeds = _speeds(rows)
    if speeds is None:
        return None
    ds, total = np.diff(rows.s), speeds[:-1] + speeds[1:]
    if not (total > 0.0).all():
        return None
    dt = 2.0 * ds / total
    coefficients = np.stack([rows.s[:-1] - rows.s[0], speeds[:-1], 0.5 * np.diff(speeds) / dt], axis=1)
    return Trajectory(("s",), np.concatenate([[0.0], np.cumsum(dt)]), coefficients[:, :, None])


def slowness(law: Trajectory, between: Rows) -> Array:
    """Return the ratio, (k,), by which the profile of `fastest_law` exceeds the limits at interval midpoints.

    Args:
        law: s(t), of constant sdd in each of its k pieces.
        between: the limits at the k middles in s.
    """
    squares = law(law.breakpoints, 1)[:, :1] ** 2
    squared, sdd = 0.5 * (squares[1:] + squares[:-1]), 2.0 * law.coefficients[:, 2]
    motion = between.A * sdd + between.B * squared
    available = np.maximum(between.bound - np.sign(motion) * between.G, 1e-3 * between.bound)
    worst: Array = np.maximum(np.sqrt(squared[:, 0]) / between.speed, np.sqrt((np.abs(motion) / available).max(axis=1)))
    return worst


class _Polygons(NamedTuple):
    """The x and u of k intervals: low <= x <= high (k,) and bottom + slope x <= u <= top + slope x, (k, 2m) each."""

    low: Array
    high: Array
    bottom: Array
    top: Array
    slope: Array


class _Sets(NamedTuple):
    """The controllable x at the points of the grid, low <= x <= high, (k,) each."""

    low: Array
    high: Array


def _speeds(rows: Rows) -> Array | None:
    """Return the largest sd at every point of the grid, (k,); None where there is no law."""
    step = 2.0 * np.diff(rows.s)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # rows without u or x bound it by infinity
        polygons = _polygons(rows, step[:, None])
        sets = _controllable(polygons, step[:, None])
    if sets is None or sets.low[0] > 0.0:
        return None
    x = np.zeros(len(rows.s))
    for i in range(len(step)):
        u = (polygons.top[i] + polygons.slope[i] * x[i]).min()
        x[i + 1] = min(sets.high[i + 1], max(sets.low[i + 1], x[i] + step[i] * u))
    return np.asarray(np.sqrt(x))


def _polygons(rows: Rows, step: Array) -> _Polygons:
    """Write the rows of both ends of every interval, of length step / 2, as bounds on u; those without u as on x."""
    A, B, G = (part / rows.bound for part in (rows.A, rows.B, rows.G))
    by_u = np.hstack([A[:-1], A[1:] + step * B[1:]])
    by_x, rest = np.hstack([B[:-1], B[1:]]), np.hstack([G[:-1], G[1:]])
    flat = np.abs(by_u) <= _FLAT * np.abs(by_u).max(axis=1, keepdims=True)
    factor = np.where(flat, by_x, by_u)
    rest, size = np.where(factor < 0.0, -rest, rest), np.maximum(np.abs(factor), np.finfo(float).tiny)
    bottom, top = (-1.0 - rest) / size, (1.0 - rest) / size
    low = np.where(flat, bottom, 0.0).max(axis=1, initial=0.0)
    high = np.where(flat, top, np.inf).min(axis=1)
    high = np.minimum(high, np.minimum(rows.speed[:-1], _UNBOUNDED) ** 2)
    bottom, top, slope = np.where(flat, -np.inf, bottom), np.where(flat, np.inf, top), np.where(flat, 0.0, -by_x / by_u)
    low, high = -_largest(bottom, top, -slope, -low), _largest(bottom, top, slope, high)
    return _Polygons(low, high, bottom, top, slope)


def _largest(bottom: Array, top: Array, slope: Array, most: Array) -> Array:
    """Return the largest x <= most, (k,), with every bottom + slope x below every top + slope x; -inf where none."""
    x, left = most.copy(), np.arange(len(most))
    while len(left):
        rise = slope[left] * x[left, None]
        i, j = (top[left] + rise).argmin(axis=1), (bottom[left] + rise).argmax(axis=1)
        gap, closing = top[left, i] - bottom[left, j], slope[left, j] - slope[left, i]
        crossing = np.where(closing > 0.0, gap / closing, -np.inf)
        smaller = (gap < closing * x[left]) & (crossing < x[left])
        x[left[smaller]] = crossing[smaller]
        left = left[smaller & np.isfinite(crossing)]
    return x


def _controllable(polygons: _Polygons, step: Array) -> _Sets | None:
    """Return the states from which rest at the last point is reached; None where a set is empty."""
    rise = 1.0 + step * polygons.slope  # of the next state x + 2 ds u with x, along a row
    up = rise >= 0.0
    bottom, top = step * polygons.bottom, step * polygons.top
    most, least = np.where(up, bottom, top), np.where(up, top, bottom)
    low, high = np.zeros((2, len(step) + 1))
    for i in reversed(range(len(step))):
        upper, lower = np.where(up[i], high[i + 1], low[i + 1]), np.where(up[i], low[i + 1], high[i + 1])
        high[i] = min(polygons.high[i], ((upper - most[i]) / rise[i]).min())
        low[i] = max(polygons.low[i], ((lower - least[i]) / rise[i]).max())
        if not low[i] <= high[i]:
            return None
    return _Sets(low, high)
