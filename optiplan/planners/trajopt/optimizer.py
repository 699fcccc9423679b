"""Optimise one initial guess to a trajectory that is checked between samples too."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array, distinct
from optiplan.collision.model import CollisionModel
from optiplan.libraries import loading
from optiplan.planners.base import Budget
from optiplan.planners.common.continuous_collision import Touch, contacts_along
from optiplan.planners.common.path_timing import within_torque
from optiplan.planners.path_constraints.motion_check import Broken, PathConstraints
from optiplan.planners.trajopt.bspline_basis import SplineBasis, bunched_basis
from optiplan.planners.trajopt.initial_guess import along_path
from optiplan.planners.trajopt.nonlinear.options import CasadiOptions
from optiplan.planners.trajopt.options import AUTO, TrajOptOptions
from optiplan.planners.trajopt.program.iteration_log import NOTHING, IterationLog
from optiplan.planners.trajopt.program.native_sqp import NativeSqp
from optiplan.planners.trajopt.program.native_step import step_solver
from optiplan.planners.trajopt.program.sqp import (
    GROWN,
    MAX_VIOLATION,
    SLOW,
    STUCK,
    Descended,
    Descender,
    DescentOptions,
    Sqp,
)
from optiplan.planners.trajopt.program.transcription import Transcription
from optiplan.planners.trajopt.terms.contacts import Margins
from optiplan.planners.trajopt.terms.integrals import integral_costs
from optiplan.planners.trajopt.terms.path_constraints import ConstraintTerms
from optiplan.planners.trajopt.terms.term import Term
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.trajectory.timing.time_scaling import scale_to_limits
from optiplan.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from optiplan.planners.trajopt.terms.free_end import FreeEnd


SPACING = 0.025
"""Initial bound on the motion of a body between two samples, m, roughly: no edge may pass between them."""

_LONGER = 1.5
"""Multiple of the duration of a descent's last curve up to which the cheapest duration is searched."""

ACTIVE = 1e-3
"""Clearance beyond its margin, m, below which a pair counts as held by it."""


@dataclass(frozen=True, eq=False)
class Attempt:
    """Result of one initial guess.

    Attributes:
        control: (K, n) control points, rad or m.
        trajectory: the curve in time.
        touches: the remaining contacts.
        broken: the path constraints that it still violates.
        close: whether the margin of some pair is active, so that a smaller margin may save time.
    """

    control: Array
    trajectory: Trajectory
    touches: tuple[Touch, ...]
    broken: tuple[Broken, ...]
    close: bool = False

    @property
    def free(self) -> bool:
        """Return whether nothing touches and no path constraint is violated."""
        return not (self.touches or self.broken)


class AttemptOptions(NamedTuple):
    """Options of one attempt.

    Attributes:
        margin: m; None: the planner's option.
        best: cost, s, of the best motion so far: a curve that stays far above it is given up.
        patient: whether a curve may take any time; else it is given up if it takes twice its initial time after 30
            steps.
        first: called with the first free curve.
    """

    margin: float | None = None
    best: float = np.inf
    patient: bool = False
    first: Callable[[Attempt], None] | None = None


_DEFAULTS = AttemptOptions()


def finer_basis(options: TrajOptOptions) -> SplineBasis:
    """Return the basis of refined curves, with twice the spans."""
    return bunched_basis(2 * options.spans, options.bunching, False)


