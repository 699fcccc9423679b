"""The ends of a goal that is a set of configurations, tried by their lower bounds before a search stops."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import field

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.common.goal_ranking import GoalSampler, are_distinct
from optiplan.planners.trajopt.attempts import Attempts
from optiplan.planners.trajopt.coarse_descents import CoarseCurve
from optiplan.planners.trajopt.curve_incumbent import CurveIncumbent
from optiplan.planners.trajopt.path_search import PathSearch
from optiplan.planners.trajopt.stopping_rule import SAME, EndsInVain
from optiplan.records import dataclass

_SEARCH = 0.1
"""Work, s, of a search for a path to one end."""

_PROMISING = 1.03
"""Duration / duration of the best coarse curve up to which a coarse curve is optimised: its error is a few percent."""


@dataclass(eq=False)
class EndSearch:
    """Tries the ends of a goal without a motion yet, in the order of their bounds.

    The configurations of a pose or a region form finitely many branches, each with its redundancy. On each branch, the
    end nearest to the start is a local minimum of the bound (`GoalSampler.nearest_ends`). There are three guesses for
    an end: the best motion bent to it, the straight line, and a sampled path. Each descends as a coarse curve; the
    shortest is optimised where it promises a shorter motion than the best. An end whose bound is not below the best
    motion is not tried: no motion to it is shorter.

    Attributes:
        sampler: of the ends of the problem.
        attempts: optimise curves.
        paths: searches, and short descents.
    """

    sampler: GoalSampler
    attempts: Attempts
    paths: PathSearch
    _ends: list[Array] = field(default_factory=list)
    _surveyed: float = np.inf
    _tries: Counter[bytes] = field(default_factory=Counter)
    _record: EndsInVain = field(default_factory=EndsInVain)

    def run(self) -> None:
        """Try ends while one is worth its work and the budget lasts.

        Path constraints exclude it: coarse curves ignore them.
        """
        if self.paths.problem.one_end or self.paths.problem.path_constraints:
            return
        while self._incumbent.candidates and not self.attempts.over:
            end = self._next()
            self._incumbent.info["ends"] = {"known": len(self._ends), "tried": self._record.tried}
            if end is None:
                return
            before, began = self._incumbent.cost, self.attempts.patience.seconds
            self._tries[end.tobytes()] += 1
            self._try(end)
            self._record.record(self.attempts.patience.seconds - began, SAME * self._incumbent.cost < before)

    @property
    def _incumbent(self) -> CurveIncumbent:
        return self.attempts.incumbent

    def _next(self) -> Array | None:
        """Return the end (n,) to try next: the least bound among the least tried; None if none is worth it."""
        incumbent = self._incumbent
        if SAME * incumbent.cost < self._surveyed:
            self._surveyed = incumbent.cost
            with self.attempts.watch.stage("goals"):
                self._ends = self._survey()
        bounds = self.paths.problem.lower_bounds(self._ends) if self._ends else np.zeros(0)
        worth: list[tuple[int, int]] = []
        for k, (end, bound) in enumerate(zip(self._ends, bounds, strict=True)):
            least, tries = incumbent.cost_bound(float(bound)), self._tries[end.tobytes()]
            if self.attempts.patience.worth_an_end(incumbent.cost, least, tries, self._record):
                worth.append((tries, k))
        return self._ends[min(worth)[1]] if worth else None

    def _survey(self) -> list[Array]:
        """Return the ends (n,) with a bound below the best motion: the branches' ends, then others apart from them."""
        incumbent = self._incumbent
        nearest = self.sampler.nearest_ends(incumbent.longest, lambda: self.attempts.over)
        known = [*nearest, *self.paths.promising(self.sampler)]
        ends: list[Array] = []
        for q in known:
            if all(are_distinct(q, other, self.paths.problem.limits) for other in ends):
                ends.append(q)
        bounds = self.paths.problem.lower_bounds(ends) if ends else np.zeros(0)
        if len(bounds) and bounds.min() < incumbent.soonest:
            incumbent.bounded(float(bounds.min()))
        return ends

    def _try(self, end: Array) -> None:
        """Optimise the most promising of the curves to an end (n,)."""
        found = [one for one in self._curves(end) if one is not None]
        best = min(found, key=lambda one: one.duration, default=None)
        if best is not None and self._incumbent.cost_bound(best.duration) < _PROMISING * self._incumbent.rough:
            before = self._incumbent.cost
            if self.attempts.attempt("goal", best.control, self.attempts.before_refining) is None:
                return
            if self._incumbent.cost < before:
                self.attempts.free_end()

    def _curves(self, end: Array) -> Iterator[CoarseCurve | None]:
        """Yield the optimised coarse curves to an end."""
        basis, start, rough = self.attempts.optimiser.basis, self.paths.problem.start, self._incumbent.rough
        curve, still = self._incumbent.curve, np.zeros((2, len(start)))
        yield self.paths.coarse.from_curve(self.attempts.optimiser.along(np.array([start, end])), rough)
        if curve is not None:
            bent = basis.moved_ends(curve.control, np.vstack([[start], still]), np.vstack([[end], still]))
            yield self.paths.coarse.from_curve(bent, rough)
        yield self.paths.toward(self.sampler, [end], _SEARCH)
