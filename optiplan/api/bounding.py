"""`bound`: how short a motion of a problem can be at best, proved."""

import numpy as np

from optiplan.api.planning import BUDGET, checked_problem, positive_seconds, verify
from optiplan.errors import described, wrong_argument
from optiplan.problem.problem import Problem
from optiplan.runs.run import Run
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.bounds.bound import bound_of, unsupported
from optiplan.verify.bounds.duration_bound import DurationBound


def bound(problem: Problem, budget: float = BUDGET, motion: Run | Trajectory | None = None) -> DurationBound:
    """Prove how long any motion of a problem takes at least, obstacles included.

    With the obstacles left out it is the time that the slowest joint needs alone. Then boxes of configurations are
    closed: those in collision throughout, and those that are too far from start and goal to be passed in less than T.
    If no open ones join start and goal, no motion is shorter than T. The bound grows with the budget.

    Holds at: all times, of every motion that `op.verify` accepts. Limits of torque, path constraints, via points, a
    clearance, a tracking error and obstacles that move are not counted (`left_out`): with them motions can only be
    longer.

    Args:
        problem: goals are values of joints, one or several; a bound of several is that of the least.
        budget: seconds of wall time.
        motion: a known one, as `op.plan` returns it: nothing is tried beyond its duration, so that the time is spent
            where it matters. It does not change what a bound means.

    Returns:
        The bound: `seconds`, `gap(duration)`, `words(duration)`, `history`.

    Raises:
        InputError: an argument that does not fit; a task, a moving start, or a goal whose ends are not listed.

    Example:
        >>> import optiplan as op
        >>> problem = op.load_problem("12_planar")
        >>> run = op.plan(problem)
        >>> op.bound(problem, budget=1.0, motion=run).gap(run.duration) < 0.7
        True
    """
    checked_problem(problem, "bound")
    seconds = positive_seconds("bound", budget)
    known = _duration(problem, motion)
    require_bound(problem)
    return bound_of(problem, seconds, known)


def require_bound(problem: Problem) -> None:
    """Refuse a problem without a known bound.

    Raises:
        InputError: which part of it is the reason.
    """
    if (missing := unsupported(problem)) is not None:
        field, found = missing
        expected = "a single motion from rest to rest, whose goals are values of joints"
        raise wrong_argument("bound", field, found, expected)


def _duration(problem: Problem, motion: Run | Trajectory | None) -> float:
    """The duration of a motion that holds, s; inf without one."""
    if motion is None:
        return np.inf
    trajectory = motion.trajectory if isinstance(motion, Run) else motion
    if not isinstance(trajectory, Trajectory):
        raise wrong_argument("bound", "motion", described(motion), "a run with a motion, or a trajectory")
    # Problems put together by hand have no hash: theirs are not the same.
    same = isinstance(motion, Run) and motion.verified and motion.problem.hash == problem.hash != ""
    if not same and not verify(problem, trajectory).verified:
        raise wrong_argument("bound", "motion", "a motion that is not verified on this problem", "one that is")
    return trajectory.duration
