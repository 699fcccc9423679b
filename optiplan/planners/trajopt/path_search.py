"""Sampled paths for `trajopt`: the searches, and the motions along a path that is not optimised."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.collision.native_model import planning_model
from optiplan.planners.base import Budget, Failure
from optiplan.planners.common.context import Stopwatch
from optiplan.planners.common.failures import too_heavy
from optiplan.planners.common.goal_ranking import GoalSampler
from optiplan.planners.common.path_timing import stopping, timed_path
from optiplan.planners.sampling.constrained.seeds import ConstrainedSeeds
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.sampling.ompl_search import ALTERNATE_RATIO, kpiece, rrt_connect
from optiplan.planners.sampling.sample_path import SampledPath, SamplingOptions, path_check, sample_path
from optiplan.planners.sampling.shrunk_obstacles import thinned, through_thinner
from optiplan.planners.trajopt.coarse_descents import CoarseDescents, GuessPath
from optiplan.planners.trajopt.incumbent import CurveIncumbent
from optiplan.planners.trajopt.stopping_rule import STATE, Patience, counted
from optiplan.problem.problem import Problem
from optiplan.trajectory.timing.lower_bound import lower_bounds
from optiplan.trajectory.trajectory import Trajectory

_QUICK, _ROUNDS = 0.065, 2
"""Work, s, that a search may take that a late straight line waits for, and rounds that it makes in it: for a first
motion, not for a hard problem."""

_COMPARED, _PROMISING = 3, 0.9
"""Paths that are compared before one of them is optimised, and share of the best curve's cost below which the coarse
curve of one ends the comparison."""

_SHORTCUTS, _FIRST_SHORTCUTS = 60, 120
"""Shortcuts of a path that a coarse curve descends from, and of one that is itself a motion."""

_DEPTHS = 0.015, 0.005, 0.0
"""Thickness, m, by which obstacles are thinner there on all sides, of which the optimiser moves a path out; the next
one where that has led to nothing."""

_HARD = 2
"""Attempts between thinner obstacles after which a first motion is looked for between the real ones."""

_FIRST, _TRIED = 1.5, 4
"""Work, s, of a search between thinner obstacles for a first motion, and paths that are tried there until a coarse
curve gets out of the obstacles: a search between the real ones takes longer, and so does its repair."""

_ONE = 0.3
"""Work, s, of a search while there is a motion, and twice that for each such search in vain."""

_SEARCH, _FIRST_SEARCH = 0.5, 0.8
"""Share of what is left of the budget that one search for a path may take; while there is no motion at all."""


@dataclass(eq=False)
class PathSearch:
    """Searches for paths, one seed after the other, and offers the motions along them.

    Attributes:
        problem: that is planned.
        model: of its robot in its scene.
        budget: of the run.
        patience: counts the work of searches, and says when they stop being worth it.
        incumbent: takes the motions along paths.
        watch: of the run.
        coarse: descents that tell what paths lead to.
        searches: begun so far.
        begun: rounds that the next search leaves out, since they have just been made in vain.
        found: while a line was being optimised, and not optimised itself yet.
        depth: number of the thickness by which obstacles are thinner in the next search between thinner ones.
        in_vain: searches since then that found no path.
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
    _ways: list[GuessPath] = field(default_factory=list)
    _checks: dict[float, MotionCheck] = field(default_factory=dict)
    _on_constraints: ConstrainedSeeds = field(init=False)

    def __post_init__(self) -> None:
        self._on_constraints = ConstrainedSeeds(self.problem, self.model)

    def promising(self, sampler: GoalSampler) -> list[Array]:
        """Return the goals whose lower bound is below the best motion, soonest first."""
        incumbent = self.incumbent
        goals = [q for q in sampler.configurations if incumbent.constraints.end_holds(q)]
        bounds = lower_bounds(self.problem.start, np.array(goals), self.problem.limits)
        costs = [incumbent.cost_bound(float(bound)) for bound in bounds]
        return [q for q, cost in zip(goals, costs, strict=True) if cost < incumbent.cost]

    def at_once(self, sampler: GoalSampler) -> None:
        """Look for a path for a short while if there is no motion, and offer it with a stop at every corner."""
        if self.incumbent.candidates or self.searches or self._on_constraints.apply:
            return
        path = self._sample(sampler, self._check(), self.patience.seconds + _QUICK, None)
        if isinstance(path, SampledPath):
            self.found = path
        else:
            self.begun = _ROUNDS

    def next(self, sampler: GoalSampler, repair: Callable[[Array], Array | None]) -> GuessPath | Failure:
        """Return the next way to optimise; `repair` as in `through_thinner`.

        Once there is a motion, several paths are sampled between thinner obstacles, where there are more ways and
        searches are shorter, and between thicker ones where that has just led to nothing. A coarse curve descends from
        each, and the way that promises the shortest motion comes first; the others wait for their turn. Where a short
        search for a first motion was in vain, it is looked for there, too, until the coarse curve of one path gets out
        of the obstacles, before a longer one is made. Searches end where they stop being worth their work.
        """
        found, self.found = self.found, None
        constrained, none = self._on_constraints.apply, not self.incumbent.candidates
        if found is None and none and not constrained and self.searches and self.depth < _HARD:
            way = self._compared(sampler, None, _TRIED, enough=1)
            if isinstance(way, GuessPath):
                return way
            self.depth = _HARD
        if found is None and (constrained or none):
            path = self._sample(sampler, self._check(), self.patience.seconds + self._worth, repair)
            if isinstance(path, Failure):
                return path
            if constrained or self.incumbent.curve is not None or not self.incumbent.candidates:
                return GuessPath(path)
            found = path
        return self._compared(sampler, found, _COMPARED)

    def tell(self, free: bool) -> None:
        """Take to account whether the last way was optimised to one that is free."""
        self.depth = 0 if free else (self.depth + 1) % len(_DEPTHS)
        if not free:
            self._ways.clear()

    def _compared(
        self, sampler: GoalSampler, found: SampledPath | None, count: int, enough: float = np.inf
    ) -> GuessPath | Failure:
        """Compare `found` and paths sampled anew by coarse descents; return the best way not optimised yet.

        At most `count` paths, none after `enough` ways, and none after one that promises a far shorter motion than the
        best curve.
        """
        best = rough = self.incumbent.rough
        failure = Failure("no-path", "the curves along all paths stay in obstacles")
        for _ in range(count):
            if len(self._ways) >= enough:
                break
            path, found = found or self._another(sampler), None
            if isinstance(path, Failure):
                failure, self.depth, self.in_vain = path, 0, self.in_vain + 1
                break
            way = self.coarse.descend(self._check(_DEPTHS[self.depth]).model, path, best)
            if way is not None:
                self._ways.append(way)
                best = min(best, way.duration)
                if np.isfinite(rough) and self.incumbent.cost_bound(way.duration) < _PROMISING * rough:
                    break
        self._ways.sort(key=lambda way: way.duration)
        return self._ways.pop(0) if self._ways else failure

    def anew(
        self, problem: Problem, patience: Patience, incumbent: CurveIncumbent, coarse: CoarseDescents
    ) -> "PathSearch":
        """Return searches that begin at the first seed again and share the models of thinner obstacles alone."""
        fresh = PathSearch(problem, self.model, self.budget, patience, incumbent, self.watch, coarse)
        fresh._checks = self._checks
        return fresh

    def toward(self, sampler: GoalSampler, goals: list[Array], most: float) -> GuessPath | None:
        """Return the way along a path to one of some goals (n,), found within `most` of work, s; None without one.

        The path is sampled between thinner obstacles, and between the real ones where the line to it is free there.
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
        """Return a path between obstacles that are thin enough, but not so thin that the straight line is free."""
        while True:
            one = _ONE * 2.0**self.in_vain if self.incumbent.candidates else _FIRST
            most = self.patience.seconds + min(self._worth, one)
            path = self._sample(sampler, self._check(_DEPTHS[self.depth]), most, None)
            if isinstance(path, Failure) or len(path.waypoints) > 2 or not _DEPTHS[self.depth]:
                return path
            self.depth += 1

    @property
    def _worth(self) -> float:
        """Return the work without a gain that is still worth it, s."""
        incumbent = self.incumbent
        return self.patience.worth(incumbent.cost, incumbent.bound) if incumbent.candidates else np.inf

    def _check(self, depth: float = 0.0) -> MotionCheck:
        """Return what proves paths free between obstacles that are thinner by `depth`, m."""
        if depth not in self._checks:
            robot, scene = self.problem.robot, self.problem.scene
            model = planning_model(robot, thinned(scene, depth)) if depth else self.model
            self._checks[depth] = path_check(model, self.problem.limits)
        return self._checks[depth]

    def _sample(
        self,
        sampler: GoalSampler,
        check: MotionCheck,
        most: float,
        repair: Callable[[Array], Array | None] | None,
        aims: list[Array] | None = None,
    ) -> SampledPath | Failure:
        """Return a path of the next seed to any of the promising goals, sampled within `most` of work in all, s.

        To the goals `aims` (n,) alone, where they are given.

        Between thinner obstacles the short rounds that others begin with are left out: a long one finds a path sooner.
        """
        number, begun = self.searches, _ROUNDS
        if real := check is self._check():
            begun, self.begun = self.begun, 0
        self.searches = number + 1
        share = _SEARCH if self.incumbent.candidates else _FIRST_SEARCH
        budget = self.budget.leaving((1.0 - share) * self.budget.remaining)
        with self.watch.stage("sampling"):
            goals = self.promising(sampler) if aims is None else aims
            if self._on_constraints.apply:
                return self._on_constraints.path(goals, budget, number)
            relaxed = None if repair is None else through_thinner(repair)
            options = SamplingOptions(
                budget,
                seed=self.problem.seed + 1000 * number,
                attempts=_SHORTCUTS if self.incumbent.candidates else _FIRST_SHORTCUTS,
                searcher=counted(rrt_connect, self.patience, most),
                alternate=counted(kpiece, self.patience, most, STATE / ALTERNATE_RATIO),
                relaxed=counted(relaxed, self.patience, most, STATE / ALTERNATE_RATIO) if relaxed else None,
                longest=np.inf if real else self.incumbent.longest,
                more_goals=sampler.more if aims is None else lambda count, stop: [],
                begun=begun,
                early=self._stopping if real and not self.incumbent.candidates else None,
            )
            path = sample_path(check, self.problem.start, goals, options)
        self.patience.work(shortcuts=options.attempts if isinstance(path, SampledPath) else 0)
        self.incumbent.info["cut_short"] |= isinstance(path, Failure) and budget.over
        return path

    def free(self, path: SampledPath) -> bool:
        """Return whether a path is free between the obstacles as they are."""
        return self._check().polyline_free(path.waypoints)

    def offer_first(self, path: SampledPath) -> Failure | None:
        """Offer the motion along a path that is to be had soonest."""
        return self.offer_timed(path) if self._on_constraints.apply else self._stopping(path.waypoints)

    def offer_timed(self, path: SampledPath) -> Failure | None:
        """Offer the motion along a path, timed with its corners rounded."""
        with self.watch.stage("timing of sampled paths"):
            timed = self._on_constraints.motion(path, self.incumbent.constraints, self.budget)
            if timed is None:
                timed = timed_path(self.model, path.waypoints, self.problem.limits, self.budget)
        return timed if isinstance(timed, Failure) else self._offer(path.waypoints, timed)

    def _stopping(self, waypoints: Array) -> Failure | None:
        """Offer the motion along a path that stops at every corner; paths on constraints have too many of them."""
        with self.watch.stage("timing of sampled paths"):
            timed = stopping(self.problem.robot, self.problem.limits, waypoints)
        return self._offer(waypoints, timed)

    def _offer(self, waypoints: Array, timed: Trajectory | None) -> Failure | None:
        if timed is None:
            return too_heavy(self.problem.robot, self.problem.limits, waypoints)
        if self.incumbent.offer(timed):
            self.incumbent.info["fallback"] = "sampled path"
        return None
