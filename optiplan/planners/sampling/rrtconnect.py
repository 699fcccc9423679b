"""`rrtconnect`: two trees that grow towards each other (the native core's, else OMPL's); the fastest to find a path."""

from dataclasses import dataclass
from functools import partial

from optiplan.planners.base import Budget, Planner, PlanResult, Progress
from optiplan.planners.option_schema import option
from optiplan.planners.sampling.base import PlanTask, SampledOptions, SearchSetup, plan_sampled
from optiplan.planners.sampling.ompl_search import search
from optiplan.planners.sampling.search import SearchOptions
from optiplan.problem.problem import Problem


@dataclass(frozen=True)
class RrtConnectOptions(SampledOptions):
    """Options of every sampling planner, and one more."""

    reach: float = option(0.4, "longest edge of the trees, s at full joint speed.", above=0)


class RrtConnect(Planner[RrtConnectOptions]):
    """Planner by RRT-Connect: return the first path found, shortened."""

    Options = RrtConnectOptions

    holds_constraints = True

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; see `planners.base.Planner`."""
        searcher = partial(search, options=SearchOptions("rrtconnect", self.options.reach))
        return plan_sampled(PlanTask(problem, budget, progress), self.options, SearchSetup(searcher))
