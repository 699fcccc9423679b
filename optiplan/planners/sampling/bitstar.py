"""`bitstar`: batches of samples, searched in the order of the path they promise, OMPL's BIT*."""

from dataclasses import dataclass
from functools import partial

from optiplan.planners.base import Budget, PlanResult, Progress
from optiplan.planners.sampling.base import How, PlanTask, SampledOptions, plan_sampled
from optiplan.planners.sampling.ompl_search import SearchOptions, search
from optiplan.problem.problem import Problem


@dataclass(frozen=True)
class BitStarOptions(SampledOptions):
    """Options of every sampling planner, and those of the batches.

    Attributes:
        batches: of a hundred samples in a round; rounds follow each other as those of `rrtstar` do.
    """

    batches: int = 10


class BitStar:
    """Shortens the path of RRT-Connect in time (`shortcut.path_time`); proves few edges, the promising ones."""

    def __init__(self, options: BitStarOptions | None = None) -> None:
        self.options = options or BitStarOptions()

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; see `planners.base.Planner`."""
        searcher = partial(search, options=SearchOptions("bitstar", effort=self.options.batches))
        return plan_sampled(PlanTask(problem, budget, progress), self.options, How(improve=searcher))
