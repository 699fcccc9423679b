"""The program of a problem along a guess."""

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.planners.trajopt.bspline_basis import SplineBasis
from optiplan.planners.trajopt.nonlinear.options import CasadiOptions
from optiplan.planners.trajopt.nonlinear.trajectory_nlp import TrajectoryNlp
from optiplan.planners.trajopt.nonzero_end_optimiser import EndStates
from optiplan.planners.trajopt.optimizer import Optimiser
from optiplan.planners.trajopt.program.transcription import Transcription
from optiplan.planners.trajopt.terms.contacts import Margins
from optiplan.planners.trajopt.terms.free_end import FreeEnd
from optiplan.problem.problem import JointGoal, Problem
from optiplan.trajectory.trajectory import Trajectory

_NEAR = 1e-6
"""rad or m: a guess that ends so near to a goal configuration ends there, and one so near to a spline is that."""

_LEAST, _MOST = 8, 200
"""Breakpoints of a motion that may be a spline."""


def nlp_along(problem: Problem, model: CollisionModel, guess: Trajectory | Array) -> TrajectoryNlp:
    """Return the program of a curve near a motion, or along the straight line between two configurations (2, n).

    A motion that is such a curve itself, as those of the optimisers are, is its first point to rounding. Where it is
    closer to bodies than the margin of the planner, the program lets it be so.

    Args:
        problem: without vias and task.
        model: of its robot and scene.
        guess: from the start to a goal.
    """
    ends = guess if isinstance(guess, np.ndarray) else np.array([guess.start, guess.end])
    free = None if problem.nonzero_ends else _free_end(problem, ends[-1])
    basis = None if isinstance(guess, np.ndarray) else _own_basis(guess, free is not None)
    optimiser = Optimiser(problem, model, CasadiOptions(), free, basis)
    basis, held, duration = optimiser.basis, None, 0.0
    if isinstance(guess, np.ndarray):
        control = optimiser.along(guess)
    else:
        control, duration = _fitted(basis, guess), guess.duration
    control = optimiser.within_limits(control)
    if problem.nonzero_ends:
        states = EndStates(problem.start_state, problem.end_states(ends[-1])[0])
        duration = duration or basis.shortest_duration(control, problem.limits.rates)
        control, held = states.held(basis, control, duration), states.powers(basis)
    instants = optimiser.instants(control)
    margin = optimiser.options.margin
    if not isinstance(guess, np.ndarray):
        found = model.near(basis.at(np.sort(instants)) @ control, margin)
        margin = max(0.0, float(found.distance.min(initial=margin)))
    terms = optimiser.constraint_terms.begin() + (() if free is None else free.terms)
    margins = Margins.between(model, control[[0, -1]], margin)
    transcription = Transcription(problem, model, basis, margins, terms, optimiser.costs)
    transcription.set_samples(instants)
    return TrajectoryNlp(transcription, control, max(duration, transcription.shortest_duration(control)), held)


def _own_basis(motion: Trajectory, open_end: bool) -> SplineBasis | None:
    """Return the basis in which a motion is a spline; None where it is none, or one of very many pieces."""
    if not _LEAST <= len(motion.breakpoints) <= _MOST:
        return None
    basis = SplineBasis(motion.breakpoints / motion.duration, open_end)
    u = np.linspace(0.0, 1.0, 4 * basis.size)
    off = np.abs(basis.at(u) @ _fitted(basis, motion) - motion(u * motion.duration))
    return basis if off.max() < _NEAR else None


def _fitted(basis: SplineBasis, motion: Trajectory) -> Array:
    """Return the control points (K, n) of the spline near a motion, with its states at the ends."""
    u, T = np.linspace(0.0, 1.0, 4 * basis.size), motion.duration
    states = (motion.state(t) for t in (0.0, T))
    ends = (np.array([state.q, T * state.v, T**2 * state.a]) for state in states)
    return basis.fit(u, motion(u * T), basis.ends(*ends))


def _free_end(problem: Problem, q: Array) -> FreeEnd | None:
    """Return the pose goal or region in which a configuration (n,) is; None where that is a goal itself."""
    if any(isinstance(goal, JointGoal) and np.abs(goal.q - q).max() < _NEAR for goal in problem.goal):
        return None
    ends = (FreeEnd(problem, goal) for goal in problem.goal if not isinstance(goal, JointGoal))
    return next((end for end in ends if end.holds(q)), None)
