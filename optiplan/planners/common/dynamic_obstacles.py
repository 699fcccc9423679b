"""Dynamic obstacles: a motion among static ones waits, or slows down, until the dynamic ones have passed."""

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from optiplan.collision.kept_models import kept_planning_model
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget, Failure, PlanResult
from optiplan.planners.common.continuous_collision import Touch, first_contact
from optiplan.planners.common.failures import out_of_time
from optiplan.planners.path_constraints.motion_check import Broken, PathConstraints, broken_constraint
from optiplan.problem.problem import Problem, derived
from optiplan.trajectory.joining import join_trajectories, standstill
from optiplan.trajectory.trajectory import Trajectory

STATIC = 0.6
"""Share of the budget for the motion among static obstacles."""

_HORIZON = 10.0
"""s: longest wait where an obstacle's motion never ends."""

_WAITS = 60  # waits that are tried up to the horizon, and as many beyond
_SLOWER = (1.0, 1.3, 1.7, 2.2, 3.0)  # factors on the duration that are tried
_HALVINGS = 6  # of the interval in which the wait lies


class Delayed(NamedTuple):
    """The motion `whole`, which begins `wait` seconds later and takes `slower` times as long."""

    motion: Trajectory
    wait: float
    slower: float
    whole: Trajectory


def wait_for_obstacles(found: PlanResult, problem: Problem, budget: Budget) -> PlanResult:
    """Delay what was found among static obstacles, or slow it down, until it meets no dynamic one.

    A robot that moves at the start cannot wait. A motion that moves at either end cannot be slowed down. One with times
    of vias is neither delayed nor slowed down.
    """
    if found.trajectory is None:
        return found
    motions = [*(one.trajectory for one in reversed(found.earlier)), found.trajectory][::-1]
    with_time = delayed(
        problem, motions, kept_planning_model(problem.robot, problem.scene, problem.tracking_error), budget
    )
    if isinstance(with_time, Failure):
        return PlanResult(None, with_time, found.timings, found.info)
    info = {**found.info, "waited": with_time.wait, "slower": with_time.slower}
    return PlanResult(with_time.motion, None, found.timings, info)


def without_dynamic_obstacles(problem: Problem) -> Problem:
    """Return the problem without its dynamic obstacles."""
    return derived(problem, scene=problem.scene.standing)


def delayed(
    problem: Problem, motions: Sequence[Trajectory], model: CollisionModel, budget: Budget
) -> Delayed | Failure:
    """Return the motion that arrives first, waiting or slower, among those that hold the path constraints.

    Otherwise the failure has the constraint that a free one breaks, or the contact of the first one, not delayed. A
    distance that is asked from an obstacle that moves is left to the verifier.
    """
    touch: Touch | None = None
    refused: tuple[Broken, Trajectory] | None = None
    constraints = PathConstraints(without_dynamic_obstacles(problem))
    for one in _in_order(problem, motions):
        met = first_contact(model, one.motion, lambda: budget.over)
        broken = constraints.broken(one.motion) if met is None else []
        if met is None and not broken:
            return _sooner(problem, one, model, constraints, budget)
        if budget.over:
            break
        touch = touch or met
        refused = refused or ((broken[0], one.motion) if broken else None)
    if refused is not None:
        return broken_constraint(*refused, "motions that wait or go slower and meet nothing break a path constraint")
    if touch is None:
        return out_of_time(budget, "trying waiting times")
    if _states_times(problem):
        detail = f"{touch.words} at {touch.t:.3f} s, and a motion with times of vias neither waits nor slows down"
        return Failure("unsupported", detail, touch.witness(motions[0]))
    detail = (
        f"{touch.words} at {touch.t:.3f} s, and neither waiting up to "
        f"{_waits(problem)[-1]:.3g} s nor going {max(_SLOWER):g} times slower avoids what moves"
    )
    return Failure("collision", detail, touch.witness(motions[0]))


def _in_order(problem: Problem, motions: Sequence[Trajectory]) -> Iterator[Delayed]:
    """Yield all motions with all delays that the ends allow, by their time of arrival."""
    timed = _states_times(problem)
    waits = [0.0] if problem.moving_start or timed else _waits(problem)
    slower = (1.0,) if problem.nonzero_ends or timed else _SLOWER
    ways = [
        (wait + factor * motion.duration, k, wait, factor)
        for (k, motion), wait, factor in product(enumerate(motions), waits, slower)
    ]
    for _, k, wait, factor in sorted(ways):
        yield _delay(motions[k], wait, factor)


def _states_times(problem: Problem) -> bool:
    """Return whether a via states when it is passed."""
    return any(via.time is not None for via in problem.vias)


def _sooner(
    problem: Problem, good: Delayed, model: CollisionModel, constraints: PathConstraints, budget: Budget
) -> Delayed:
    """Return a motion that waits less than one that is free, where it is free and holds the constraints, too."""
    low = max((wait for wait in _waits(problem) if wait < good.wait), default=0.0)
    for _ in range(_HALVINGS if good.wait else 0):
        tried = _delay(good.whole, 0.5 * (low + good.wait), good.slower)
        if first_contact(model, tried.motion, lambda: budget.over) is None and not constraints.broken(tried.motion):
            good = tried
        else:
            low = tried.wait
    return good


def _delay(whole: Trajectory, wait: float, slower: float) -> Delayed:
    """Return the motion, slowed down, after a wait."""
    scaled = whole if slower == 1.0 else whole.scaled(slower * whole.duration)
    if wait == 0.0:
        return Delayed(scaled, wait, slower, whole)
    still = standstill(scaled.joint_names, scaled.start, wait)
    return Delayed(join_trajectories([still, scaled]), wait, slower, whole)


def _waits(problem: Problem) -> list[float]:
    """Return the waits that are tried, s: until no obstacle moves any more, more of them up to the horizon."""
    ends = [body.motion.until for body in problem.scene.dynamic_obstacles if body.motion is not None]
    last = max(end if np.isfinite(end) else _HORIZON for end in ends)
    waits: list[float] = np.linspace(0.0, min(_HORIZON, last), _WAITS).tolist()
    return waits if last <= _HORIZON else [*waits, *np.linspace(_HORIZON, last, _WAITS)[1:].tolist()]
