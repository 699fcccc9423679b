"""A search for motions to a set of goal configurations that does not depend on the seed of the problem."""

from dataclasses import field

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.base import Failure
from optiplan.planners.common.goal_ranking import GoalSampler, are_distinct, goal_sampler
from optiplan.planners.trajopt.attempts import Attempts
from optiplan.planners.trajopt.coarse_descents import CoarseCurve
from optiplan.planners.trajopt.curve_incumbent import CurveIncumbent
from optiplan.planners.trajopt.optimizer import Attempt
from optiplan.planners.trajopt.path_search import PathSearch
from optiplan.planners.trajopt.stopping_rule import SAME, EndsInVain, Patience
from optiplan.problem.problem import derived
from optiplan.records import dataclass

_STREAM = 0
"""Seed of all its random numbers."""

_SHARE = 0.4
"""Share of the budget for this search; the rest is for searches with the problem's seed, and for refining."""

_NEAR = 1.02
"""Cost / bound of the best motion up to which this search is omitted: no other motion is much shorter."""

_LINES, _SEARCH = 6, 0.4
"""Ends tried with a straight line in a round, and work, s, of the search for one path."""

_PROMISING, _FREED = 1.1, 1.05
"""Duration / duration of the best curve up to which a coarse curve is optimised, and an optimised one gets a free
end."""


@dataclass(eq=False)
class SeedlessSearch:
    """Samples many paths to the ends of a goal, from one stream of numbers, and optimises the most promising.

    Among obstacles, the path matters as much as the end, and which paths a few searches find is a matter of luck. This
    search ignores the seed and the results found with it. Its ends, paths and attempts are the same for every seed, so
    no seed gives a longer motion than it finds. A round samples one path to the next end and one to any end, and tries
    straight lines to new random ends. Coarse curves decide which guess is optimised next.

    Attributes:
        attempts: of the run; their incumbent is offered the best curve.
        paths: of the run.
    """

    attempts: Attempts
    paths: PathSearch
    _done: bool = False
    _own: Attempts = field(init=False)
    _searches: PathSearch = field(init=False)
    _sampler: GoalSampler = field(init=False)
    _ends: list[Array] = field(default_factory=list)
    _surveyed: float = np.inf
    _curves: list[CoarseCurve] = field(default_factory=list)
    _tried: list[Array] = field(default_factory=list)

    def run(self) -> None:
        """Search once, as soon as there is a motion far above the bound; not on path constraints."""
        found = self.attempts.incumbent
        if self._done or not found.candidates or self.paths.problem.one_end or self.paths.problem.path_constraints:
            return
        if found.within(_NEAR):
            return
        self._done = True
        if not self._begin():
            return
        record, budget = EndsInVain(), self.attempts.budget
        while not self.attempts.over and self._own.patience.seconds < _SHARE * budget.seconds:
            own, ends = self._own.incumbent, self._survey()
            if not ends or (own.candidates and not self._own.patience.worth_an_end(own.cost, own.bound, 0, record)):
                break
            before, began = own.cost, self._own.patience.seconds
            self._round(ends, record.tried)
            record.record(self._own.patience.seconds - began, SAME * own.cost < before)
        found.info["ways"] = {"rounds": record.tried, "compared": len(self._tried) + len(self._curves)}
        curve = self._own.incumbent.curve
        if curve is not None and found.offer_curve(curve):
            self.attempts.waiting = curve

    def _begin(self) -> bool:
        """Make searches and attempts that share the collision models of the run, and none of its results.

        Return whether an end was found.
        """
        run, problem = self.attempts, derived(self.paths.problem, seed=_STREAM)
        patience = Patience(run.budget, run.patience.good_enough)
        info = {"attempts": run.incumbent.info["attempts"], "cut_short": False}
        kept, silent = run.incumbent, lambda stage, share: None
        incumbent = CurveIncumbent(problem, silent, run.watch, kept.began, constraints=kept.constraints, info=info)
        self._own = Attempts(run.optimiser, run.budget, incumbent, patience, run.watch)
        self._searches = self.paths.anew(patience, incumbent)
        with run.watch.stage("goals"):
            sampler = goal_sampler(problem, run.optimiser.model, run.budget)
        if isinstance(sampler, Failure):
            return False
        sampler.more(1, lambda: self.attempts.over)
        self._sampler = sampler
        return True

    def _round(self, ends: list[Array], number: int) -> None:
        """Find some guesses for ends (n,), and optimise the most promising one apart from earlier ones."""
        incumbent = self._own.incumbent
        single = [ends[number % len(ends)]]
        found: list[CoarseCurve | None] = [
            None if self.attempts.over else self._searches.toward(self._sampler, goals, _SEARCH)
            for goals in (single, ends)
        ]
        drawn = self._sampler.within(incumbent.longest, _LINES, lambda: self.attempts.over)
        for end in [*single, *drawn]:
            line = self.attempts.optimiser.along(np.array([self.paths.problem.start, end]))
            found.append(self._searches.coarse.from_curve(line, incumbent.rough))
        self._curves += [curve for curve in found if curve is not None]
        self._optimise_best()

    def _survey(self) -> list[Array]:
        """Return the ends (n,) with bounds below the best motion, the least first, surveyed after every gain."""
        incumbent = self._own.incumbent
        if SAME * incumbent.cost < self._surveyed or not self._ends:
            self._surveyed = incumbent.cost
            with self.attempts.watch.stage("goals"):
                if incumbent.candidates:
                    self._sampler.nearest_ends(incumbent.longest, lambda: self.attempts.over)
            self._ends = self._searches.promising(self._sampler)
            if self._ends:
                incumbent.bounded(float(self.paths.problem.lower_bounds(self._ends).min()))
        return self._ends

    def _optimise_best(self) -> None:
        """Optimise the shortest coarse curve apart from those tried, where it is short enough."""
        incumbent, limits = self._own.incumbent, self.paths.problem.limits
        self._curves.sort(key=lambda curve: curve.duration)
        while self._curves and incumbent.cost_bound(self._curves[0].duration) < _PROMISING * incumbent.rough:
            control = self._curves.pop(0).control
            if not all(are_distinct(control, other, limits) for other in self._tried):
                continue
            self._tried.append(control)
            attempt = self._own.optimised("sampled", control, self.attempts.before_refining)
            if attempt is not None:
                self._keep(attempt)
            return

    def _keep(self, attempt: Attempt) -> None:
        """Offer a curve; free its end where it is among the best."""
        incumbent = self._own.incumbent
        incumbent.offer_curve(attempt)
        if incumbent.cost_of(attempt.trajectory) < _FREED * incumbent.rough:
            self._own.freed(attempt)
