"""RRT-Connect of OMPL, made repeatable, interruptible and silent."""

import threading
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.model.robot import Limits
from optiplan.planners.base import Budget
from optiplan.planners.motion import MotionCheck

_TURN = np.pi  # rad beyond start and goals that a joint without bounds may go
_START, _GOAL = 1, 2  # OMPL's tags of the two trees
_SAMPLE = 500  # states of a tree that are reported
_OMPL = threading.Lock()  # OMPL's random numbers start from one seed of the whole process


@dataclass(frozen=True, eq=False)
class Search:
    """What a search left behind.

    Attributes:
        path: (k, n) waypoints from the start to one of the goals, rad or m; None when the trees did not meet.
        start_tree: (s, n) states reached from the start, at most some hundreds of them.
        goal_tree: (g, n) states from which a goal is reached, likewise.
        sizes: number of states of the two trees.
    """

    path: Array | None
    start_tree: Array
    goal_tree: Array
    sizes: tuple[int, int]


@dataclass(frozen=True)
class SearchOptions:
    """`reach`: longest tree edge in s at full joint speed (2-norm over joints); `seed` > 0; most `iterations`."""

    reach: float
    seed: int
    iterations: int | None = None


def rrt_connect(
    check: MotionCheck, ends: tuple[Array, Array], limits: Limits, budget: Budget, options: SearchOptions
) -> Search:
    """Two trees from the start (n,) and the goals (k, n) = `ends`, in coordinates q / velocity limit (s).

    Same arguments, same result, unless the budget cut it. Source: Kuffner and LaValle, "RRT-Connect", ICRA 2000.
    """
    from ompl import base, geometric, util

    while not _OMPL.acquire(timeout=0.02):
        if budget.over:
            return Search(None, ends[0][None], ends[1], (1, len(ends[1])))
    try:
        util.setLogLevel(util.LogLevel.LOG_NONE)
        util.RNG.setSeed(options.seed)
        problem, information = _describe(check, ends, limits)
        planner = geometric.RRTConnect(information)
        planner.setRange(options.reach)
        planner.setProblemDefinition(problem)
        planner.setup()
        turns = count() if options.iterations is None else iter(range(options.iterations))
        planner.solve(base.PlannerTerminationCondition(lambda: budget.over or next(turns, None) is None))
        return _collect(planner, problem, information, ends, limits)
    finally:
        _OMPL.release()


def _describe(check: MotionCheck, ends: tuple[Array, Array], limits: Limits) -> tuple[Any, Any]:
    """OMPL's problem and space information."""
    from ompl import base

    n, speed = check.model.robot.n, limits.velocity
    both = np.vstack([ends[0], ends[1]])
    low = np.where(np.isfinite(limits.lower), limits.lower, both.min(axis=0) - _TURN) / speed
    high = np.where(np.isfinite(limits.upper), limits.upper, both.max(axis=0) + _TURN) / speed
    space, bounds = base.RealVectorStateSpace(n), base.RealVectorBounds(n)
    for j in range(n):
        bounds.setLow(j, float(low[j]))
        bounds.setHigh(j, float(high[j]))
    space.setBounds(bounds)
    information = base.SpaceInformation(space)
    information.setStateValidityChecker(lambda state: not check.blocked(_read(state, n) * speed))

    class Validator(base.MotionValidator):  # type: ignore[misc]  # ompl has no types
        def checkMotion(self, a: Any, b: Any) -> bool:
            return check.free(_read(a, n) * speed, _read(b, n) * speed)

    information.setMotionValidator(Validator(information))
    information.setup()

    def state(q: Array) -> Any:
        result = information.allocState()
        for j, x in enumerate(np.clip(q / speed, low, high)):
            result[j] = float(x)
        return result

    problem, goals = base.ProblemDefinition(information), base.GoalStates(information)
    problem.addStartState(state(ends[0]))
    for q in ends[1]:
        goals.addState(state(q))
    problem.setGoal(goals)
    return problem, information


def _collect(planner: Any, problem: Any, information: Any, ends: tuple[Array, Array], limits: Limits) -> Search:
    from ompl import base

    n, speed = len(ends[0]), limits.velocity
    data = base.PlannerData(information)
    planner.getPlannerData(data)
    tags = np.array([data.getVertex(i).getTag() for i in range(data.numVertices())])
    trees, sizes = [], []
    for tag, roots in ((_START, ends[0][None]), (_GOAL, ends[1])):
        members = np.flatnonzero(tags == tag)
        some = members[:: len(members) // _SAMPLE + 1].tolist()
        trees.append(np.array([_read(data.getVertex(i).getState(), n) * speed for i in some]) if some else roots)
        sizes.append(len(members))
    path = None
    if problem.hasExactSolution():
        path = np.array([_read(x, n) for x in problem.getSolutionPath().getStates()]) * speed
        path[0] = ends[0]
        path[-1] = ends[1][np.argmin(np.abs(ends[1] - path[-1]).max(axis=1))]
    return Search(path, trees[0], trees[1], (sizes[0], sizes[1]))


def _read(state: Any, n: int) -> Array:
    return np.array([state[j] for j in range(n)])
