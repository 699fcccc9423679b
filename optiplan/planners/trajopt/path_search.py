"""Sampled paths for `trajopt`: the searches, and the motions along a path that is not optimised."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget, Failure
from optiplan.planners.common.failures import too_heavy
from optiplan.planners.common.goal_ranking import GoalSampler
from optiplan.planners.common.path_timing import stopping, timed_path
from optiplan.planners.common.stopwatch import Stopwatch
from optiplan.planners.sampling.constrained.seeds import ConstrainedSeeds
from optiplan.planners.sampling.ompl_search import ALTERNATE_RATIO, kpiece, rrt_connect
from optiplan.planners.sampling.sample_path import SampledPath, SamplingOptions, sample_path
from optiplan.planners.sampling.shrunk_obstacles import through_thinner
from optiplan.planners.trajopt.incumbent import Incumbent
from optiplan.planners.trajopt.stopping_rule import STATE, Patience, counted
from optiplan.problem.problem import Problem
from optiplan.trajectory.timing.lower_bound import lower_bounds
from optiplan.trajectory.trajectory import Trajectory

_QUICK, _ROUNDS = 0.065, 2
"""Work, s, that a search may take that a late straight line waits for, and rounds that it makes in it: for a first
motion, not for a hard problem."""

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
        path = self._sample(sampler, self.patience.seconds + _QUICK, None)
        if isinstance(path, SampledPath):
            self.found = path
        else:
            self.begun = _ROUNDS

    def next(self, sampler: GoalSampler, repair: Callable[[Array], Array | None]) -> SampledPath | Failure:
        """Return the path found at once, or one of the next seed; `repair` as in `through_thinner`.

        With a motion at hand a search ends where it stops being worth its work.
        """
        found, self.found = self.found, None
        if found is not None:
            return found
        incumbent = self.incumbent
        worth = self.patience.worth(incumbent.cost, incumbent.bound) if incumbent.candidates else np.inf
        return self._sample(sampler, self.patience.seconds + worth, repair)

    def _sample(
        self, sampler: GoalSampler, most: float, repair: Callable[[Array], Array | None] | None
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
            path = sample_path(self.model, self.problem.start, goals, self.problem.limits, options)
        self.incumbent.info["cut_short"] |= isinstance(path, Failure) and budget.over
        return path

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
