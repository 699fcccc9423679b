"""Find a free path from a start to one of several goals: search, shorten, every segment proved."""

from collections.abc import Callable, Iterator
from dataclasses import field, replace
from functools import partial
from itertools import cycle
from math import ceil
from typing import Any, NamedTuple

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.contacts import Contact
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget, Failure
from optiplan.planners.common.failures import contact_witness, end_collides, out_of_time
from optiplan.planners.common.gravity import Gravity
from optiplan.planners.common.tolerances import LEAST_GAIN, NO_MOTION
from optiplan.planners.sampling.edge_checker import MotionCheck, PartialCheck
from optiplan.planners.sampling.local_searches import box_of_paths
from optiplan.planners.sampling.ompl_search import ALTERNATE_RATIO, kpiece, rrt_connect
from optiplan.planners.sampling.ompl_space import Ends
from optiplan.planners.sampling.search import Search, Searcher
from optiplan.planners.sampling.shortcutting import path_cost, path_times, shorten
from optiplan.records import dataclass
from optiplan.robot.robot import Limits
from optiplan.trajectory.timing.lower_bound import lower_bounds

_RESERVE = 3e-3  # share of the torque limits kept free for gravity between the steps
_BEHIND = 1.0 / 3.0  # share of the budget for a search that has a straight line to fall back on
_NEAR, _PATIENCE, _GROWTH = 500, 1500, 3.0  # iterations near the ends, of the round after, and factor to each later one
_LATE, _RELAXED = 2, 90e3  # round of the searcher, from 0, before which `relaxed` has one; its iterations
_FRESH = 4  # new goals requested between two rounds
_FEW, _MORE = 40, 120  # shortcuts of a path that is needed soon, and as many more at a time
_STRAIGHT, _GAIN = 1.2, 0.01  # cost / cost of a straight line above which it gets more, while they save this share
_SHORT = 0.5  # s: least distance of the ends assumed for the detour and for short motions
_STALE = 3  # rounds in a row that gain nothing end the search for shorter paths
_IMPROVING = 0.7  # share of the budget for it; the rest is for timing


@dataclass(frozen=True)
class SamplingOptions:
    """Options of sampling.

    Attributes:
        budget: when to stop.
        seed: of all random numbers.
        attempts: random shortcuts to try.
        soon: whether a path gets few of them where it is nearly straight, else more while they gain, and whether
            `searcher` samples configurations on short motions first.
        searcher: finds a first path.
        alternate: second searcher, in turn with the first where that needs several rounds; None: none. Where the check
            is the native core's there is no such turn: the first searcher gets out of narrow places by itself there.
        detour: the first round samples only configurations through which a path can take at most this factor of
            the straight line's time; infinite: everywhere.
        longest: longest time at full speed, s, of paths of later rounds: they sample only configurations on such
            paths, those on short motions first.
        improve: searcher for shorter paths, each time where only such can pass, until it gains nothing more.
        more_goals: returns up to this many new goals between rounds; polls its second argument.
        relaxed: third searcher, in later rounds; None: none.
        begun: rounds of the schedule to skip, since earlier calls have made them; 0 begins near the ends.
        explain: whether a failure says at once where the trees came nearest; else it is a `NoPath`.
    """

    budget: Budget
    seed: int = 0
    attempts: int = 120
    soon: bool = False
    searcher: Searcher = rrt_connect
    alternate: Searcher | None = kpiece
    detour: float = 2.0
    longest: float = np.inf
    improve: Searcher | None = None
    more_goals: Callable[[int, Callable[[], bool]], list[Array]] = field(default=lambda count, stop: [])
    relaxed: Searcher | None = None
    begun: int = 0
    explain: bool = True


@dataclass(frozen=True)
class NoPath(Failure):
    """Failure of a search that is explained when somebody asks: that can take as long as the search.

    Attributes:
        explained: returns the failure with the place where the trees came nearest.
    """

    explained: Callable[[], Failure] = field(kw_only=True, repr=False)


class SampledPath(NamedTuple):
    """Straight joint-space segments, each proved free at all its points.

    Attributes:
        waypoints: (k, n), rad or m; k >= 2.
        goal_index: which of the goals it ends in; -1 for one that was drawn while searching.
        cost: sum over segments of max_j |dq_j| / v_j, s, plus a tenth of the 2-norm (see `shortcutting.path_time`).
        info: number of `states` of the search, and whether the clock `cut_short` it; JSON-ready.
    """

    waypoints: Array
    goal_index: int
    cost: float
    info: dict[str, Any]


