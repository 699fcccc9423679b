"""A free path from a start to one of several goals: searched for, shortened, every segment proved."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.model.collision import CollisionModel, Contact
from optiplan.model.robot import Limits
from optiplan.planners.base import Budget, Failure
from optiplan.planners.failures import contact_witness, end_collides, out_of_time
from optiplan.planners.motion import MotionCheck
from optiplan.planners.search import Search, Searcher, rrt_connect
from optiplan.planners.shortcut import path_time, shorten
from optiplan.planners.torque import Gravity

_RESERVE = 3e-3  # share of the torque limits kept free for gravity between the steps


@dataclass(frozen=True)
class SamplingOptions:
    """How to sample.

    Attributes:
        budget: when to stop.
        seed: of all random numbers.
        attempts: random shortcuts to try.
        searcher: finds a first path.
    """

    budget: Budget
    seed: int = 0
    attempts: int = 120
    searcher: Searcher = rrt_connect


@dataclass(frozen=True, eq=False)
class SampledPath:
    """Straight joint-space segments, each proved free at all its points.

    Attributes:
        waypoints: (k, n), rad or m; k >= 2.
        goal_index: which of the goals it ends in.
        cost: sum over segments of max_j |dq_j| / v_j, s, plus a tenth of the 2-norm (see `shortcut.path_time`).
        info: number of `states` the search looked at, and whether it was `cut_short` by the clock; JSON-ready.
    """

    waypoints: Array
    goal_index: int
    cost: float
    info: dict[str, Any]


def sample_path(
    model: CollisionModel, start: Array, goals: list[Array], limits: Limits, options: SamplingOptions
) -> SampledPath | Failure:
    """Connect start (n,) with one of the goals (n,): straight ahead with the first where that is free, else by search.

    Same arguments give the same path, unless the budget cut the work short. Failure kinds: `start-in-collision`,
    `goal-in-collision`, `no-path`, `cancelled`; the witness of `no-path` is where the two trees came nearest.
    """
    free_goals = np.array([q for q in goals if not model.collides(q)])
    if model.collides(start):
        return end_collides(model, start, "start")
    if not len(free_goals):
        return end_collides(model, goals[0], "goal")
    check = MotionCheck(model, limits, Gravity(model.robot, limits.torque, _RESERVE))
    path, info = np.array([start, free_goals[0]]), {"states": 0, "cut_short": False}
    if not check.free(start, free_goals[0]):
        rng = np.random.default_rng(options.seed)
        found = options.searcher(check, (start, free_goals), options.budget, int(rng.integers(1, 2**31)))
        if found.path is None:
            return _no_path(model, found, limits, options.budget)
        draws = rng.uniform(size=(options.attempts, 3))
        path = shorten(check, found.path, limits.velocity, draws, options.budget)
        info = {"states": sum(found.sizes), "cut_short": found.cut_short}
    index = int(np.argmin([np.abs(q - path[-1]).max() for q in goals]))
    return SampledPath(path, index, float(path_time(path, limits.velocity).sum()), info)


def _no_path(model: CollisionModel, search: Search, limits: Limits, budget: Budget) -> Failure:
    if budget.cancelled:
        return out_of_time(budget, "searching for a path")
    a, b = _nearest(search.start_tree, search.goal_tree, limits.velocity)
    q, contact = _first_blocked(model, a, b)
    gap = float(np.abs(b - a).max())
    detail = (
        f"no path within {budget.seconds:.3g} s: the tree from the start ({search.sizes[0]} states) and that "
        f"from the goal ({search.sizes[1]} states) stay {gap:.3g} rad or m apart (largest joint)"
    )
    if contact is None:
        return Failure("no-path", detail, {"q": q.tolist(), "q_goal_side": b.tolist()})
    detail += f"; between them '{contact.pair.name_a}' meets '{contact.pair.name_b}'"
    return Failure("no-path", detail, {**contact_witness(q, contact), "q_goal_side": b.tolist()})


def _nearest(A: Array, B: Array, velocity: Array) -> tuple[Array, Array]:
    """The states of two trees (s, n), (g, n) nearest to each other in time at full speed."""
    A, B = A / velocity, B / velocity
    a = A[np.argmin([np.abs(B - x).max(axis=1).min() for x in A])]
    return a * velocity, B[np.argmin(np.abs(B - a).max(axis=1))] * velocity


def _first_blocked(model: CollisionModel, a: Array, b: Array) -> tuple[Array, Contact | None]:
    """First colliding configuration on the way from a to b and its contact; (a, None) when a fine walk sees none."""
    steps = max(2, int(np.ceil(np.abs(b - a).max() / 0.01)))
    for fraction in np.linspace(0.0, 1.0, steps):
        q = a + fraction * (b - a)
        if model.collides(q):
            return q, model.clearance(q)
    return a, None