class Optimiser:
    """Optimise curves of one problem from any seed; data of the problem alone are built once.

    Attributes:
        end: the set in which motions end; None: the end of the initial curve.
        constraints: on the path.
        constraint_terms: the same as terms.
        objective: parts of the cost; `costs`: those of them that are integrals, for the optimiser.
        steps: taken so far, in all attempts; `taken`: in the latest one.
        log: of the latest attempt.
    """

    def __init__(
        self,
        problem: Problem,
        model: CollisionModel,
        options: TrajOptOptions,
        end: "FreeEnd | None" = None,
        basis: SplineBasis | None = None,
    ) -> None:
        self.problem, self.model, self.options, self.end = problem, model, options, end
        self.basis = bunched_basis(options.spans, options.bunching, end is not None) if basis is None else basis
        self.constraints = PathConstraints(problem)
        self.constraint_terms = ConstraintTerms(self.constraints)
        self.objective = problem.objective_parts()
        self.costs = integral_costs(problem, model)
        self.steps = self.taken = 0
        self.log: IterationLog = NOTHING

    def spread(self, spans: int) -> None:
        """Give all further curves this number of spans in place of the option's."""
        self.options = replace(self.options, spans=spans)
        self.basis = bunched_basis(spans, self.options.bunching, self.end is not None)

    def along(self, waypoints: Array) -> Array:
        """Return the control points (K, n) of a curve near straight segments between waypoints (k, n)."""
        return along_path(self.basis, waypoints, self.problem.limits.velocity)

    def run(self, control: Array, budget: Budget, options: AttemptOptions = _DEFAULTS) -> Attempt | None:
        """Optimise from control points (K, n), check between the samples, add samples at contacts there, and repeat.

        None when bodies stay in deep penetration, gravity exceeds the torque limits, or the budget is cancelled. A
        stuck curve is checked between the samples, but gets no further samples. If the initial curve violates a
        constraint, the first curve without violations at the samples is checked between them at once: feasibility
        comes before duration.

        Args:
            control: of the first curve; its ends are kept, except a free one.
            budget: polled at every step; once it is over, the current curve is timed and checked.
            options: of this attempt.
        """
        control = self.within_limits(control)
        terms = self.constraint_terms.begin() + (() if self.end is None else self.end.terms)
        descender, u = self.descender(control, options.margin, terms), self.instants(control)
        attempt, self.taken, self.log = None, 0, NOTHING
        least = self.basis.shortest_duration(control, self.problem.limits.rates)
        best, first = options.best, options.first
        longest = np.inf if options.patient or terms or not self.problem.objective.only_time else GROWN * least
        looked: Attempt | None = None

        def go_on(control: Array, duration: float) -> bool:
            nonlocal looked, first
            looked = self.checked(control, self.timed(control, duration), budget)
            if looked is not None and looked.free and first is not None and not budget.cancelled:
                first(looked)
                first = None
            return looked is None or looked.free

        for _ in range(self.options.refinements + 1):
            descender.set_samples(u)
            left = self.options.iterations - self.taken
            found = descender.optimise(
                control, DescentOptions(left, lambda: budget.over, best, longest, None if terms else go_on)
            )
            self.count(found)
            control = found.control if self.end is None else self.end.landed(found.control)
            too_late = budget.over and self.problem.objective.time * found.duration >= best
            if too_late or budget.cancelled or found.missing > MAX_VIOLATION:
                return None
            if looked is None or not np.array_equal(looked.control, control):
                looked = self.checked(control, self.timed(control, found.duration), budget)
            if looked is None or budget.cancelled:
                return None
            attempt = replace(looked, close=found.nearest < ACTIVE)
            enough = self.taken >= self.options.iterations or (self.taken >= SLOW and found.duration > longest)
            if attempt.free or enough or budget.over or found.missing > STUCK:
                break
            u = self.more_instants(u, attempt)
        return attempt

    def within_limits(self, control: Array) -> Array:
        """Return control points (K, n) within the position limits, which a curve fitted to a path may exceed."""
        held, free = control.copy(), self.basis.free
        held[free] = np.clip(control[free], self.problem.limits.lower, self.problem.limits.upper)
        return held

    def count(self, found: Descended) -> None:
        """Count a descent as part of the latest attempt."""
        self.steps += found.steps
        self.taken += found.steps
        self.log = self.log.then(found.log)

    def checked(self, control: Array, trajectory: Trajectory | None, budget: Budget) -> Attempt | None:
        """Return a timed curve checked between the samples; None without one."""
        if trajectory is None:
            return None
        touches = tuple(contacts_along(self.model, trajectory, lambda: budget.cancelled))
        return Attempt(control, trajectory, touches, tuple(self.constraints.broken(trajectory)))

    def more_instants(self, u: Array, attempt: Attempt) -> Array:
        """Return samples u (N,) with more around an attempt's violations; raise the prices of violated constraints."""
        self.constraint_terms.raise_prices(attempt.broken)
        shares = [touch.t / attempt.trajectory.duration for touch in attempt.touches]
        shares += [one.share for one in attempt.broken]
        return np.concatenate([u, *(around(distinct(u), share) for share in shares)])

    def instants(self, control: Array, spacing: float = SPACING) -> Array:
        """Return the samples of a curve to begin with, at most about `spacing`, m, from one to the next."""
        u = _instants(self.basis, max(self.options.samples, int(self._length(control) / spacing)))
        return np.concatenate([u, self.constraints.instants, [] if self.end is None else [1.0]])

    def descender(
        self, control: Array, margin: float | None = None, terms: Sequence[Term] = (), duration: float = 0.0
    ) -> Descender:
        """Return what descends from curves with the ends of this one (K, n).

        Args:
            control: (K, n).
            margin: m; instead of the option's.
            terms: of path constraints.
            duration: s, after which dynamic obstacles are where the margins at the end regard them.
        """
        middle = self.options.margin if margin is None else margin
        margins = Margins.between(self.model, control[[0, -1]], middle, duration)
        transcription = Transcription(self.problem, self.model, self.basis, margins, terms, self.costs)
        if isinstance(self.options, CasadiOptions):
            from optiplan.planners.trajopt.nonlinear.subproblem import NlpDescent, NlpSubproblem

            return NlpDescent(NlpSubproblem(transcription, self.options))
        if self.options.solver == AUTO and core is not None and transcription.plain:
            return NativeSqp(transcription)
        return Sqp(step_solver(transcription, self.options.solver))

    def _length(self, control: Array) -> float:
        """Return the path length, m, of the joint origin that the curve carries farthest."""
        Q = self.basis.at(np.linspace(0.0, 1.0, self.options.samples)) @ control
        steps = np.diff(self.model.bounds.kinematics.poses(self.model.full(Q))[:, :, :3, 3], axis=0)
        return float(np.linalg.norm(steps, axis=2).sum(axis=0).max())

    def timed(self, control: Array, duration: float) -> Trajectory | None:
        """Return the curve at the least duration within limits, torques and speeds; None if gravity is too much."""
        names = self.problem.robot.joint_names
        trajectory = self.basis.trajectory(names, control, duration)
        limits = self.problem.limits
        timed = within_torque(self.problem.robot, limits, scale_to_limits(trajectory, limits))
        return None if timed is None else self._at_its_best(self.constraints.slowed(timed), duration)

    def _at_its_best(self, fastest: Trajectory, duration: float) -> Trajectory:
        """Return the motion at its cheapest duration: at most half longer than that of the descent, but for jerk."""
        stated = self.problem.objective
        if stated.only_time:
            return fastest
        if stated.plain and stated.time:  # cost(T) = time T + jerk J (T_f / T)^5, with J at the fastest duration T_f
            share = 5.0 * stated.jerk * fastest.squared_jerk() / (stated.time * fastest.duration)
            return fastest.scaled(fastest.duration * share ** (1.0 / 6.0)) if share > 1.0 else fastest
        with loading():
            from scipy.optimize import minimize_scalar

        most = max(1.0, _LONGER * duration / fastest.duration)
        found = minimize_scalar(
            lambda factor: self.objective.cost(fastest.scaled(fastest.duration * factor)),
            bounds=(1.0, most),
            method="bounded",
            options={"xatol": 1e-3},
        )
        slower = fastest.scaled(fastest.duration * float(found.x))
        return slower if self.objective.cost(slower) < self.objective.cost(fastest) else fastest


