"""Sampled paths for `trajopt`: the searches, and the motions along a path that is not optimised."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.collision.native_model import planning_model
from optiplan.planners.base import Budget, Failure
from optiplan.planners.common.failures import too_heavy
from optiplan.planners.common.goal_ranking import GoalSampler
from optiplan.planners.common.path_timing import stopping, timed_path
from optiplan.planners.common.stopwatch import Stopwatch
from optiplan.planners.sampling.constrained.seeds import ConstrainedSeeds
from optiplan.planners.sampling.local_searches import improved_path
from optiplan.planners.sampling.ompl_search import ALTERNATE_RATIO, kpiece, rrt_connect
from optiplan.planners.sampling.sample_path import SampledPath, SamplingOptions, path_check, sample_path
from optiplan.planners.sampling.shortcutting import path_time
from optiplan.planners.sampling.shrunk_obstacles import thinned, through_thinner
from optiplan.planners.trajopt.incumbent import Incumbent
from optiplan.planners.trajopt.stopping_rule import STATE, Patience, counted
from optiplan.problem.problem import Problem
from optiplan.trajectory.timing.lower_bound import lower_bounds
from optiplan.trajectory.trajectory import Trajectory

_QUICK, _ROUNDS = 0.065, 2
"""Work, s, that a search may take that a late straight line waits for, and rounds that it makes in it: for a first
motion, not for a hard problem."""

_LOCAL = 30
"""Local searches that improve a path before it is optimised."""

_DEPTHS = 0.015, 0.005, 0.0
"""Thickness, m, by which obstacles are thinner there on all sides, of which the optimiser moves a path out; the next
one where that has led to nothing."""

_ONE = 0.3
"""Work, s, of a search while there is a motion, and twice that for each such search in vain."""

_NO_BETTER = 1.15
"""Cost of a path in bounds on all motions, at which no cheaper one is looked for: corners and rounding take as much."""

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
        searches: begun so far.
        begun: rounds that the next search leaves out, since they have just been made in vain.
        found: while a line was being optimised, and not optimised itself yet.
        depth: number of the thickness by which obstacles are thinner in the next search, once there is a motion.
        in_vain: searches since then that found no path.
    """

    problem: Problem
    model: CollisionModel
    budget: Budget
    patience: Patience
    incumbent: Incumbent
    watch: Stopwatch
    searches: int = 0
    found: SampledPath | None = None
    begun: int = 0
    depth: int = 0
    in_vain: int = 0
    _models: dict[float, CollisionModel] = field(default_factory=dict)
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
        path = self._sample(sampler, self.model, self.patience.seconds + _QUICK, None)
        if isinstance(path, SampledPath):
            self.found = path
        else:
            self.begun = _ROUNDS

    def next(self, sampler: GoalSampler, repair: Callable[[Array], Array | None]) -> SampledPath | Failure:
        """Return the next path to optimise; `repair` as in `through_thinner`.

        It is improved by local searches first, since a path's cost tells much of what it can be optimised to, and they
        take less time than a descent from a long path. Once there is a motion they look between thinner obstacles,
        where there are more ways and searches are shorter; between thicker ones where that has just led to nothing.
        Searches end where they stop being worth their work.
        """
        found, self.found = self.found, None
        if found is None and (self._on_constraints.apply or not self.incumbent.candidates):
            path = self._sample(sampler, self.model, self.patience.seconds + self._worth, repair)
            if isinstance(path, Failure) or not self.incumbent.candidates or self._on_constraints.apply:
                return path
            found = path
        while _DEPTHS[self.depth]:
            path = self._improved(sampler, self._thinner(_DEPTHS[self.depth]), found)
            if isinstance(path, Failure) or len(path.waypoints) > 2:
                return path
            self.depth += 1
        return self._improved(sampler, self.model, found)

    def tell(self, free: bool) -> None:
        """Take to account whether the last path was optimised to one that is free."""
        self.depth = 0 if free else (self.depth + 1) % len(_DEPTHS)

    def _improved(
        self, sampler: GoalSampler, model: CollisionModel, found: SampledPath | None
    ) -> SampledPath | Failure:
        """Return `found`, or else a path that is sampled, improved by local searches."""
        began, incumbent = self.patience.seconds, self.incumbent
        path = found or self._sample(sampler, model, began + min(self._worth, _ONE * 2.0**self.in_vain), None)
        if isinstance(path, Failure):
            self.depth, self.in_vain = 0, self.in_vain + 1
            return path
        with self.watch.stage("sampling"):
            check = path_check(model, self.problem.limits)
            searcher = counted(rrt_connect, self.patience, began + self._worth)
            rng = np.random.default_rng(self.problem.seed + 1000 * self.searches)
            enough = _NO_BETTER * incumbent.soonest
            waypoints = improved_path(check, path.waypoints, searcher, self.budget, rng, _LOCAL, enough)
        cost = float(path_time(waypoints, self.problem.limits.velocity).sum())
        return replace(path, waypoints=waypoints, cost=cost)

    @property
    def _worth(self) -> float:
        """Return the work without a gain that is still worth it, s."""
        incumbent = self.incumbent
        return self.patience.worth(incumbent.cost, incumbent.bound) if incumbent.candidates else np.inf

    def _thinner(self, depth: float) -> CollisionModel:
        if depth not in self._models:
            self._models[depth] = planning_model(self.problem.robot, thinned(self.problem.scene, depth))
        return self._models[depth]

    def _sample(
        self, sampler: GoalSampler, model: CollisionModel, most: float, repair: Callable[[Array], Array | None] | None
    ) -> SampledPath | Failure:
        """Return a path of the next seed to any of the promising goals, sampled within `most` of work in all, s."""
        number, begun = self.searches, self.begun
        self.searches, self.begun = number + 1, 0
        share = _SEARCH if self.incumbent.candidates else _FIRST_SEARCH
        budget = self.budget.leaving((1.0 - share) * self.budget.remaining)
        with self.watch.stage("sampling"):
            goals = self.promising(sampler)
            if self._on_constraints.apply:
                return self._on_constraints.path(goals, budget, number)
            relaxed = None if repair is None else through_thinner(repair)
            options = SamplingOptions(
                budget,
                seed=self.problem.seed + 1000 * number,
                searcher=counted(rrt_connect, self.patience, most),
                alternate=counted(kpiece, self.patience, most, STATE / ALTERNATE_RATIO),
                relaxed=counted(relaxed, self.patience, most, STATE / ALTERNATE_RATIO) if relaxed else None,
                more_goals=sampler.more,
                begun=begun,
                early=None if self.incumbent.candidates else self._stopping,
            )
            path = sample_path(model, self.problem.start, goals, self.problem.limits, options)
        self.patience.work(shortcuts=options.attempts if isinstance(path, SampledPath) else 0)
        self.incumbent.info["cut_short"] |= isinstance(path, Failure) and budget.over
        return path

    def free(self, path: SampledPath) -> bool:
        """Return whether a path is free between the obstacles as they are."""
        return path_check(self.model, self.problem.limits).polyline_free(path.waypoints)

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
