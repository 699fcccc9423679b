"""`casadi_problem`: the program that `trajopt` solves, for notebooks."""

from typing import TYPE_CHECKING

import numpy as np

from optiplan.api.planning import checked_problem
from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.collision.native_model import planning_model
from optiplan.errors import described, wrong_argument
from optiplan.planners.base import Budget, Failure
from optiplan.planners.common.goal_ranking import goal_sampler
from optiplan.planners.common.safety_ends import ending_at, with_ends
from optiplan.planners.common.tracking_tube import planned_in_tube
from optiplan.problem.problem import Problem
from optiplan.runs.run import Run
from optiplan.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from optiplan.planners.trajopt.nonlinear.trajectory_nlp import TrajectoryNlp

_LOOKING = 5.0
"""s for a goal configuration, where no guess is given."""


def casadi_problem(problem: Problem, guess: Run | Trajectory | None = None) -> "TrajectoryNlp":
    """Return the nonlinear program of planner `casadi`: variables, cost, rows and bounds, each with a name.

    It holds limits, torques, path constraints, the objective and contacts, as in a step of the planner, with the room
    that the tracking error takes and the distances that a clearance asks for. Distances are linearised at the guess,
    within a trust region; `arguments(x)` linearises them at another point. The end of a pose goal or region is free in
    it, that of any other goal is held; moving ends depend on the duration. The planner solves it from many first
    curves, and adds samples where bodies touch between them.

    Args:
        problem: without task, vias and obstacles that move: ask for one move.
        guess: a motion of this problem, whose ends are kept; None: straight to the nearest goal configuration.

    Returns:
        The program; `to_casadi()` is for `casadi.nlpsol`, `arguments()` for the solver, `trajectory(x)` for its answer.

    Raises:
        InputError: an argument that does not fit, or a problem with more than that.

    Example:
        >>> import optiplan as op
        >>> nlp = op.casadi_problem(op.load_problem("01_reach"))
        >>> solver = nlp.solver("ipopt")  # doctest: +SKIP
        >>> round(nlp.trajectory(solver(**nlp.arguments())["x"]).duration, 1)  # doctest: +SKIP
        0.8
    """
    from optiplan.planners.trajopt.nonlinear.from_guess import nlp_along

    checked_problem(problem, "casadi_problem")
    more = {
        "a task": problem.task,
        "via points": problem.vias,
        "obstacles that move": problem.scene.dynamic_obstacles,
    }
    found = [words for words, there in more.items() if there]
    if found:
        expected = "one move among obstacles that stand, without vias and task"
        raise wrong_argument("casadi_problem", "problem", f"a problem with {' and '.join(found)}", expected)
    problem, motion = planned_in_tube(problem), None if guess is None else _motion(problem, guess)
    if motion is None:
        problem = with_ends(problem, Budget(_LOOKING))
    else:
        problem = ending_at(problem, problem.start, motion.end)
    model = planning_model(problem.robot, problem.scene, error=problem.tracking_error)
    first = np.array([problem.start, _goal(problem, model)]) if motion is None else motion
    return nlp_along(problem, model, first)


def _goal(problem: Problem, model: CollisionModel) -> Array:
    """Return the nearest goal configuration (n,)."""
    budget = Budget(_LOOKING)
    sampler = goal_sampler(problem, model, budget)
    if isinstance(sampler, Failure):
        raise wrong_argument("casadi_problem", "problem", sampler.detail, "one whose goal can be reached, or a guess")
    return sampler.configurations[0]


def _motion(problem: Problem, guess: Run | Trajectory) -> Trajectory:
    """Return the motion of a guess."""
    motion = guess.trajectory if isinstance(guess, Run) else guess
    if not isinstance(motion, Trajectory):
        found = "a run without a motion" if isinstance(guess, Run) else described(guess)
        raise wrong_argument("casadi_problem", "guess", found, "a run of op.plan(…) with a motion, or a Trajectory")
    if motion.joint_names != problem.robot.joint_names:
        found = f"a motion of {', '.join(motion.joint_names)}"
        raise wrong_argument("casadi_problem", "guess", found, f"one of {', '.join(problem.robot.joint_names)}")
    return motion
