"""Shorten a path of straight segments: random shortcuts of all joints or of one, then drop needless corners."""

from typing import TYPE_CHECKING

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.planners.base import Budget
from optiplan.planners.sampling.edge_checker import MotionCheck

if TYPE_CHECKING:
    from optiplan._core._core_base import EdgeChecker

TWO_NORM_SHARE = 0.1
"""Share of the 2-norm in the cost of a path."""

_TOGETHER = 40  # attempts of the native core


def path_times(start: Array, end: Array, velocity: Array) -> Array:
    """Return the cost of each motion from start (k, n) to end (k, n): (k,) in s.

    max_j |dq_j| / v_j + 0.1 ||dq / v||: the time at full speed, plus a little of the 2-norm. Many paths share the same
    largest joint; the 2-norm prefers the straight one among them.
    """
    x = np.abs(end - start) / velocity
    cost: Array = x.max(axis=1) + TWO_NORM_SHARE * np.linalg.norm(x, axis=1)
    return cost


def path_time(waypoints: Array, velocity: Array) -> Array:
    """Return the cost of each segment between waypoints (k, n): (k - 1,) in s."""
    return path_times(waypoints[:-1], waypoints[1:], velocity)


def path_cost(waypoints: Array, velocity: Array) -> float:
    """Return the cost of the path through waypoints (k, n), s."""
    return float(path_time(waypoints, velocity).sum())


def costs_along(waypoints: Array, velocity: Array) -> Array:
    """Return the cost of the path up to each of its waypoints (k, n): (k,) in s."""
    return np.concatenate([[0.0], np.cumsum(path_time(waypoints, velocity))])


def shorten(check: MotionCheck, waypoints: Array, velocity: Array, draws: Array, budget: Budget) -> Array:
    """Return a path with the same ends at no higher cost; every new segment passes `check`. Shapes (k, n) -> (m, n).

    Each row of `draws` (attempts, 3), uniform in [0, 1), is one attempt: two numbers for its begin and end along the
    path, one for the joints that it straightens. Below one half these are all joints, else a single one.
    """
    if check.native is not None:
        return _shorten_natively(check.native, waypoints, velocity, draws, budget)
    path = drop_corners(check, waypoints, velocity, budget)
    for draw in draws:
        if len(path) < 3 or budget.over:
            break
        path = _attempt(check, path, velocity, draw)
    return drop_corners(check, path, velocity, budget)


def _shorten_natively(check: "EdgeChecker", path: Array, velocity: Array, draws: Array, budget: Budget) -> Array:
    """Do the same in the native core; the budget is polled every few attempts."""
    path = np.ascontiguousarray(path)
    for k in range(0, max(len(draws), 1), _TOGETHER):
        if budget.over:
            break
        some = np.ascontiguousarray(draws[k : k + _TOGETHER])
        path = core.shorten(check, path, velocity, some, budget.remaining)
    return path


def _attempt(check: MotionCheck, path: Array, velocity: Array, draw: Array) -> Array:
    along = costs_along(path, velocity)
    first, last = np.sort(draw[:2]) * along[-1]
    joint = int(np.floor((2.0 * draw[2] - 1.0) * len(velocity)))  # negative: all joints
    ends = [np.array([np.interp(s, along, q) for q in path.T]) for s in (first, last)]
    inner = (along > first) & (along < last)
    if not inner.any():
        return path
    old = np.vstack([ends[0], path[inner], ends[1]])
    if joint < 0:
        new = old[[0, -1]]
    else:
        new = old.copy()
        new[:, joint] = np.interp(np.concatenate([[first], along[inner], [last]]), [first, last], old[[0, -1], joint])
    if path_cost(new, velocity) > path_cost(old, velocity) * (1.0 - 1e-3) or not check.polyline_free(new):
        return path
    return np.vstack([path[along <= first], new, path[along >= last]])


def drop_corners(check: MotionCheck, path: Array, velocity: Array, budget: Budget) -> Array:
    """Remove each inner waypoint whose neighbours can be joined straight at no higher cost."""
    i = 1
    while i < len(path) - 1 and not budget.over:
        old, new = path_cost(path[i - 1 : i + 2], velocity), path_cost(path[[i - 1, i + 1]], velocity)
        if new <= old * (1.0 + 1e-9) and check.free(path[i - 1], path[i + 1]):
            path = np.delete(path, i, axis=0)
            i = max(1, i - 1)
        else:
            i += 1
    return path
