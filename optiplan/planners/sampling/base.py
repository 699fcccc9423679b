"""Base of the sampling planners: goals, a sampled path to one of them, then smoothing and timing."""

from abc import abstractmethod
from dataclasses import field, replace
from typing import Literal, TypeVar

from optiplan.collision.kept_models import kept_planning_model
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget, Failure, Planner, PlanResult, Progress
from optiplan.planners.common.context import Stopwatch
from optiplan.planners.common.failures import too_heavy
from optiplan.planners.common.goal_ranking import goal_sampler
from optiplan.planners.common.path_timing import timed_path
from optiplan.planners.option_schema import PlannerOptions, option
from optiplan.planners.sampling.constrained.planner import ConstrainedSearch, plan_constrained
from optiplan.planners.sampling.ompl_search import rrt_connect
from optiplan.planners.sampling.sample_path import SampledPath, SamplingOptions, path_check, sample_path
from optiplan.planners.sampling.search import Searcher
from optiplan.planners.sampling.smoothing import smooth_path
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.trajectory.timing.time_path import TimingOptions, time_path
from optiplan.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class SampledOptions(PlannerOptions):
    """Options of every sampling planner."""

    goals: int = option(8, "goal configurations that may be reached, at most.", above=0)
    attempts: int = option(120, "random shortcuts of the path that was found.", least=0)
    smoothing: Literal["corners", "bspline"] = option(
        "corners",
        "`corners`: straight segments with rounded corners. `bspline`: one smooth curve near the path, or rounded "
        "corners where no such curve is proved free.",
    )


@dataclass(frozen=True)
class SearchSetup:
    """The search algorithm; see `SamplingOptions`, and `constrained` for problems with path constraints."""

    searcher: Searcher = rrt_connect
    detour: float = 2.0
    improve: Searcher | None = None
    constrained: ConstrainedSearch = field(default_factory=ConstrainedSearch)


Options = TypeVar("Options", bound=SampledOptions)


class SamplingPlanner(Planner[Options]):
    """A planner is this class and its `setup`: the path it finds is shortened, smoothed and timed."""

    @abstractmethod
    def setup(self) -> SearchSetup:
        """Return the search algorithm, by the options."""

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; see `planners.base.Planner`."""
        options, setup, watch = self.options, self.setup(), Stopwatch()
        with watch.stage("set-up"):
            model = kept_planning_model(problem.robot, problem.scene, problem.tracking_error)
        progress("goals", 0.0)
        with watch.stage("goals"):
            sampler = goal_sampler(problem, model, budget, options.goals)
        if isinstance(sampler, Failure):
            return PlanResult(None, sampler, watch.seconds)
        if problem.path_constraints:
            search = replace(setup.constrained, attempts=options.attempts)
            with watch.stage("sampling"):
                found = plan_constrained(problem, model, sampler, search, options.goals, budget, progress)
            return replace(found, timings=watch.seconds)
        progress("sampling", 0.1)
        goals = sampler.configurations[: options.goals]
        sampling = SamplingOptions(
            budget,
            seed=problem.seed,
            attempts=options.attempts,
            searcher=setup.searcher,
            alternate=None,
            detour=setup.detour,
            improve=setup.improve,
            more_goals=sampler.more,
        )
        with watch.stage("sampling"):
            path = sample_path(path_check(model, problem.limits), problem.start, goals, sampling)
        if isinstance(path, Failure):
            return PlanResult(None, path, watch.seconds)
        progress("timing", 0.7)
        with watch.stage("timing"):
            smooth = _smooth(model, path, problem, budget) if options.smoothing == "bspline" else None
            trajectory = smooth or timed_path(model, path.waypoints, problem.limits, budget)
        if trajectory is None:
            return PlanResult(None, too_heavy(problem.robot, problem.limits, path.waypoints), watch.seconds)
        info = {"goal": path.goal_index, "waypoints": len(path.waypoints), "smooth": smooth is not None}
        info |= path.info | {"cut_short": budget.over or path.info["cut_short"]}
        return PlanResult(trajectory, None, watch.seconds, info)


def _smooth(model: CollisionModel, path: SampledPath, problem: Problem, budget: Budget) -> Trajectory | None:
    curve = smooth_path(model, path.waypoints, problem.limits.velocity, budget)
    timing = TimingOptions(stop=lambda: budget.over)
    return None if curve is None else time_path(curve, model.robot, problem.limits, timing)
