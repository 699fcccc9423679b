"""`bitstar`: batches of samples, searched in the order of potential path cost, OMPL's BIT*."""

from dataclasses import dataclass
from functools import partial

from optiplan.planners.base import Budget, Planner, PlanResult, Progress
from optiplan.planners.option_schema import option
from optiplan.planners.sampling.base import PlanTask, SampledOptions, SearchSetup, plan_sampled
from optiplan.planners.sampling.ompl_search import search
from optiplan.planners.sampling.search import SearchOptions
from optiplan.problem.problem import Problem


@dataclass(frozen=True)
class BitStarOptions(SampledOptions):
    """Options of every sampling planner, and those of the batches."""

    batches: int = option(
        10, "of a hundred samples in a round; rounds follow each other as those of `rrtstar` do.", above=0
    )


class BitStar(Planner[BitStarOptions]):
    """Planner by BIT*: shorten the path of RRT-Connect in time (`shortcutting.path_time`), checking few edges."""

    Options = BitStarOptions

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; see `planners.base.Planner`."""
        searcher = partial(search, options=SearchOptions("bitstar", effort=self.options.batches))
        return plan_sampled(PlanTask(problem, budget, progress), self.options, SearchSetup(improve=searcher))
