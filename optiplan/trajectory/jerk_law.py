"""A time law whose jerk is limited: a clamped cubic spline s(t), from the fastest law without such a limit."""

import numpy as np

from optiplan.arrays import Array
from optiplan.model.robot import Limits
from optiplan.trajectory.path_rows import Rows
from optiplan.trajectory.trajectory import Trajectory

_SPANS = 40  # of the spline, at least
_FINEST = 2000  # the shortest span is the duration over this


def smooth_law(path: Trajectory, limits: Limits, rows: Rows, fast: Trajectory) -> Trajectory:
    """A cubic spline near the law `fast`: its control points are values of that law (Schoenberg's approximation).

    Never decreasing, because `fast` is; at rest, without acceleration, at both ends. Its jerk is limited by the length
    of its spans, which are as short as the ramps of acceleration at the steps of `fast` need be.

    Args:
        path: q over s.
        limits: of the n joints.
        rows: the grid of `fast`.
        fast: piecewise quadratic, with a breakpoint at each s of the grid.
    """
    h = float((2.0 * limits.acceleration / limits.jerk).max())
    t = np.linspace(0.0, fast.duration, int(np.clip(np.ceil(fast.duration / h), 40, 300)) + 1)
    knots = np.concatenate([t[[0, 0, 0]], t, t[[-1, -1, -1]]])
    greville = (knots[1:-3] + knots[2:-2] + knots[3:-1]) / 3.0
    control = fast(greville)[:, 0]
    control[:3], control[-3:] = 0.0, path.duration
    return Trajectory.from_bspline(("s",), knots, control[:, None], 3)


def _ramps(path: Trajectory, limits: Limits, rows: Rows, fast: Trajectory) -> Array:
    """Time (k,) that the step of acceleration at each point of the grid takes at the jerk limits, s."""
    u = 2.0 * fast.coefficients[:, 2, 0]
    step = np.abs(np.diff(np.concatenate([[0.0], u, [0.0]])))
    return np.asarray((np.abs(path(rows.s, 1)) / limits.jerk).max(axis=1) * step)


def _knots(fast: Trajectory, ramps: Array) -> Array:
    """Breakpoints in time: near a step of acceleration about half its ramp apart, ever farther away from it."""
    t, T = fast.breakpoints, fast.duration
    near = ramps > np.append(np.diff(t), T)  # a step: the acceleration changes faster than the jerk limit allows
    near[[0, -1]] = True
    x = np.linspace(0.0, T, 2 * _FINEST + 1)
    span = np.full(len(x), T / _SPANS)
    for at, ramp in zip(t[near], ramps[near], strict=True):
        span = np.minimum(span, np.maximum(0.5 * ramp, 0.5 * np.abs(x - at)))
    span = np.maximum(span, T / _FINEST)
    count = np.concatenate([[0.0], np.cumsum(np.diff(x) / span[1:])])
    return np.interp(np.linspace(0.0, count[-1], int(np.ceil(count[-1])) + 1), count, x)
