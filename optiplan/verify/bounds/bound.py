"""A proved lower bound on the duration of any motion of a problem, obstacles included."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.problem.problem import JointGoal, Problem
from optiplan.verify.bounds.closing import Closing
from optiplan.verify.bounds.duration_bound import NO_TIME, DurationBound
from optiplan.verify.bounds.search import BoundSearch
from optiplan.verify.bounds.times import Passage
from optiplan.verify.report import VerifyPolicy

ENDLESS = "joints that turn without end: the goal may be reached a turn away"


def unsupported(problem: Problem) -> tuple[str, str] | None:
    """Return what of a problem no bound is known for, its field and what was found; None if there is one."""
    if problem.task:
        return "task", "a task"
    if problem.nonzero_ends:
        return "start", "a robot that moves at the start or at a goal"
    if not all(isinstance(goal, JointGoal) for goal in problem.goal):
        return "goal", "a goal that is not given by values of the joints, whose end configurations are not all known"
    return None


def bound_of(problem: Problem, budget: float, known: float = np.inf) -> DurationBound:
    """Return the greatest bound proved within `budget`, s of wall time; of several goals it is that of the least.

    Args:
        problem: one that is not `unsupported`.
        budget: s.
        known: duration of a verified motion, s; nothing greater is tried. inf: none is known.
    """
    began = time.perf_counter()
    passages = [_passage(problem, goal) for goal in problem.goal if isinstance(goal, JointGoal)]
    bounds = [_alone(problem, one) for one in passages]
    history = [(0.0, min(bounds))]
    result = DurationBound(min(bounds), min(bounds), history=tuple(history), left_out=_left_out(problem))
    if problem.robot.endless.any() or not problem.scene.obstacles or min(bounds) < NO_TIME:
        return result

    def raised(which: int, seconds: float) -> None:
        bounds[which] = float(seconds)
        if min(bounds) > history[-1][1]:
            history.append((time.perf_counter() - began, min(bounds)))

    model = CollisionModel(problem.robot, problem.scene)
    closings = [Closing.of(model, one) for one in passages]
    searches = {
        k: BoundSearch(closing, bounds[k], known, partial(raised, k))
        for k, closing in enumerate(closings)
        if closing is not None
    }
    # The goal of the least bound first; the others only as far as they are the least then.
    for which in _in_turn(bounds):
        search = searches.get(which)
        if search is None:
            break
        others = [b for k, b in enumerate(bounds) if k != which and b > bounds[which] * 1.02]
        search.below = min(known, *others, np.inf)
        search.run(began + budget)
        if time.perf_counter() - began > budget:
            break
    names = {problem.robot.joint_names[j] for search in searches.values() for j in search.joints}
    return replace(
        result,
        seconds=min(bounds),
        joints=tuple(name for name in problem.robot.joint_names if name in names),
        parts=sum(search.parts for search in searches.values()),
        history=tuple(history),
    )


def _in_turn(bounds: Sequence[float]) -> Iterator[int]:
    """Indices of goals, each time that of the least bound, at most twice each."""
    left = [2] * len(bounds)
    while True:
        which = int(np.argmin(bounds))
        if left[which] == 0:
            return
        left[which] -= 1
        yield which


def _passage(problem: Problem, goal: JointGoal) -> Passage:
    """The way to a goal, with all that the verifier tolerates.

    A joint may begin with a speed of the share `rest_tolerance` of its greatest one, V: while it gets to V, that gains
    no more than this share of V^2 / A.
    """
    policy = VerifyPolicy()
    more = 1.0 + 10.0 * policy.limit_tolerance
    limits = problem.limits.scaled(velocity=more, acceleration=more, jerk=more)
    ramp = 2.0 * policy.rest_tolerance * limits.velocity**2 / limits.acceleration
    tolerance = 2.0 * policy.position_tolerance + goal.tolerance + ramp
    return Passage(problem.start, goal.q, limits, tolerance, policy.rest_tolerance)


def _alone(problem: Problem, passage: Passage) -> float:
    """The least time without obstacles, s; a joint that turns without end may arrive a turn away."""
    turned = passage.goal + 2.0 * np.pi * np.round((passage.start - passage.goal) / (2.0 * np.pi))
    nearest: Array = np.where(problem.robot.endless, turned, passage.goal)
    return float(replace(passage, goal=nearest).direct.max(initial=0.0))


def _left_out(problem: Problem) -> tuple[str, ...]:
    """What the problem demands and the bound does not count."""
    found = []
    if np.isfinite(problem.limits.torque).any():
        found.append("limits of torque")
    if problem.vias:
        found.append("via points")
    if problem.path_constraints:
        found.append("path constraints")
    if problem.scene.safety is not None:
        found.append("a clearance")
    if problem.tracking_error.any():
        found.append("a tracking error")
    if problem.scene.dynamic_obstacles:
        found.append("obstacles that move")
    if problem.robot.endless.any():
        found.append(f"obstacles, because of {ENDLESS}")
    return tuple(found)
