"""`kpiece`: two trees that grow from the borders of the work space they have covered, OMPL's LBKPIECE1."""

from dataclasses import dataclass
from functools import partial

from optiplan.planners.base import Budget, PlanResult, Progress
from optiplan.planners.sampling.base import How, PlanTask, SampledOptions, plan_sampled
from optiplan.planners.sampling.ompl_search import SearchOptions, search
from optiplan.problem.problem import Problem


@dataclass(frozen=True)
class KpieceOptions(SampledOptions):
    """Options of every sampling planner, and one more.

    Attributes:
        reach: longest edge of the trees, s at full joint speed.
    """

    reach: float = 0.4


class Kpiece:
    """Coverage is counted in cells of the tool's position; motions are proved only when a path needs them."""

    def __init__(self, options: KpieceOptions | None = None) -> None:
        self.options = options or KpieceOptions()

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; see `planners.base.Planner`."""
        searcher = partial(search, options=SearchOptions("kpiece", self.options.reach))
        return plan_sampled(PlanTask(problem, budget, progress), self.options, How(searcher))
