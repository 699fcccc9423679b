"""Options and results of a search for a path; RRT-Connect in the native core."""

from math import ceil, inf
from typing import Literal, NamedTuple, Protocol

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array, Flags
from optiplan.planners.base import Budget
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.sampling.ompl_space import Ends, search_bounds
from optiplan.records import dataclass

Kind = Literal["rrtconnect", "rrtstar", "informed_rrtstar", "bitstar", "kpiece"]

TREE_SAMPLE = 500
"""States of a tree reported, at most."""

_SLICE = 0.02  # s between looks at the budget


@dataclass(frozen=True, eq=False)
class Search:
    """Result of a search.

    Attributes:
        path: (k, n) waypoints from the start to one of the goals, rad or m; None when none was found.
        start_tree: (s, n) states reached from the start, at most some hundreds of them.
        goal_tree: (g, n) states from which a goal is reached, likewise; the goals alone where one tree is grown. BIT*
            does not show its tree.
        sizes: number of states of the two trees.
        cut_short: the time limit ended it before its effort was spent.
        impatient: it ended without a path because its patience was spent, or its trees full, not the budget.
    """

    path: Array | None
    start_tree: Array
    goal_tree: Array
    sizes: tuple[int, int]
    cut_short: bool = False
    impatient: bool = False


class SearchOptions(NamedTuple):
    """Options of a search.

    Attributes:
        kind: which of OMPL's planners.
        reach: longest tree edge, s at full joint speed (2-norm over joints).
        effort: iterations (batches of samples for `bitstar`) after which an improving path is good enough. A search
            without a path goes on until it has one. When most of the budget is gone, any path is good enough.
    """

    kind: Kind
    reach: float = 0.4
    effort: int = 0


class Searcher(Protocol):
    """Protocol of `search` with its options given."""

    def __call__(self, check: MotionCheck, ends: Ends, budget: Budget, seed: int, *, patience: float) -> Search:
        """See `search`."""
        ...


def native_rrt_connect(
    check: MotionCheck, ends: Ends, budget: Budget, seed: int, reach: float, *, patience: float = inf
) -> Search:
    """Run RRT-Connect of the native core; see `ompl_search.search`."""
    assert check.native is not None
    still, joints = check.searched
    (start, goals), n = ends, len(still)
    limits = check.limits
    rows = np.vstack([*search_bounds(limits, ends), check.units, limits.velocity, limits.acceleration])
    places = np.flatnonzero(joints)
    roots = np.ascontiguousarray(start), np.ascontiguousarray(goals)
    carriers = carrying(check.model.robot.revolute[joints])
    trees = core.RrtConnect(check.native, still, places, rows, check.least, carriers, *roots, reach, seed)
    while not (trees.met or trees.full or budget.over or trees.iterations >= patience):
        left = ceil(min(patience - trees.iterations, 1e6))
        trees.grow(left, min(_SLICE, budget.remaining))
    path = None
    if trees.met:
        path = trees.path(n)[:, places]
        path[0], path[-1] = start, goals[np.argmin(np.abs(goals - path[-1]).max(axis=1))]
    samples = [trees.sample(tree, TREE_SAMPLE, n)[:, places] for tree in (0, 1)]
    impatient = path is None and not budget.over
    return Search(path, samples[0], samples[1], (trees.size(0), trees.size(1)), impatient=impatient)


def carrying(turns: Flags) -> int:
    """Return how many of the joints, (m,), the first ones, carry the others about: those of a base that drives.

    They are joints that slide, at least two, and the first one that turns; a single one that slides lifts an arm.
    """
    slide = int(np.argmax(turns)) if turns.any() else 0
    return slide + 1 if 1 < slide < len(turns) - 1 else 0
