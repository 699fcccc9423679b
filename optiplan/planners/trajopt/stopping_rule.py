"""Stopping rule: the expected gain of another attempt against its time."""

from dataclasses import field, replace
from math import ceil, inf

from optiplan._core import core
from optiplan.planners.base import Budget
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.sampling.ompl_space import Ends
from optiplan.planners.sampling.search import Search, Searcher
from optiplan.records import dataclass

PRICE = 0.1
"""Share of the motion's cost that spending the whole budget must be expected to save: 10 %."""

STEP, STATE, SHORTCUT = (0.02, 5e-4, 5e-3) if core is None else (0.003, 1e-5, 1e-4)
"""Time, s, of an optimiser step, a search state and a shortcut on an ordinary machine, in Python or the native core."""

SAME = 1.005
"""Factor within which costs belong to one local optimum."""


@dataclass(eq=False)
class Patience:
    """Estimate the gain of another attempt from the gains of those made.

    After n attempts with best costs c_1 <= c_2, the next one is expected to gain (c_2 - c_1) / n. That is the gain of
    the last one, averaged over all orders of the attempts (the jackknife estimate for exchangeable draws). After few
    attempts this says little, so the gap to the bound counts too: g² / n r, with g = 1 - bound / c_1. One factor g
    stands for the chance of a better motion, the other for its gain; r attempts have found c_1 within 0.5 %. Both
    estimates are divided by 1 + k after k attempts in a row without such a gain: a chance that failed k times is about
    1 / (k + 2) (Laplace's rule of succession).

    Another attempt is made while the larger estimate, as a share of c_1 per second of the mean work of an attempt,
    exceeds `PRICE` / budget. With a budget of 20 s, half a percent of the motion is worth one more second. The larger
    the budget, the longer the search. Work is counted in steps and states, not read from a clock, so that the same
    problem always gets the same attempts.
    """

    budget: Budget
    good_enough: float = 1.0
    costs: list[float] = field(default_factory=list)
    attempts: int = 0
    in_vain: int = 0
    seconds: float = 0.0

    def work(self, steps: float = 0, shortcuts: int = 0) -> None:
        """Count work done on the attempt: steps of the optimiser, shortcuts of a path; `counted` counts states."""
        self.seconds += STEP * steps + SHORTCUT * shortcuts

    def record(self, cost: float | None) -> None:
        """Record a finished attempt: the cost of its free motion (None: it has none)."""
        self.attempts += 1
        gained = cost is not None and SAME * cost < min(self.costs, default=inf)
        self.in_vain = 0 if gained else self.in_vain + 1
        if cost is not None:
            self.costs.append(cost)

    def worth_another(self, best: float, bound: float) -> bool:
        """Return whether to go on, with a motion of cost `best` found and none below `bound` possible."""
        return self.worth(best, bound) > 0.0

    def worth(self, best: float, bound: float) -> float:
        """Return the seconds of work without a gain after which to stop; infinite at first."""
        if best <= self.good_enough * bound:
            return 0.0
        if not self.attempts:
            return inf
        gap = max(0.0, 1.0 - bound / best)
        first, second = [*sorted(self.costs), best, best][:2]
        again = sum(cost <= SAME * first for cost in self.costs)
        gain = max((second - first) / best, gap * gap / max(again, 1)) / (1 + self.in_vain)
        return max(0.0, gain * self.budget.seconds / PRICE - self.seconds) if PRICE else inf

    def worth_an_end(self, best: float, bound: float, tries: int, end_search: "EndsInVain") -> bool:
        """Return whether to try an end of the goal, to which no motion costs less than `bound`, once more.

        It is expected to gain g² / (1 + k) (1 + t), with g = 1 - bound / best as in `worth`. There were k tries in vain
        since the last gain, t of them of this end. The gain, as a share of `best` per second of the mean work of a try,
        must exceed `PRICE` / budget.
        """
        if self.good_enough * bound >= best:
            return False
        gap = 1.0 - bound / best
        gain = gap * gap / ((1 + end_search.in_vain) * (1 + tries))
        return gain * self.budget.seconds > PRICE * end_search.each


@dataclass(eq=False)
class EndsInVain:
    """Record of the ends of a goal that were tried.

    Attributes:
        tried: how often, all together.
        in_vain: since the last gain.
        seconds: of work.
    """

    tried: int = 0
    in_vain: int = 0
    seconds: float = 0.0

    @property
    def each(self) -> float:
        """Return the work of a try, s; 0 before the first."""
        return self.seconds / max(self.tried, 1)

    def record(self, seconds: float, gained: bool) -> None:
        """Record a try, its work, s, and whether it gained more than nothing."""
        self.tried += 1
        self.seconds += seconds
        self.in_vain = 0 if gained else self.in_vain + 1


def counted(searcher: Searcher, patience: Patience, most: float, state: float = STATE) -> Searcher:
    """Wrap a searcher: count its states as work of `state` seconds each and end it for good at `most` of work."""

    def search(check: MotionCheck, ends: Ends, budget: Budget, seed: int, **how: float) -> Search:
        allowed = min(how["patience"], max(1.0, (most - patience.seconds) / state))
        found = searcher(check, ends, budget, seed, patience=allowed)
        looked = max(sum(found.sizes), ceil(allowed)) if found.impatient else sum(found.sizes)
        patience.seconds += state * looked
        return replace(found, impatient=found.impatient and most - patience.seconds >= state)

    return search
