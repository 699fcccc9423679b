"""Improve a path by searches between two of its points: other ways around things, where shortcuts find none."""

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.base import Budget
from optiplan.planners.common.tolerances import LEAST_GAIN
from optiplan.planners.sampling.edge_checker import MotionCheck, PartialCheck
from optiplan.planners.sampling.search import Searcher
from optiplan.planners.sampling.shortcutting import costs_along, path_cost, shorten
from optiplan.robot.robot import Limits

_PIECE = 0.2, 1.0  # shares of a path between two such points
_SHORTER = 0.4, 0.9  # times the piece's cost in which the new one is to pass
_PATIENCE = 1000  # iterations of a search
_SHORTCUTS = 40  # of the new piece
_STALE = 10  # searches in a row that gain nothing, after which no more are made


def improved_path(
    check: MotionCheck,
    waypoints: Array,
    searcher: Searcher,
    budget: Budget,
    rng: np.random.Generator,
    searches: int,
) -> Array:
    """Return a path (m, n) with the same ends as `waypoints` (k, n), at no higher cost.

    Two points of the path are drawn at random, and a path between them is searched where only a shorter one can pass.
    After shortcuts, it replaces the piece between them if it is cheaper. A search between near points in a small box is
    short, with or without a result. Shortcuts nearly always keep a path in its homotopy class; this does not.

    Args:
        check: proves edges.
        waypoints: free.
        searcher: finds the pieces.
        budget: once it is over, the path so far is returned.
        rng: of the points and searches.
        searches: made at most.
    """
    path, velocity, stale = waypoints, check.limits.velocity, 0
    cost = path_cost(path, velocity)
    for _ in range(searches):
        if len(path) == 2 or stale >= _STALE or budget.over:
            break
        path = _with_new_piece(check, path, searcher, budget, rng)
        before, cost = cost, path_cost(path, velocity)
        stale = stale + 1 if cost > (1.0 - LEAST_GAIN) * before else 0
    return path


def box_of_paths(start: Array, goals: Array, longest: Array, limits: Limits) -> tuple[Array, Array]:
    """Return the box (n,), (n,) through which paths from start (n,) to goal k of (g, n) in longest[k], s, can pass.

    Through q a path takes at least max_j (|q_j - start_j| + |goal_j - q_j|) / v_j: this bounds a box for each goal. In
    it a slow joint goes only a little beyond its ends, and one that need not move stands still.
    """
    slack = np.maximum(0.5 * (longest[:, None] * limits.velocity - np.abs(goals - start)), 0.0)
    low = np.maximum((np.minimum(start, goals) - slack).min(axis=0), limits.lower)
    high = np.minimum((np.maximum(start, goals) + slack).max(axis=0), limits.upper)
    return low, high


def _with_new_piece(
    check: MotionCheck, path: Array, searcher: Searcher, budget: Budget, rng: np.random.Generator
) -> Array:
    velocity = check.limits.velocity
    along = costs_along(path, velocity)
    piece = rng.uniform(*_PIECE) * along[-1]
    first = rng.uniform(0.0, along[-1] - piece)
    last = first + piece
    ends = np.column_stack([np.interp([first, last], along, q) for q in path.T])
    before, after = path[along <= first], path[along >= last]
    old = path_cost(np.vstack([ends[:1], path[(along > first) & (along < last)], ends[1:]]), velocity)
    longest = np.array([rng.uniform(*_SHORTER) * old])
    seed, draws = int(rng.integers(1, 2**31)), rng.uniform(size=(_SHORTCUTS, 3))
    box = box_of_paths(ends[0], ends[1:], longest, check.limits)
    part = PartialCheck(check.by_moment_arms(), ends[0], np.ones(len(velocity), dtype=bool), box)
    found = searcher(part, (ends[0], ends[1:]), budget, seed, patience=_PATIENCE)
    if found.path is None:
        return path
    new = shorten(check, found.path, velocity, draws, budget)
    if path_cost(new, velocity) >= old:
        return path
    return np.vstack([before, new, after])
