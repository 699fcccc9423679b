"""OMPL's planners, made deterministic, interruptible and silent; RRT-Connect in the native core where that is."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from itertools import count
from math import inf, isfinite
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.libraries import loading
from optiplan.planners.base import Budget
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.sampling.ompl_space import Ends, SearchSpace
from optiplan.planners.sampling.search import TREE_SAMPLE, Kind, Search, Searcher, SearchOptions, native_rrt_connect

_START, _GOAL = 1, 2  # OMPL's tags of the two trees
_BATCH = 100  # samples that BIT* adds at a time
_SEARCHING = 0.7  # share of the budget for improving a path; the rest is for shortening and timing it
_AROUND, _LOOKS = 0.4, 50  # s at full speed: radius, and number of configurations to measure free space
_NARROW = 0.2  # longest edge of trees in narrow places, in units of the check
ALTERNATE_RATIO = 20.0  # iterations of KPIECE per iteration of RRT-Connect in about the same time
_OMPL = threading.Lock()  # OMPL's seed is global to the process


def search(
    check: MotionCheck, ends: Ends, budget: Budget, seed: int, options: SearchOptions, *, patience: float = inf
) -> Search:
    """Connect the start (n,) with one of the goals (k, n) = `ends`, in coordinates q / velocity limit (s).

    Without a path after `patience` iterations the search ends (`impatient`), so that another one can be tried. Same
    arguments, same result, unless the budget cut it.

    Sources: Kuffner and LaValle, "RRT-Connect", ICRA 2000. Karaman and Frazzoli, "Sampling-based algorithms for optimal
    motion planning", IJRR 2011 (RRT*). Gammell et al., "Informed RRT*", IROS 2014. Gammell et al., "Batch informed
    trees", IJRR 2020. Sucan and Kavraki, "KPIECE", WAFR 2008.
    """
    if options.kind == "rrtconnect" and check.native is not None:
        return native_rrt_connect(check, ends, budget, seed, options.reach, patience=patience)
    with loading():
        from ompl import base

    back = options.kind in _ONE_TREE and _goals_are_tighter(check, ends, seed)
    trees = (ends[1], ends[0][None]) if back else (ends[0][None], ends[1])
    with seeded(seed, budget) as mine:
        if not mine:
            return Search(None, ends[0][None], ends[1], (1, len(ends[1])))
        space = SearchSpace(check, ends)
        problem = space.problem(*trees)
        planner, enough = _PLANNERS[options.kind](space, problem, options)
        planner.setProblemDefinition(problem)
        planner.setup()
        early = budget.share(_SEARCHING)
        looks = count()
        spent = [False]

        def over() -> bool:
            spent[0] = next(looks) > patience and not _connected(planner, problem)
            return budget.over or spent[0] or enough(early)

        planner.solve(base.PlannerTerminationCondition(over))
        found = _collect(planner, space, problem, trees)
        cut = options.effort > 0 and early.over
        found = replace(found, cut_short=cut, impatient=spent[0] and found.path is None and not budget.over)
        space.close()
    if not back:
        return found
    path, sizes = None if found.path is None else found.path[::-1], found.sizes[::-1]
    return replace(found, path=path, start_tree=found.goal_tree, goal_tree=found.start_tree, sizes=sizes)


rrt_connect: Searcher = partial(search, options=SearchOptions("rrtconnect"))
"""RRT-Connect with default options, the fastest searcher."""

kpiece: Searcher = partial(search, options=SearchOptions("kpiece", _NARROW))
"""KPIECE with short edges, for long narrow passages.

