"""`rrtstar` and `informed_rrtstar`: one tree whose branches are rewired to shorter ones, OMPL's RRT*."""

from dataclasses import dataclass
from functools import partial

from optiplan.planners.base import Budget, Planner, PlanResult, Progress
from optiplan.planners.option_schema import option
from optiplan.planners.sampling.base import PlanTask, SampledOptions, SearchSetup, plan_sampled
from optiplan.planners.sampling.constrained.planner import ConstrainedSearch
from optiplan.planners.sampling.ompl_search import search
from optiplan.planners.sampling.search import Kind, SearchOptions
from optiplan.problem.problem import Problem


@dataclass(frozen=True)
class RrtStarOptions(SampledOptions):
    """Options of every sampling planner, and those of the tree."""

    reach: float = option(0.8, "longest tree edge, s at full joint speed.", above=0)
    iterations: int = option(
        600,
        "of a round. Rounds follow each other, each where only paths shorter than the best can pass, until three in a "
        "row gain less than 1 % or most of the budget is gone.",
        above=0,
    )


class RrtStar(Planner[RrtStarOptions]):
    """Planner by RRT*: shorten the path of RRT-Connect, by joint-space path time (`shortcutting.path_time`)."""

    Options = RrtStarOptions

    holds_constraints = True

    kind: Kind = "rrtstar"

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; see `planners.base.Planner`."""
        options = SearchOptions(self.kind, self.options.reach, self.options.iterations)
        constrained = ConstrainedSearch(iterations=self.options.iterations, informed=self.kind == "informed_rrtstar")
        setup = SearchSetup(improve=partial(search, options=options), constrained=constrained)
        return plan_sampled(PlanTask(problem, budget, progress), self.options, setup)


class InformedRrtStar(RrtStar):
    """Planner by informed RRT*: sample only the ellipsoid that can shorten the best path; length is ||dq / v||.

    For the path time OMPL would need a cost-to-go heuristic, which its Python
    binding does not accept (2.0.1: `setCostToGoHeuristic` takes no function): it would sample everywhere, as RRT* does.
    """

    kind: Kind = "informed_rrtstar"
