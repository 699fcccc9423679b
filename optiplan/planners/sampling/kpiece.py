"""`kpiece`: two trees that grow from the borders of the work space they have covered, OMPL's LBKPIECE1."""

from dataclasses import dataclass
from functools import partial

from optiplan.planners.base import Budget, Planner, PlanResult, Progress
from optiplan.planners.option_schema import option
from optiplan.planners.sampling.base import PlanTask, SampledOptions, SearchSetup, plan_sampled
from optiplan.planners.sampling.ompl_search import search
from optiplan.planners.sampling.search import SearchOptions
from optiplan.problem.problem import Problem


@dataclass(frozen=True)
class KpieceOptions(SampledOptions):
    """Options of every sampling planner, and one more."""

    reach: float = option(0.4, "longest edge of the trees, s at full joint speed.", above=0)


class Kpiece(Planner[KpieceOptions]):
    """Planner by LBKPIECE1: coverage is counted in cells of the tool's position; edges are checked lazily."""

    Options = KpieceOptions

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; see `planners.base.Planner`."""
        searcher = partial(search, options=SearchOptions("kpiece", self.options.reach))
        return plan_sampled(PlanTask(problem, budget, progress), self.options, SearchSetup(searcher))