It grows from the borders of what the tool has covered, where RRT-Connect aims at the large free space outside.
"""


def _goals_are_tighter(check: MotionCheck, ends: Ends, seed: int) -> bool:
    """Return whether less space is free at the goals: a tree leaves a narrow place more easily than it enters one."""
    steps = np.random.default_rng(seed).uniform(-_AROUND, _AROUND, (_LOOKS, len(ends[0]))) * check.limits.velocity
    start, *goals = [sum(not check.blocked(q + step) for step in steps) for q in np.vstack(ends)]
    return max(goals) < start


@contextmanager
def seeded(seed: int, budget: Budget) -> Iterator[bool]:
    """Lock OMPL for this thread and seed it; False when the budget ended before the lock was free."""
    from ompl import util

    while not _OMPL.acquire(timeout=0.02):
        if budget.over:
            yield False
            return
    try:
        util.setLogLevel(util.LogLevel.LOG_NONE)
        util.RNG.setSeed(seed)
        yield True
    finally:
        _OMPL.release()


Made = tuple[Any, Callable[[Budget], bool]]
"""A planner of OMPL, and whether its path is good enough, given the remaining time for improvement."""


def _connect(space: SearchSpace, problem: Any, options: SearchOptions) -> Made:
    from ompl import geometric

    planner = geometric.RRTConnect(space.information)
    planner.setRange(options.reach)
    return planner, lambda early: False


def _star(space: SearchSpace, problem: Any, options: SearchOptions) -> Made:
    from ompl import geometric

    informed = options.kind == "informed_rrtstar"  # whose ellipsoid is that of a length
    problem.setOptimizationObjective(space.path_length() if informed else space.path_time())
    planner = geometric.InformedRRTstar(space.information) if informed else geometric.RRTstar(space.information)
    planner.setRange(options.reach)
    return planner, lambda early: _improved(planner, planner.numIterations() >= options.effort or early.over)


def _batches(space: SearchSpace, problem: Any, options: SearchOptions) -> Made:
    from ompl import geometric

    problem.setOptimizationObjective(space.path_time())
    planner = geometric.BITstar(space.information)
    planner.setSamplesPerBatch(_BATCH)
    return planner, lambda early: _improved(planner, planner.numBatches() > options.effort or early.over)


def _improved(planner: Any, spent: bool) -> bool:
    return spent and isfinite(planner.bestCost().value())


def _connected(planner: Any, problem: Any) -> bool:
    """Return whether a path exists; optimising planners report it only when they end."""
    return bool(problem.hasExactSolution()) or (hasattr(planner, "bestCost") and isfinite(planner.bestCost().value()))


def _pieces(space: SearchSpace, problem: Any, options: SearchOptions) -> Made:
    from ompl import geometric

    planner = geometric.LBKPIECE1(space.information)
    planner.setRange(options.reach)
    planner.setProjectionEvaluator(space.tool_cells())
    return planner, lambda early: False


_PLANNERS: dict[Kind, Callable[[SearchSpace, Any, SearchOptions], Made]] = {
    "rrtconnect": _connect,
    "rrtstar": _star,
    "informed_rrtstar": _star,
    "bitstar": _batches,
    "kpiece": _pieces,
}
_ONE_TREE = ("rrtstar", "informed_rrtstar")


def _collect(planner: Any, space: SearchSpace, problem: Any, roots: tuple[Array, Array]) -> Search:
    from ompl import base, geometric

    data = base.PlannerData(space.information)
    if not isinstance(planner, geometric.BITstar):  # BIT* leaks memory after `getPlannerData` (OMPL 2.0.1)
        planner.getPlannerData(data)
    tags = np.array([data.getVertex(i).getTag() for i in range(data.numVertices())])
    if not (tags == _GOAL).any():
        tags[:] = _START  # one tree, whose states OMPL does not tag
    trees, sizes = [], []
    for tag, ends in zip((_START, _GOAL), roots, strict=True):
        members = np.flatnonzero(tags == tag)
        some = members[:: len(members) // TREE_SAMPLE + 1].tolist()
        trees.append(np.array([space.read(data.getVertex(i).getState()) for i in some]) if some else ends)
        sizes.append(max(len(members), len(ends)))
    path = None
    if problem.hasExactSolution():
        path = np.array([space.read(state) for state in problem.getSolutionPath().getStates()])
        for place, ends in zip((0, -1), roots, strict=True):
            path[place] = ends[np.argmin(np.abs(ends - path[place]).max(axis=1))]
    return Search(path, trees[0], trees[1], (sizes[0], sizes[1]))