def sample_path(
    check: MotionCheck, start: Array, goals: list[Array], options: SamplingOptions
) -> SampledPath | Failure:
    """Connect start (n,) with one of the goals (n,): straight ahead with the first where that is free, else by search.

    A straight line to another goal that is free is the answer unless the search, for which it leaves a third of the
    budget, finds a shorter path. Same arguments give the same path, unless the budget cut the work short. `check` is
    made by `path_check`, once for all searches among the same obstacles.

    Failure kinds: `start-in-collision`, `goal-in-collision`, `no-path`, `cancelled`; the witness of `no-path` is where
    the two trees came nearest.
    """
    model, limits = check.model, check.limits
    free_goals = np.array([q for q in goals if not model.collides(q)])
    if model.collides(start):
        return end_collides(model, start, "start")
    if not len(free_goals):
        return end_collides(model, goals[0], "goal")
    straight = next((np.array([start, q]) for q in free_goals if check.free(start, q)), None)
    if straight is not None and np.array_equal(straight[-1], free_goals[0]):
        path, info = straight, {"states": 0, "cut_short": False}
    else:
        budget = options.budget if straight is None else options.budget.share(_BEHIND)
        rng = np.random.default_rng(options.seed)
        found = _rounds(check, (start, free_goals), replace(options, budget=budget, improve=None), rng)
        if found.path is None and straight is None:
            explained = partial(_no_path, model, found, (start, free_goals), limits, options.budget)
            return explained() if options.explain else NoPath("no-path", "no path found", explained=explained)
        path = _shorter(check, [straight, found.path], free_goals, options, rng)
        info = {"states": sum(found.sizes), "cut_short": found.cut_short or (budget.over and found.path is None)}
        if options.improve is not None:
            improving = replace(options, searcher=options.improve)
            path, more = _improved(check, path, (start, free_goals), improving, rng)
            info = {"states": info["states"] + more["states"], "cut_short": info["cut_short"] or more["cut_short"]}
    distances = [np.abs(q - path[-1]).max() for q in goals]
    index = int(np.argmin(distances)) if min(distances) < NO_MOTION else -1
    return SampledPath(path, index, path_cost(path, limits.velocity), info)


def path_check(model: CollisionModel, limits: Limits) -> MotionCheck:
    """Return the check of edges for `sample_path`."""
    return MotionCheck(model, limits, Gravity(model.robot, limits.torque, _RESERVE))


def _shorter(
    check: MotionCheck, paths: list[Array | None], goals: Array, options: SamplingOptions, rng: np.random.Generator
) -> Array:
    """Shorten each path to one of some goals (k, n) and return the cheapest."""
    velocity, draws = check.limits.velocity, rng.uniform(size=(options.attempts, 3))
    known = [path for path in paths if path is not None]
    if options.soon:
        direct = path_times(np.broadcast_to(known[0][0], goals.shape), goals, velocity).min()
        short = [_shorter_soon(check, path, float(direct), draws, options.budget) for path in known]
    else:
        short = [shorten(check, path, velocity, draws, options.budget) for path in known]
    return min(short, key=lambda path: path_cost(path, velocity))


def _shorter_soon(check: MotionCheck, path: Array, direct: float, draws: Array, budget: Budget) -> Array:
    """Shorten a path until it costs little more than a straight line (`direct`, s), or shortcuts gain little."""
    velocity = check.limits.velocity
    cost, count = np.inf, _FEW
    while cost > _STRAIGHT * direct and len(draws):
        path, draws, before = shorten(check, path, velocity, draws[:count], budget), draws[count:], cost
        cost, count = path_cost(path, velocity), _MORE
        if cost > (1.0 - _GAIN) * before:
            break
    return path


def _rounds(check: MotionCheck, ends: Ends, options: SamplingOptions, rng: np.random.Generator) -> Search:
    """Search in rounds of growing patience, the first one near the ends alone, each later one with fresh goals.

    The goals take turns at being the first, since OMPL roots a tree in another one only when it has grown in those
    before it. A search without a path is started anew, because the time that random trees take is heavy-tailed.
    Source: Gomes, Selman and Kautz, "Boosting combinatorial search through randomization", AAAI 1998.
    """
    start, goals = ends
    schedule, near = _schedule(check, options), bool(np.isfinite(options.detour)) and not options.begun
    while True:
        seed = int(rng.integers(1, 2**31))
        if near:
            straight = np.maximum((np.abs(goals - start) / check.limits.velocity).max(axis=1), _SHORT)
            found = _near_the_ends(check, (start, goals), options.detour * straight, options, seed)
        else:
            now = next(schedule)
            measure = now.measure
            short_first = options.soon and now.searcher is options.searcher and measure.native is not None
            if short_first or np.isfinite(options.longest):
                box = box_of_paths(start, goals, np.full(len(goals), options.longest), measure.limits)
                least = max(float(lower_bounds(start, goals, measure.limits).min()), _SHORT)
                measure = PartialCheck(measure, start, np.ones(len(start), dtype=bool), box, least)
            found = now.searcher(measure, (start, goals), options.budget, seed, patience=now.patience)
        if not found.impatient or options.budget.over:
            return found
        if not near:
            fresh = options.more_goals(_FRESH, lambda: options.budget.over)
            goals = np.vstack([goals[1:], *fresh, goals[:1]])
        near = False


