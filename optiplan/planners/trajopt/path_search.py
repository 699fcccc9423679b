"""Sampled paths for `trajopt`: the searches, and motions along a path without optimisation."""

from collections.abc import Callable
from dataclasses import field, replace

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget, Failure
from optiplan.planners.common.context import Stopwatch
from optiplan.planners.common.failures import too_heavy
from optiplan.planners.common.goal_ranking import GoalSampler
from optiplan.planners.common.path_timing import stopping, timed_path
from optiplan.planners.sampling.constrained.seeds import ConstrainedSeeds
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.sampling.ompl_search import ALTERNATE_RATIO, kpiece, rrt_connect
from optiplan.planners.sampling.sample_path import SampledPath, SamplingOptions, path_check, sample_path
from optiplan.planners.sampling.shrunk_obstacles import among_thinner, through_thinner
from optiplan.planners.trajopt.coarse_descents import CoarseCurve, CoarseDescents, GuessPath
from optiplan.planners.trajopt.curve_incumbent import CurveIncumbent
from optiplan.planners.trajopt.stopping_rule import STATE, Patience, counted
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory

_QUICK = 0.065
"""Work, s, of a search for a first motion between the real obstacles."""

_ROUNDS = 2
"""Rounds that such searches make, which a search after them leaves out."""

_SOON = 1.05
"""Bound / least bound of an end up to which a first motion may lead to it."""

_COMPARED, _PROMISING = 3, 0.9
"""Paths compared before one is optimised, and the cost / cost of the best curve of a coarse curve that ends it."""

_SHORTCUTS, _FIRST_SHORTCUTS = 60, 1000
"""Shortcuts of a path for a coarse curve, and the most of one for a first motion."""

_COUNTED = 120
"""Shortcuts of a path that count as work, at most: what a first one mostly gets."""

_DEPTHS = 0.015, 0.005, 0.0
"""Thickness, m, removed from all sides of obstacles; a failed attempt moves on to the next value."""

_AT_ONCE = (0.0, 0.003), (_DEPTHS[0], 0.1), (0.0, _QUICK), (_DEPTHS[0], 0.1), (_DEPTHS[0], 0.13)
"""Thickness, m, removed from obstacles, and work, s, of the searches for a first motion before a straight line is
optimised."""

_HARD = 2
"""Attempts between thinner obstacles before a first motion is searched between the real ones."""

_FIRST, _TRIED = 1.5, 4
"""Work, s, of a search between thinner obstacles for a first motion, and the largest number of paths tried there.

A search between the real obstacles takes longer, and so does its repair.
"""

_ONE = 0.3
"""Work, s, of a search once there is a motion; doubled after each search in vain."""

_SEARCH, _FIRST_SEARCH = 0.5, 0.8
"""Shares of the remaining budget for one path search: once there is a motion, and before."""

_NO_GOAL = Failure(
    "no-path", "no end of the goal keeps the path constraints and can be reached sooner than by the best motion"
)


