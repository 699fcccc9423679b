"""Stopping rule: the expected gain of another attempt against its time."""

from dataclasses import dataclass, field, replace
from math import ceil, inf

from optiplan._core import core
from optiplan.planners.base import Budget
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.sampling.ompl_space import Ends
from optiplan.planners.sampling.search import Search, Searcher

PRICE = 0.1
"""Share of the motion's cost that spending the whole budget must be expected to save: 10 %."""

STEP, STATE, SHORTCUT = (0.02, 5e-4, 5e-3) if core is None else (0.003, 1e-5, 1e-4)
"""What a step of the optimiser, a state of a search and a shortcut of a path take on an ordinary machine, s, in Python
or the native core."""

SAME = 1.005
"""Costs within this factor are those of one local optimum."""


@dataclass(eq=False)
class Patience:
    """Estimate the gain of another attempt from the gains of those made.

    With n attempts made and the two best of them costing c_1 <= c_2, a further one is expected to gain
    (c_2 - c_1) / n: that is what the last one gained, averaged over all orders in which they could have come (the
    jackknife estimate for exchangeable draws). While few have been made this says little, so what is left to the bound
    counts too: g² / n r, with g = 1 - bound / c_1 once for the chance that a better motion exists and once for its
    gain, and r attempts that have found c_1 within 0.5 %. Either is divided by 1 + k after k attempts in a row that
    gained less than that, for a chance that failed so often is as small as 1 / (k + 2) (Laplace's rule of succession).
    Another attempt is worth making while the larger of the two, as a share of c_1 and for each second of work that
    attempts have taken so far on average, exceeds `PRICE` / budget: somebody who gives 20 s waits one second more for
    half a percent of the motion. The larger the budget, the longer the search. Work is counted in steps and states, not
    read from a clock, so that the same problem always gets the same attempts.
    """

    budget: Budget
    good_enough: float = 1.0
    costs: list[float] = field(default_factory=list)
    attempts: int = 0
    in_vain: int = 0
    seconds: float = 0.0

    def work(self, steps: float = 0, states: int = 0, shortcuts: int = 0) -> None:
        """Count work done on the attempt: steps of the optimiser, states of a search, shortcuts of its path."""
        self.seconds += STEP * steps + STATE * states + SHORTCUT * shortcuts

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

        It is expected to gain g² / (1 + k) (1 + t), with g = 1 - bound / best as in `worth`, k ends tried in vain since
        the last gain and t tries of this end before; as a share of `best` for each second of the work of a try so far,
        that must exceed `PRICE` / budget.
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
