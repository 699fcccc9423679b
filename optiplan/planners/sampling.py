"""A free path from a start to one of several goals: sampled, shortened, and proved segment by segment."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.model.collision import CollisionModel, Contact
from optiplan.model.robot import Limits
from optiplan.planners.base import Budget, Failure
from optiplan.planners.failures import contact_witness, end_collides, out_of_time
from optiplan.planners.motion import MotionCheck
from optiplan.planners.search import Search, SearchOptions, rrt_connect
from optiplan.planners.shortcut import path_time, shorten
from optiplan.planners.sweep import Touch, polyline_contact
from optiplan.planners.torque import Gravity

_FINEST = 0.0125  # rad or m; the step is not halved below: blocked places do the rest
_DETOUR_ITERATIONS = 100
_DETOUR = 0.02  # rad or m (2-norm): how far to stay from a place where the proof failed
_RESERVE = 3e-3  # share of the torque limits kept free for gravity between the steps


@dataclass(frozen=True)
class SamplingOptions:
    """How to sample.

    Attributes:
        budget: when to stop.
        seed: of all random numbers.
        reach: longest tree edge, s at full joint speed.
        step: of the quick motion check, rad or m; halved where the proof of a segment fails.
        attempts: random shortcuts to try.
    """

    budget: Budget
    seed: int = 0
    reach: float = 0.4
    step: float = 0.05
    attempts: int = 120


@dataclass(frozen=True, eq=False)
class SampledPath:
    """Straight joint-space segments, each proved free at all its points.

    Attributes:
        waypoints: (k, n), rad or m; k >= 2.
        goal_index: which of the goals it ends in.
        cost: sum over segments of max_j |dq_j| / v_j, s, plus a tenth of the 2-norm (see `shortcut.path_time`).
        info: states of the search and repairs made, JSON-ready.
    """

    waypoints: Array
    goal_index: int
    cost: float
    info: dict[str, Any]


def sample_path(
    model: CollisionModel, start: Array, goals: list[Array], limits: Limits, options: SamplingOptions
) -> SampledPath | Failure:
    """Connect start (n,) with the goal (n,) that two growing trees reach first.

    Same arguments give the same path, unless the budget cut the work short. Failure kinds: `start-in-collision`,
    `goal-in-collision`, `no-path`, `cancelled`; the witness of `no-path` is where the two trees came nearest.
    """
    free_goals = [q for q in goals if not model.collides(q)]
    if model.collides(start):
        return end_collides(model, start, "start")
    if not free_goals:
        return end_collides(model, goals[0], "goal")
    sampler = _Sampler(model, limits, options)
    found = sampler.run(start, np.array(free_goals))
    if isinstance(found, Search):
        return _no_path(model, found, limits, options.budget)
    index = int(np.argmin([np.abs(q - found[-1]).max() for q in goals]))
    return SampledPath(found, index, float(path_time(found, limits.velocity).sum()), sampler.info)


class _Sampler:
    """One run of `sample_path`: search, shorten, prove; where the proof fails, block the place and go around it."""

    def __init__(self, model: CollisionModel, limits: Limits, options: SamplingOptions) -> None:
        self._model, self._limits, self._options = model, limits, options
        self._check = MotionCheck(model, options.step, Gravity(model.robot, limits.torque, _RESERVE))
        self._fine = options.step  # for shortcuts and detours; whole searches stay coarse, as they cost the most
        self._rng = np.random.default_rng(options.seed)
        self.info: dict[str, Any] = {"states": 0, "repairs": 0}

    def run(self, start: Array, goals: Array) -> Array | Search:
        """Proved waypoints (k, n), or the search that failed."""
        straight = self._check.free(start, goals[0])  # the best goal lies straight ahead
        path, attempts = (np.array([start, goals[0]]), 0) if straight else (None, 0)
        while True:
            if path is None:
                search = self._search(start, goals)
                if search.path is None:
                    return search
                path, attempts = search.path, self._options.attempts
            path = self._shorten(path, attempts)
            touch = polyline_contact(self._model, path)
            if touch is None:
                return path
            path, attempts = self._go_around(path, touch), self._options.attempts // 4

    def _search(self, start: Array, goals: Array, iterations: int | None = None) -> Search:
        self._check.step = self._options.step if iterations is None else self._fine
        seed = int(self._rng.integers(1, 2**31))
        options = SearchOptions(self._options.reach, seed, iterations)
        search = rrt_connect(self._check, (start, goals), self._limits, self._options.budget, options)
        self.info["states"] += sum(search.sizes)
        return search

    def _shorten(self, path: Array, attempts: int) -> Array:
        self._check.step = self._fine
        draws = self._rng.uniform(size=(attempts, 3))
        return shorten(self._check, path, self._limits.velocity, draws, self._options.budget)

    def _go_around(self, path: Array, touch: Touch) -> Array | None:
        """The path with a detour, or None where a short search finds none: then begin afresh."""
        self.info["repairs"] += 1
        self._fine = max(self._fine / 2.0, _FINEST)
        radius = min(_DETOUR, 0.5 * float(np.linalg.norm(path[[0, -1]] - touch.q, axis=1).min()))
        self._check.block(touch.q, radius)
        outside = np.linalg.norm(path - touch.q, axis=1) >= radius
        edge, indices = int(touch.t), np.arange(len(path))
        before, after = indices[outside & (indices <= edge)][-1], indices[outside & (indices > edge)][0]
        search = self._search(path[before], path[after][None], _DETOUR_ITERATIONS)
        if search.path is None:
            return None
        return np.vstack([path[:before], search.path, path[after + 1 :]])


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