@dataclass(eq=False)
class PathSearch:
    """Searches for paths, one seed after the other, and offers the motions along them.

    Attributes:
        problem: to plan.
        model: of its robot in its scene.
        budget: of the run.
        patience: counts the work of searches, and ends them.
        incumbent: takes the motions along paths.
        watch: of the run.
        coarse: short descents.
        searches: begun so far.
        begun: rounds that the next search omits, as they just failed.
        found: path found before a line was optimised, not optimised yet.
        depth: index in `_DEPTHS` for the next search between thinner obstacles.
        in_vain: searches since the last path found.
        settled: whether the spans of curves are, since others have curves of so many.
    """

    problem: Problem
    model: CollisionModel
    budget: Budget
    patience: Patience
    incumbent: CurveIncumbent
    watch: Stopwatch
    coarse: CoarseDescents
    searches: int = 0
    found: SampledPath | None = None
    begun: int = 0
    depth: int = 0
    in_vain: int = 0
    settled: bool = False
    _waiting: list[tuple[SampledPath, CoarseCurve]] = field(default_factory=list)
    _checks: dict[float, MotionCheck] = field(default_factory=dict)
    _proved: tuple[Array, bool] | None = None
    _on_constraints: ConstrainedSeeds = field(init=False)

    def __post_init__(self) -> None:
        self._on_constraints = ConstrainedSeeds(self.problem, self.model)

    def promising(self, sampler: GoalSampler) -> list[Array]:
        """Return the goals whose lower bound is below the best motion, soonest first."""
        incumbent = self.incumbent
        goals = [q for q in sampler.configurations if incumbent.constraints.end_holds(q)]
        bounds = self.problem.lower_bounds(goals)
        costs = [incumbent.cost_bound(float(bound)) for bound in bounds]
        return [q for q, cost in zip(goals, costs, strict=True) if cost < incumbent.cost]

    def at_once(self, sampler: GoalSampler) -> Failure | None:
        """Search briefly for a path if there is no motion, and offer a curve from it or it with its stops.

        A path that is checked here and there is found soonest, and mostly does: it is the curve that has to be free.
        Where none is found at a glance, one between thinner obstacles is, and the curve from it mostly leaves them; it
        is often the shorter one. Return why the last search found no path, if so.
        """
        if self.incumbent.candidates or self.searches or self._on_constraints.apply:
            return None
        failure: Failure | None = None
        for depth, work in _AT_ONCE:
            path = self._between_thinner(sampler, depth, work) if depth else self._between_real(sampler, work)
            if isinstance(path, Failure):
                failure = path
            else:
                self.found, failure = path, None
            if self.incumbent.candidates:
                break
        return failure

    def _between_thinner(self, sampler: GoalSampler, depth: float, work: float) -> SampledPath | Failure:
        path = self._briefly(sampler, self._check(depth), work)
        self.begun = _ROUNDS
        if isinstance(path, SampledPath):
            self._first(path.waypoints)
        return path

    def _between_real(self, sampler: GoalSampler, work: float) -> SampledPath | Failure:
        """Search for a path here and there; where neither its curve nor it is free, for a path that is proved."""
        path = self._briefly(sampler, self._check().here_and_there(), work)
        if isinstance(path, Failure) or self.incumbent.candidates or self.free(path.waypoints):
            return path
        return self._briefly(sampler, self._check(), _QUICK)

    def _briefly(self, sampler: GoalSampler, check: MotionCheck, work: float) -> SampledPath | Failure:
        if not (goals := self.promising(sampler)):
            return _NO_GOAL
        bounds = self.problem.lower_bounds(goals)
        soon = [q for q, bound in zip(goals, bounds, strict=True) if bound <= _SOON * bounds[0]]
        return self._sample(sampler, check, self.patience.seconds + work, None, soon)

    def next(self, sampler: GoalSampler, repair: Callable[[Array], Array | None]) -> GuessPath | Failure:
        """Return the next guess to optimise; `repair` as in `through_thinner`.

        Once there is a motion, several paths are sampled between thinner obstacles: there, more paths exist and
        searches are shorter. After a failure, the obstacles are thicker. A coarse curve descends from each path, and
        the shortest is returned first; the others are kept. After a short search in vain for a first motion, paths
        between thinner obstacles come next, until one coarse curve leaves the obstacles; then a longer search. A
        search ends when it is no longer worth its work.
        """
        found, self.found = self.found, None
        constrained, none = self._on_constraints.apply, not self.incumbent.candidates
        if found is None and none and not constrained and self.searches and self.depth < _HARD:
            guess = self._compared(sampler, None, _TRIED, enough=1)
            if isinstance(guess, GuessPath):
                return guess
            self.depth = _HARD
        if found is None and (constrained or none):
            path = self._sample(sampler, self._check(), self.patience.seconds + self._longest_search, repair)
            if isinstance(path, Failure):
                return path
            if constrained or self.incumbent.curve is not None or not self.incumbent.candidates:
                return GuessPath(path)
            found = path
        return self._compared(sampler, found, _COMPARED)

    def record(self, free: bool) -> None:
        """Record whether the last guess became a free motion."""
        self.depth = 0 if free else (self.depth + 1) % len(_DEPTHS)
        if not free:
            self._waiting.clear()

    def _compared(
        self, sampler: GoalSampler, found: SampledPath | None, count: int, enough: float = np.inf
    ) -> GuessPath | Failure:
        """Compare `found` and new paths by coarse descents; return the best guess not optimised yet.

        At most `count` paths are compared. `enough` guesses end it, and so does one far shorter than the best curve.
        """
        best = rough = self.incumbent.rough
        failure = Failure("no-path", "the curves along all paths stay in obstacles")
        for _ in range(count):
            if len(self._waiting) >= enough:
                break
            path, known, found = found or self._another(sampler), found is not None, None
            if isinstance(path, Failure):
                failure, self.depth, self.in_vain = path, 0, self.in_vain + 1
                break
            if not (known or self.incumbent.candidates):
                self._first(path.waypoints)
            model = self._check(_DEPTHS[self.depth]).model
            curve = self.coarse.descend(model, path, best)
            if curve is None and self._follow(path):
                if not self.incumbent.candidates:
                    self._first(path.waypoints)
                curve = self.coarse.descend(model, path, best)
            if curve is not None:
                self._waiting.append((path, curve))
                best = min(best, self.incumbent.cost_bound(curve.duration))
                if np.isfinite(rough) and self.incumbent.cost_bound(curve.duration) < _PROMISING * rough:
                    break
        self._waiting.sort(key=lambda one: one[1].duration)
        return GuessPath(*self._waiting.pop(0)) if self._waiting else failure

    def anew(self, patience: Patience, incumbent: CurveIncumbent) -> "PathSearch":
        """Return searches from the first seed that share only the collision models."""
        coarse = replace(self.coarse, patience=patience)
        fresh = PathSearch(
            incumbent.problem, self.model, self.budget, patience, incumbent, self.watch, coarse, settled=True
        )
        fresh._checks = self._checks
        return fresh

    def toward(self, sampler: GoalSampler, goals: list[Array], most: float) -> CoarseCurve | None:
        """Return the coarse curve from a path to one of some goals (n,), found within `most` of work, s, or None.

        The path is sampled between thinner obstacles, or the real ones where the straight line is free there.
        """
        for depth in (_DEPTHS[0], _DEPTHS[-1]):
            check = self._check(depth)
            path = self._sample(sampler, check, self.patience.seconds + most, None, goals)
            if isinstance(path, Failure):
                return None
            if len(path.waypoints) > 2 or not depth:
                return self.coarse.descend(check.model, path, self.incumbent.rough)
        return None

    def _another(self, sampler: GoalSampler) -> SampledPath | Failure:
        """Return a path between thinner obstacles; thicker ones where the straight line is free."""
        while True:
            one = _ONE * 2.0**self.in_vain if self.incumbent.candidates else _FIRST
            most = self.patience.seconds + min(self._longest_search, one)
            path = self._sample(sampler, self._check(_DEPTHS[self.depth]), most, None)
            if isinstance(path, Failure) or len(path.waypoints) > 2 or not _DEPTHS[self.depth]:
                return path
            self.depth += 1

    @property
    def _longest_search(self) -> float:
        """Return the work, s, after which to stop without a gain."""
        incumbent = self.incumbent
        return self.patience.worth(incumbent.cost, incumbent.bound) if incumbent.candidates else np.inf

    def _check(self, depth: float = 0.0) -> MotionCheck:
        """Return the path check between obstacles thinner by `depth`, m; there a path is only a guess."""
        if depth not in self._checks:
            if depth:
                self._checks[depth] = self._check().among(among_thinner(self.model, depth)).here_and_there()
            else:
                self._checks[depth] = path_check(self.model, self.problem.limits)
        return self._checks[depth]

    def _sample(
        self,
        sampler: GoalSampler,
        check: MotionCheck,
        most: float,
        repair: Callable[[Array], Array | None] | None,
        aims: list[Array] | None = None,
    ) -> SampledPath | Failure:
        """Return a path of the next seed to a promising goal, or to one of `aims` (n,), within `most` of total work, s.

        Searches between thinner obstacles omit the short first rounds: a long round finds a path sooner.
        """
        number, begun = self.searches, _ROUNDS
        if real := check.model is self.model:
            begun, self.begun = self.begun, 0
        self.searches = number + 1
        share = _SEARCH if self.incumbent.candidates else _FIRST_SEARCH
        budget = self.budget.leaving((1.0 - share) * self.budget.remaining)
        with self.watch.stage("sampling"):
            goals = self.promising(sampler) if aims is None else aims
            if not goals:
                return _NO_GOAL
            if self._on_constraints.apply:
                return self._on_constraints.path(goals, budget, number)
            relaxed = None if repair is None else through_thinner(repair)
            options = SamplingOptions(
                budget,
                seed=self.problem.seed + 1000 * number,
                attempts=_SHORTCUTS if self.incumbent.candidates else _FIRST_SHORTCUTS,
                soon=not self.incumbent.candidates,
                searcher=counted(rrt_connect, self.patience, most),
                alternate=counted(kpiece, self.patience, most, STATE / ALTERNATE_RATIO),
                relaxed=counted(relaxed, self.patience, most, STATE / ALTERNATE_RATIO) if relaxed else None,
                longest=np.inf if real else self.incumbent.longest,
                more_goals=sampler.more if aims is None else lambda count, stop: [],
                begun=begun,
                explain=False,
            )
            path = sample_path(check, self.problem.start, goals, options)
        self.patience.work(shortcuts=min(options.attempts, _COUNTED) if isinstance(path, SampledPath) else 0)
        self.incumbent.info["cut_short"] |= isinstance(path, Failure) and budget.over
        if real and isinstance(path, SampledPath) and not self.incumbent.candidates:
            self._first(path.waypoints)
        return path

    def _follow(self, path: SampledPath) -> bool:
        """Give curves the spans that they need to follow a path; return whether these are more.

        Where there are curves already, their spans have to do.
        """
        settled = self.settled or self._waiting or self.incumbent.curve is not None
        return not settled and self.coarse.follow(path.waypoints)

    def free(self, waypoints: Array) -> bool:
        """Return whether a path (k, n) is free between the real obstacles; asked again of the last one, it knows."""
        if self._proved is None or self._proved[0] is not waypoints:
            self._proved = waypoints, self._check().polyline_free(waypoints)
        return self._proved[1]

    def offer_first(self, path: SampledPath) -> Failure | None:
        """Offer the motion along a path that takes the least time to compute."""
        return self.offer_timed(path) if self._on_constraints.apply else self._first(path.waypoints)

    def offer_timed(self, path: SampledPath) -> Failure | None:
        """Offer the motion along a path, timed with its corners rounded."""
        with self.watch.stage("timing of sampled paths"):
            timed = self._on_constraints.motion(path, self.incumbent.constraints, self.budget)
            if timed is None:
                timed = timed_path(self.model, path.waypoints, self.problem.limits, self.budget)
        return timed if isinstance(timed, Failure) else self._offer(path.waypoints, timed)

    def _first(self, waypoints: Array) -> Failure | None:
        """Offer a curve from a path after a few steps; where that is not free, the path with a stop at every corner."""
        with self.watch.stage("optimisation"):
            curve = self.coarse.at_once(waypoints)
        if curve is None or not self.incumbent.offer(curve):
            return self._stopping(waypoints)
        self.incumbent.info["fallback"] = "curve of few steps"
        return None

    def _stopping(self, waypoints: Array) -> Failure | None:
        """Offer the motion along a path with a stop at every corner; paths on constraints have too many corners."""
        if not self.free(waypoints):
            return None
        with self.watch.stage("timing of sampled paths"):
            timed = stopping(self.problem.robot, self.problem.limits, waypoints)
        return self._offer(waypoints, timed)

    def _offer(self, waypoints: Array, timed: Trajectory | None) -> Failure | None:
        if timed is None:
            return too_heavy(self.problem.robot, self.problem.limits, waypoints)
        if self.incumbent.offer(timed):
            self.incumbent.info["fallback"] = "sampled path"
        return None