class _SearchRound(NamedTuple):
    """A searcher, the check whose units measure distances, and the patience."""

    searcher: Searcher
    measure: MotionCheck
    patience: float


def _schedule(check: MotionCheck, options: SamplingOptions) -> Iterator[_SearchRound]:
    """Yield the rounds.

    Distances are measured in space, by what moves the robot: a slow joint is far in time and near in space. The
    searcher takes long and short steps in turn. After each of its rounds `alternate` has one of about the same time.
    `relaxed` comes after each of both from the second round of `alternate` on: its patience is constant, the number of
    its searches grows.
    """
    moment_arms, patience = check.by_moment_arms(), float(_PATIENCE)
    measures = (moment_arms, moment_arms.finer()) if np.isfinite(options.detour) else (check,)
    others = [] if options.relaxed is None else [_SearchRound(options.relaxed, moment_arms, _RELAXED)]
    for number, measure in enumerate(cycle(measures)):
        times = _GROWTH ** (number - _LATE)
        if number >= options.begun:
            yield _SearchRound(options.searcher, measure, patience)
            yield from others * int(times)
            if options.alternate is not None and check.native is None:
                yield _SearchRound(options.alternate, moment_arms, ALTERNATE_RATIO * patience)
        yield from others * ceil(times) * (number >= _LATE - 1)
        patience *= _GROWTH


def _improved(
    check: MotionCheck, path: Array, ends: Ends, options: SamplingOptions, rng: np.random.Generator
) -> tuple[Array, dict[str, Any]]:
    """Improve a path by rounds of a search that samples only where shorter paths can pass.

    They end when `_STALE` of them in a row have gained less than 1 %, or most of the budget is gone.
    """
    velocity, (start, goals) = check.limits.velocity, ends
    late, stale, states, cut_short = options.budget.share(_IMPROVING), 0, 0, False
    cost = path_cost(path, velocity)
    while stale < _STALE and not late.over:
        within = goals[path_times(np.broadcast_to(start, goals.shape), goals, velocity) <= cost]
        seed = int(rng.integers(1, 2**31))
        if not len(within):
            break
        each = np.full(len(within), cost)
        found = _near_the_ends(check, (start, within), each, replace(options, budget=late), seed)
        states, cut_short = states + sum(found.sizes), cut_short or found.cut_short
        shorter = _shorter(check, [path, found.path], within, options, rng)
        gained = cost - path_cost(shorter, velocity)
        stale = stale + 1 if gained < LEAST_GAIN * cost else 0
        path, cost = shorter, cost - gained
    return path, {"states": states, "cut_short": cut_short or late.over}


def _near_the_ends(check: MotionCheck, ends: Ends, longest: Array, options: SamplingOptions, seed: int) -> Search:
    """Search where paths to goal k can pass in at most longest[k], s; a first path, with the joints that must move."""
    start, goals = ends
    box = box_of_paths(start, goals, longest, check.limits)
    joints = (np.abs(goals - start).max(axis=0) > NO_MOTION) | (options.improve is not None)
    part = PartialCheck(check, start, joints, box)
    within = (start[joints], goals[:, joints])
    found = options.searcher(part, within, options.budget, seed, patience=_NEAR)
    path = None if found.path is None else part.lift(found.path)
    if path is not None:
        path[-1] = goals[np.argmin(np.abs(goals - path[-1]).max(axis=1))]
    return replace(found, path=path, start_tree=part.lift(found.start_tree), goal_tree=part.lift(found.goal_tree))


def _no_path(model: CollisionModel, search: Search, ends: Ends, limits: Limits, budget: Budget) -> Failure:
    if budget.cancelled:
        return out_of_time(budget, "searching for a path")
    a, b = _nearest(search.start_tree, search.goal_tree, limits.velocity)
    q, contact = _first_blocked(model, a, b)
    detail = (
        f"no path within {budget.seconds:.3g} s: the tree from the start ({search.sizes[0]} states) and that "
        f"from the goal ({search.sizes[1]} states) "
    )
    if contact is None:  # KPIECE checks edges late: its trees hold states that nothing joins to their roots as yet
        a, b = _nearest(ends[0][None], ends[1], limits.velocity)
        q, contact = _first_blocked(model, a, b)
        detail += "are not joined; on the straight line from the start to the goal"
    else:
        detail += f"stay {np.abs(b - a).max():.3g} rad or m apart (largest joint); between them"
    if contact is None:
        return Failure("no-path", f"{detail} nothing is met", {"q": q.tolist(), "q_goal_side": b.tolist()})
    detail += f" {contact.meeting}"
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
