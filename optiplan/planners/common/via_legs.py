"""Plan through vias with any point-to-point planner: leg by leg, at rest at each via."""

from collections import Counter
from dataclasses import replace
from typing import Any

from optiplan.errors import Issue, PlannerAnswerError, described
from optiplan.planners.base import Budget, Failure, Planner, PlanResult, Progress, stages_of
from optiplan.planners.common.safety_ends import with_ends
from optiplan.problem.problem import JointGoal, Problem, derived
from optiplan.trajectory.joining import join_trajectories
from optiplan.trajectory.trajectory import Trajectory


def plan_through(
    planner: Planner[Any], problem: Problem, budget: Budget, progress: Progress, earlier: Trajectory | None = None
) -> PlanResult:
    """Plan the problem at once or leg by leg between vias, from an `earlier` motion if there is one.

    A planner that `passes_vias` plans the whole problem; for any other, see `leg_by_leg`. Path constraints are
    `unsupported` by planners without `holds_constraints`, and motion at the ends by planners with too few
    `end_derivatives`. For dynamic obstacles see `dynamic_obstacles`, unless the planner `times_obstacles` and plans the
    whole problem.

    Raises:
        PlannerAnswerError: a third-party planner returns no valid result.
    """
    if problem.path_constraints and not planner.holds_constraints:
        kinds = ", ".join(dict.fromkeys(one.KEY for one in problem.path_constraints))
        detail = f"this planner does not hold path constraints ({kinds})"
        return PlanResult(None, Failure("unsupported", detail))
    if problem.nonzero_ends and (refused := _unsupported_ends(planner, problem)):
        return PlanResult(None, refused)
    problem = with_ends(problem, budget)
    at_once = not problem.vias or planner.passes_vias
    if problem.scene.dynamic_obstacles and not (planner.times_obstacles and at_once):  # a later leg begins later
        from optiplan.planners.common.dynamic_obstacles import STATIC, wait_for_obstacles, without_dynamic_obstacles

        static = without_dynamic_obstacles(problem)
        found = plan_through(planner, static, budget.share(STATIC), stages_of(progress))
        return wait_for_obstacles(found, problem, budget)
    if at_once:
        return _answer(planner, problem, budget, progress, earlier)
    return leg_by_leg(planner, problem, budget, progress)


def _unsupported_ends(planner: Planner[Any], problem: Problem) -> Failure | None:
    """Return the failure for motion at the ends that the planner does not handle; None if it handles all."""
    goals = [goal.state for goal in problem.goal if isinstance(goal, JointGoal)]
    for where, states in (("start", [problem.start_state]), ("goal", goals)):
        for order, name in ((1, "a velocity"), (2, "an acceleration")):
            if order > planner.end_derivatives and any((state.v, state.a)[order - 1].any() for state in states):
                able = (
                    "begins and ends at rest" if planner.end_derivatives == 0 else "holds velocities at its ends only"
                )
                detail = f"this planner {able}, and the problem states {name} at the {where}"
                return Failure("unsupported", detail, {"end": where, "q": problem.start.tolist()})
    return None


def leg_by_leg(planner: Planner[Any], problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
    """Plan the legs between vias one by one, and stop at each via.

    Each leg ends where the planner prefers among the configurations that reach the via, the next begins there, and each
    has its share of the remaining time. A failure names its leg, counted from 1, in words and as `leg` of the witness.

    Raises:
        PlannerAnswerError: a third-party planner returns no valid result.
    """
    ends = [*(via.goal for via in problem.vias), problem.goal]
    legs: list[Trajectory] = []
    infos: list[dict[str, Any]] = []
    seconds: Counter[str] = Counter()
    for k, goal in enumerate(ends):
        leg = derived(problem, goal=goal, vias=())
        leg = leg.with_start(legs[-1].end) if legs else leg
        share = budget.share(1.0 / (len(ends) - k))
        result = _answer(planner, leg, share, _part_of(progress, k, len(ends)))
        seconds.update(result.timings)
        if result.trajectory is None:
            return PlanResult(None, _of_leg(result.failure, k, len(ends)), seconds, dict(result.info))
        legs.append(result.trajectory)
        infos.append(dict(result.info))
    cut_short = any(info.get("cut_short", False) for info in infos)
    return PlanResult(join_trajectories(legs), None, seconds, {"legs": infos, "cut_short": cut_short})


def _answer(
    planner: Planner[Any], problem: Problem, budget: Budget, progress: Progress, earlier: Trajectory | None = None
) -> PlanResult:
    """Return the planner's result, if it is valid."""
    result: Any
    if earlier is None:
        result = planner.plan(problem, budget, progress)
    else:
        result = planner.replan(problem, earlier, budget, progress)
    if isinstance(result, PlanResult):
        motion, failure = result.trajectory, result.failure
        if isinstance(motion, Trajectory) or (motion is None and isinstance(failure, Failure)):
            return result
        found = f"a PlanResult of {described(motion)} and {described(failure)}"
    else:
        found = described(result)
    name = f"the planner {type(planner).__name__}"
    expected = "a PlanResult with a Trajectory, or with a Failure that says why there is none"
    raise PlannerAnswerError([Issue(name, None, "plan", f"returned {found}", expected)])


def _part_of(progress: Progress, k: int, count: int) -> Progress:
    return lambda stage, fraction: progress(f"leg {k + 1}: {stage}", (k + fraction) / count)


def _of_leg(failure: Failure | None, k: int, count: int) -> Failure | None:
    if failure is None:
        return None
    origin = f"via {k}" if k else "the start"
    target = f"via {k + 1}" if k + 1 < count else "the goal"
    detail = f"leg {k + 1} of {count}, from {origin} to {target}: {failure.detail}"
    return replace(failure, detail=detail, witness={**failure.witness, "leg": k + 1})
