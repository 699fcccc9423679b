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
from optiplan.problem.problem import Problem
from optiplan.runs.run import Run
from optiplan.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from optiplan.planners.trajopt.program.nlp import TrajectoryNlp

_LOOKING = 5.0
"""s for a goal configuration, where no guess is given."""

_POINTS = 200
"""Samples of a guess."""


def casadi_problem(problem: Problem, guess: Run | Trajectory | None = None) -> "TrajectoryNlp":
    """Return the nonlinear program of `trajopt` for a problem: variables, cost, rows and bounds, each with a name.

    The ends are held. The planner solves it with an elastic penalty, from many first curves, and adds samples where
    bodies touch between them; here the rows are hard, and their samples are those that the planner begins with.

    Args:
        problem: at rest at both ends, with the objective time, without task, vias, path constraints and obstacles that
            move.
        guess: a motion of this problem, whose ends are kept; None: straight to the nearest goal configuration.

    Returns:
        The program; `to_casadi()` is for `casadi.nlpsol`, `arguments()` for the solver, `trajectory(x)` for its answer.

    Raises:
        InputError: an argument that does not fit, or a problem with more than that.

    Example:
        >>> import casadi
        >>> import optiplan as op
        >>> nlp = op.casadi_problem(op.load_problem("01_reach"))
        >>> options = {"ipopt.hessian_approximation": "limited-memory"}
        >>> solver = casadi.nlpsol("solver", "ipopt", nlp.to_casadi(), options)  # doctest: +SKIP
        >>> round(nlp.trajectory(solver(**nlp.arguments())["x"]).duration, 1)  # doctest: +SKIP
        0.8
    """
    from optiplan.planners.trajopt.optimizer import Optimiser
    from optiplan.planners.trajopt.options import TrajOptOptions
    from optiplan.planners.trajopt.program.nlp import TrajectoryNlp
    from optiplan.planners.trajopt.program.transcription import Transcription
    from optiplan.planners.trajopt.terms.contacts import Margins

    checked_problem(problem, "casadi_problem")
    _refuse(problem)
    model = planning_model(problem.robot, problem.scene)
    optimiser = Optimiser(problem, model, TrajOptOptions())
    if guess is None:
        control = optimiser.along(np.array([problem.start, _goal(problem, model)]))
    else:
        control = optimiser.basis.fit(np.linspace(0.0, 1.0, _POINTS), _points(problem, guess))
    control = optimiser.within_limits(control)
    margins = Margins.between(model, control[[0, -1]], optimiser.options.margin)
    transcription = Transcription(problem, model, optimiser.basis, margins)
    transcription.set_samples(optimiser.instants(control))
    return TrajectoryNlp(transcription, problem.robot.joint_names, control)


def _refuse(problem: Problem) -> None:
    """Raise an `InputError` for a problem with more than the program holds."""
    more = {
        "a task": problem.task,
        "via points": problem.vias,
        "path constraints": problem.path_constraints,
        "obstacles that move": problem.scene.dynamic_obstacles,
        "an objective beside the time": not problem.objective.plain,
        "a start that moves": np.any(problem.start_velocity) or np.any(problem.start_acceleration),
    }
    found = [words for words, there in more.items() if there]
    if found:
        expected = "one from rest to a goal, with the objective time, among bodies that stand"
        raise wrong_argument("casadi_problem", "problem", f"a problem with {' and '.join(found)}", expected)


def _goal(problem: Problem, model: CollisionModel) -> Array:
    """Return the nearest goal configuration (n,)."""
    budget = Budget(_LOOKING)
    sampler = goal_sampler(problem, model, budget)
    if isinstance(sampler, Failure):
        raise wrong_argument("casadi_problem", "problem", sampler.detail, "one whose goal can be reached, or a guess")
    return sampler.configurations[0]


def _points(problem: Problem, guess: Run | Trajectory) -> Array:
    """Return configurations (N, n) of a guess at equal times."""
    motion = guess.trajectory if isinstance(guess, Run) else guess
    if not isinstance(motion, Trajectory):
        found = "a run without a motion" if isinstance(guess, Run) else described(guess)
        raise wrong_argument("casadi_problem", "guess", found, "a run of op.plan(…) with a motion, or a Trajectory")
    if motion.joint_names != problem.robot.joint_names:
        found, expected = (
            f"a motion of {', '.join(motion.joint_names)}",
            f"one of {', '.join(problem.robot.joint_names)}",
        )
        raise wrong_argument("casadi_problem", "guess", found, expected)
    return np.asarray(motion(np.linspace(0.0, motion.duration, _POINTS)))
