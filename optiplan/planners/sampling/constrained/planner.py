"""Plan under path constraints: search on them, shorten, smooth, time."""

from collections.abc import Callable

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget, Failure, PlanResult, Progress
from optiplan.planners.common.failures import too_heavy
from optiplan.planners.common.goal_ranking import GoalSampler
from optiplan.planners.common.path_timing import timed_path
from optiplan.planners.path_constraints.goal_projection import hold_goals
from optiplan.planners.path_constraints.motion_check import PathConstraints, broken_constraint, constraint_name
from optiplan.planners.sampling.constrained.constrained_steps import ConstrainedSteps
from optiplan.planners.sampling.constrained.manifold import Manifold, in_part_only
from optiplan.planners.sampling.constrained.searches import Query, connect, roadmap, star
from optiplan.planners.sampling.constrained.smoothing import shortcut, smooth_curves
from optiplan.planners.sampling.sample_path import path_check
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.trajectory.timing.time_path import TimingOptions, time_path
from optiplan.trajectory.trajectory import Trajectory

_SEARCHING = 0.75  # share of the budget for searching; the rest is for smoothing and timing


@dataclass(frozen=True)
class ConstrainedSearch:
    """Which search is made, and how.

    Attributes:
        roadmap: a roadmap in the place of two trees.
        iterations: of RRT* after the first path; 0: none.
        informed: whether that samples only where shorter paths can pass.
        vertices: of the roadmap, first.
        attempts: random shortcuts of the path that was found.
    """

    roadmap: bool = False
    iterations: int = 0
    informed: bool = False
    vertices: int = 150
    attempts: int = 120


@dataclass(frozen=True, eq=False)
class ConstrainedPath:
    """A path on the constraints.

    Attributes:
        waypoints: (k, n), rad or m; every point holds the constraints, every segment is proved free.
        steps: that found it.
        states: number of configurations reached.
    """

    waypoints: Array
    steps: ConstrainedSteps
    states: int


def constrained_path(
    model: CollisionModel,
    problem: Problem,
    goals: list[Array],
    budget: Budget,
    search: ConstrainedSearch,
) -> ConstrainedPath | Failure:
    """Return a path on the constraints from the start to one of the goals (n,), which hold them.

    Failure kinds: `unsupported` where a constraint holds in a part of the motion only; `no-path`.
    """
    parts = in_part_only(problem)
    if parts:
        kinds = ", ".join(parts)
        return Failure(
            "unsupported", f"this planner holds constraints on the whole motion only, not `during` ({kinds})"
        )
    manifold = Manifold(problem, np.vstack([problem.start, *goals]))
    steps = ConstrainedSteps(manifold, path_check(model, problem.limits), budget.share(_SEARCHING))
    query = Query(
        steps, problem.start, np.array(goals), problem.seed, search.iterations, search.informed, search.vertices
    )
    path = _straight(query)
    if path is None:
        path = roadmap(query) if search.roadmap else connect(query)
    if path is None:
        return _none_found(query, problem, budget)
    draws = np.random.default_rng(problem.seed).uniform(size=(search.attempts, 2))
    path = shortcut(steps, path, draws)
    if search.iterations:
        path = shortcut(steps, star(query, path), draws)
    return ConstrainedPath(path, steps, sum(query.states))


def _none_found(query: Query, problem: Problem, budget: Budget) -> Failure:
    """Return the failure of a search, with the constraints and the configuration that it brought nearest to a goal."""
    names = ", ".join(constraint_name(one) for one in problem.path_constraints)
    detail = f"no path that holds the path constraints ({names}) within {budget.seconds:.3g} s; "
    reached = [(float(np.abs(q - goal).max()), q) for q in query.nearest for goal in query.goals]
    far, q = min(reached, key=lambda one: one[0], default=(0.0, problem.start))
    detail += f"the search reached {sum(query.states)} states"
    detail += f", none nearer to a goal than {far:.3g} rad or m of a joint" if reached else ""
    return Failure("no-path", detail, {"constraint": names, "q": q.tolist()})


def plan_constrained(
    problem: Problem,
    model: CollisionModel,
    sampler: GoalSampler,
    search: ConstrainedSearch,
    count: int,
    budget: Budget,
    progress: Progress,
) -> PlanResult:
    """Plan to up to `count` goals of a sampler."""
    constraints = PathConstraints(problem)
    held = hold_goals(problem, model, sampler, constraints, lambda: budget.over)
    goals = held[:count] or _held_goals(sampler, constraints.end_holds, count, budget)
    if not goals:
        return PlanResult(None, constraints.no_end(sampler.configurations), {})
    progress("sampling", 0.1)
    found = constrained_path(model, problem, goals, budget, search)
    if isinstance(found, Failure):
        return PlanResult(None, found, {})
    progress("timing", 0.7)
    motion = timed(problem, found, constraints, budget)
    info = {"waypoints": len(found.waypoints), "states": found.states, "cut_short": budget.over}
    return PlanResult(None, motion, {}, info) if isinstance(motion, Failure) else PlanResult(motion, None, {}, info)


def timed(
    problem: Problem, found: ConstrainedPath, constraints: PathConstraints, budget: Budget
) -> Trajectory | Failure:
    """Return the fastest motion that holds the constraints along smooth curves near a path, or with its corners."""
    model, limits, names = found.steps.check.model, problem.limits, problem.robot.joint_names
    steps = ConstrainedSteps(found.steps.manifold, found.steps.check, budget)
    timing = TimingOptions(stop=lambda: budget.over)
    curves = smooth_curves(steps, found.waypoints, names)
    motions: list[Trajectory | None] = [time_path(curve, model.robot, limits, timing) for curve in curves]
    held = _held(motions, constraints)
    if not held:
        motions = [timed_path(model, found.waypoints, limits, budget)]
        held = _held(motions, constraints)
    if held:
        return min(held, key=lambda motion: motion.duration)
    last = motions[-1]
    if last is None:
        return too_heavy(problem.robot, limits, found.waypoints)
    return broken_constraint(constraints.broken(last)[0], last, "a path was found, but no motion along it")


def _held(motions: list[Trajectory | None], constraints: PathConstraints) -> list[Trajectory]:
    slowed = [constraints.slowed(motion) for motion in motions if motion is not None]
    return [motion for motion in slowed if not constraints.broken(motion)]


def _straight(query: Query) -> Array | None:
    """Return the first walk from the start straight to a goal that gets there."""
    for goal in query.goals:
        points = query.steps.joined(query.start, goal)
        if points is not None:
            return np.vstack([query.start, points])
    return None


def _held_goals(sampler: GoalSampler, holds: Callable[[Array], bool], count: int, budget: Budget) -> list[Array]:
    """Return up to `count` goals that hold the constraints; more are drawn for a while where none does."""
    looking = budget.share(0.2)
    goals = [q for q in sampler.configurations if holds(q)]
    while not goals and not sampler.complete and not looking.over:
        fresh = sampler.more(4, lambda: looking.over)
        if not fresh:
            break
        goals = [q for q in fresh if holds(q)]
    return goals[:count]
