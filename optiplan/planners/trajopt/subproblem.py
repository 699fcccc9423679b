"""The quadratic program of one step: everything linear, inside a trust region."""

from typing import NamedTuple

import numpy as np
import qpsolvers
import scipy.sparse as sp

from optiplan.arrays import Array
from optiplan.planners.trajopt.transcription import SoftRows, Transcription

REGULARISATION = 1e-3
"""Cost of the squared change of each control point, s/rad^2: it makes the program strictly convex."""


class Step(NamedTuple):
    """A proposed step: new control points, new duration, and the decrease of the merit that the model promises."""

    control: Array
    duration: float
    promise: float


class Subproblem:
    """Builds and solves the program; what depends only on the spline and the limits is built once.

    Variables: changes of the free control points (joint by joint), change of T, and a slack for every sample with soft
    rows. Rows of the derivative control points at the current (C', T'), for order r = 1, 2, 3 and limit b:
    +-D_r C <= b (T'^r + r T'^(r-1) (T - T')), inside the true bound because T^r is convex, each divided by b T'^r.
    """

    def __init__(self, transcription: Transcription, solver: str) -> None:
        self.transcription, self.solver = transcription, solver
        basis, bounds = transcription.basis, transcription.bounds
        self._rows = np.vstack(basis.derivative[1:])  # (R, K)
        self._order = np.concatenate([np.full(len(basis.derivative[r]), r) for r in (1, 2, 3)])  # (R,)
        self._limit = np.array(bounds)[self._order - 1]  # (R, n)
        joints = range(self._limit.shape[1])
        self._blocks = sp.block_diag([self._rows[:, basis.free] / self._limit[:, [j]] for j in joints], format="csr")
        self._row_order = np.tile(self._order, len(joints)).astype(float)

    def solve(self, control: Array, duration: float, soft: list[tuple[SoftRows, float]], radius: float) -> Step | None:
        """One step from (control, duration); `soft` pairs rows with their penalty; None when the solver gives up."""
        objective, free = self.transcription.objective, self.transcription.basis.free
        matrix, right, penalties = self._constraints(control, duration, soft)
        moving = control[free].T.ravel()
        count, slacks = len(moving), len(penalties)
        jerk = self.transcription.jerk_cost(control, duration)
        quadratic = sp.block_diag(
            [jerk.hessian + REGULARISATION * sp.eye(count), 1e-6 * sp.eye(slacks + 1)], format="csc"
        )
        linear = np.concatenate([jerk.gradient, [objective.time + jerk.by_duration], penalties])
        limits = self.transcription.limits
        below, above = (np.repeat(side, count // len(side)) - moving for side in (limits.lower, limits.upper))
        low = np.concatenate([np.clip(below, -radius, 0.0), [-0.5 * duration], np.zeros(slacks)])
        high = np.concatenate([np.clip(above, 0.0, radius), [duration], np.full(slacks, np.inf)])
        program = qpsolvers.Problem(quadratic, linear, matrix, right, None, None, low, high)
        solution = qpsolvers.solve_problem(program, solver=self.solver)
        if not solution.found or solution.x is None:
            return None
        x = solution.x
        proposal = control.copy()
        proposal[free] += x[:count].reshape(control.shape[1], -1).T
        now = sum(penalty * rows.violation() for rows, penalty in soft)
        change = linear[: count + 1] @ x[: count + 1] + 0.5 * x[:count] @ (jerk.hessian @ x[:count])
        promise = now - change - penalties @ np.maximum(x[count + 1 :], 0.0)
        return Step(proposal, duration + float(x[count]), float(promise))

    def _constraints(
        self, control: Array, duration: float, soft: list[tuple[SoftRows, float]]
    ) -> tuple[sp.csc_matrix, Array, Array]:
        share = ((self._rows @ control) / (self._limit * duration ** self._order[:, None])).T.ravel()
        scaled = sp.diags(duration**-self._row_order) @ self._blocks
        by_duration = sp.csr_matrix(-self._row_order[:, None] / duration)
        grid: list[list[sp.spmatrix | None]] = [[scaled, by_duration], [-scaled, by_duration]]
        right, penalties = [1.0 - share, 1.0 + share], [np.zeros(0)]
        for rows, penalty in soft:
            samples, column = np.unique(rows.sample, return_inverse=True)
            shape = (len(column), len(samples))
            slack = sp.csr_matrix((-np.ones(len(column)), (np.arange(len(column)), column)), shape=shape)
            for line in grid:
                line.append(None)
            padding: list[sp.spmatrix | None] = [None] * (len(grid[0]) - 3)
            grid.append([-sp.csr_matrix(rows.by_control), -sp.csr_matrix(rows.by_duration[:, None]), *padding, slack])
            right.append(rows.value)
            penalties.append(np.full(len(samples), penalty))
        return sp.bmat(grid, format="csc"), np.concatenate(right), np.concatenate(penalties)