def attempt_record(seed: str, attempt: Attempt | None, steps: int, log: IterationLog) -> dict[str, Any]:
    """Return an attempt's entry in a planner's `info["attempts"]`, JSON-ready.

    Args:
        seed: kind of the initial guess.
        attempt: result of `Optimiser.run`.
        steps: taken.
        log: of its iterations.
    """
    record: dict[str, Any] = {"seed": seed, "free": attempt is not None and attempt.free, "iterations": steps}
    if attempt is not None:
        record["duration"] = attempt.trajectory.duration
        if attempt.touches:
            pair = attempt.touches[0].contact.pair
            record["touches"] = [pair.name_a, pair.name_b]
        if attempt.broken:
            record["breaks"] = attempt.broken[0].kept.name
    return record | log.to_dict()


def _instants(basis: SplineBasis, count: int) -> Array:
    """Return `count` equal steps of u, and ends and middles of the short spans: torques peak in the first instants."""
    edges = basis.breakpoints
    short = np.diff(edges) < 1.0 / count
    extra = np.concatenate([edges[1:][short], 0.5 * (edges[1:] + edges[:-1])[short]])
    inside = np.linspace(0.0, 1.0, count + 2)[1:-1]
    return np.concatenate([inside, extra[(extra > 0.0) & (extra < 1.0)]])


def around(u: Array, where: float) -> Array:
    """Return new samples at `where` and half-way to both of its neighbours among u (N,)."""
    place = int(np.searchsorted(u, where))
    low, high = (u[place - 1] if place else 0.0), (u[place] if place < len(u) else 1.0)
    return np.array([0.5 * (low + where), where, 0.5 * (where + high)])
