"""Quadratic program of one step: linearised constraints inside a trust region."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from optiplan.arrays import Array
from optiplan.libraries import loading
from optiplan.planners.trajopt.program.transcription import Transcription
from optiplan.planners.trajopt.terms.term import SoftRows

if TYPE_CHECKING:
    import qpsolvers
    import scipy.sparse as sp

REGULARISATION = 5e-3
"""Cost of the squared change of each control point, in the program's own variables: it makes it strictly convex."""

NEAR = 0.2
"""Share of their limit below which derivative rows are omitted until a solution exceeds them."""

EXCEEDED = 0.01
"""Relative excess allowed in an omitted row: the duration of the step is computed anew anyway."""

ROUNDS = 8
"""Largest number of solutions of a program, each with the rows exceeded by the last one."""

TOLERANCES: dict[str, dict[str, Any]] = {
    "piqp": {"eps_abs": 1e-5, "eps_rel": 1e-5, "eps_duality_gap_abs": 1e-5, "eps_duality_gap_rel": 1e-5}
}
"""Settings of solvers whose defaults are more accurate than a step needs."""


class Penalty(NamedTuple):
    """Soft rows and the price of a violation: `price` in s for each `unit` of the rows' value."""

    rows: SoftRows
    price: float
    unit: float

    def cost(self) -> float:
        """Return the cost, s, of the current violation."""
        return self.price * self.rows.violation() / self.unit


class Step(NamedTuple):
    """Proposed step: new control points, new duration, and the decrease of the merit predicted by the model."""

    control: Array
    duration: float
    promise: float


class _Objective(NamedTuple):
    """1/2 x' `quadratic` x + `linear`' x; the merit shares `hessian` and its second derivative `twice` by T."""

    quadratic: "sp.csc_matrix"
    linear: Array
    hessian: "sp.csc_matrix"
    twice: float

    def cost(self, x: Array, count: int) -> float:
        """Return the model's change of the merit over T at the given slacks, without the regularisation."""
        moved, slack = x[:count], np.maximum(x[count + 1 :], 0.0)
        smooth = self.linear[: count + 1] @ x[: count + 1] + 0.5 * moved @ (self.hessian @ moved)
        smooth += 0.5 * self.twice * x[count] ** 2
        return float(smooth + self.linear[count + 1 :] @ slack)


class Subproblem:
    """Build and solve the program; data of the spline and the limits alone are built once.

    Variables have no unit. They are the changes of the free control points over v_j `span` (joint speed times a time
    typical of the motion), the change of T over T, and a slack for every sample with soft rows, in the rows' unit.
    Control points come one after another, so that neighbours in time are neighbours in the program. The rows of the
    derivative control points at the current (C', T'), for order r = 1, 2, 3 and limit b, are
    +-D_r C <= b (T'^r + r T'^(r-1) (T - T')), each divided by b T'^r. They lie inside the true bound because T^r is
    convex. The objective is the merit over T'.
    """

    def __init__(self, transcription: Transcription, solver: str) -> None:
        self.transcription, self.solver = transcription, solver
        basis, bounds = transcription.basis, transcription.rates
        self._rows = np.vstack(basis.bounded)  # (R, K)
        self._free_rows = basis.by_variables(self._rows)  # (R, M)
        self._order = np.repeat([1, 2, 3], [len(rows) for rows in basis.bounded])  # (R,)
        self._limit = np.array(bounds)[self._order - 1]  # (R, n)
        self._met = np.zeros((2, *self._limit.shape), dtype=bool)  # rows exceeded by an earlier solution

    def solve(
        self, control: Array, duration: float, soft: Sequence[Penalty], radius: float, span: float
    ) -> Step | None:
        """Return one step from (control, duration); None when the solver fails.

        Args:
            control: (K, n), rad or m.
            duration: s.
            soft: rows that may be violated, at a price.
            radius: of the trust region, in shares of v_j `span`.
            span: s.
        """
        with loading():
            import qpsolvers
            import scipy.sparse as sp

        basis, limits = self.transcription.basis, self.transcription.limits
        moving = basis.moving(control)
        scale, count = np.tile(limits.velocity * span, len(moving)), moving.size
        within = [part._replace(rows=within_reach(part.rows, scale * radius, duration)) for part in soft]
        soft_rows, soft_right, prices = soft_program(within, scale, duration)
        program = self._program(control, duration, scale, prices)
        below, above = ((side - moving).ravel() / scale for side in (limits.lower, limits.upper))
        low = np.concatenate([np.clip(below, -radius, 0.0), [-0.5], np.zeros(len(prices))])
        high = np.concatenate([np.clip(above, 0.0, radius), [1.0], np.full(len(prices), np.inf)])
        share = (self._rows @ control) / (self._limit * duration ** self._order[:, None])  # (R, n)
        wanted = (np.stack([share, -share]) > NEAR) | self._met
        for _ in range(ROUNDS):
            hard_rows, hard_right = self._hard(wanted, share, scale, duration)
            padded = np.hstack([hard_rows, np.zeros((len(hard_right), len(prices)))])
            matrix, right = np.vstack([padded, soft_rows]), np.concatenate([hard_right, soft_right])
            problem = qpsolvers.Problem(
                program.quadratic, program.linear, sp.csc_matrix(matrix), right, None, None, low, high
            )
            solved = solution_of(problem, self.solver)
            if solved is None:
                return None
            x = solved
            change = (x[:count] * scale).reshape(moving.shape)
            after = share + (self._free_rows @ change) / (self._limit * duration ** self._order[:, None])
            allowed = 1.0 + self._order[:, None] * x[count] + EXCEEDED
            beyond = (np.stack([after, -after]) > allowed) & ~wanted
            if not beyond.any():
                break
            wanted |= beyond
            self._met |= beyond
        now = sum(part.cost() for part in soft) / duration
        promise = duration * (now - program.cost(x, count))
        return Step(basis.moved(control, change), duration * (1.0 + float(x[count])), float(promise))

    def _program(self, control: Array, duration: float, scale: Array, prices: Array) -> "_Objective":
        """Return the objective: time, costs and the slacks' prices, over T, with a small regularisation."""
        import scipy.sparse as sp

        costs = self.transcription.cost_model(self.transcription.curve(control, duration))
        weight = self.transcription.objective.time
        hessian = costs.hessian().multiply(scale[:, None]).multiply(scale[None, :]) / duration
        curvature = hessian + REGULARISATION * sp.eye(len(scale))
        twice = costs.twice_by_duration * duration
        flat = 1e-6 * np.ones(len(prices) + 1)
        flat[0] += twice
        quadratic = sp.block_diag([curvature, sp.diags(flat)], format="csc")
        linear = np.concatenate([costs.gradient * scale / duration, [weight + costs.by_duration], prices / duration])
        return _Objective(quadratic, linear, hessian, twice)

    def _hard(self, wanted: npt.NDArray[np.bool_], share: Array, scale: Array, duration: float) -> tuple[Array, Array]:
        """Return rows (k, M n + 1), right sides (k,) of the wanted (2, R, n) derivative control points, both signs."""
        side, row, joint = np.nonzero(wanted)
        sign = 1.0 - 2.0 * side
        n, knots = wanted.shape[2], self._free_rows.shape[1]
        rows = np.zeros((len(row), knots, n))
        weight = sign / (self._limit[row, joint] * duration ** self._order[row]) * scale[joint]
        rows[np.arange(len(row)), :, joint] = self._free_rows[row] * weight[:, None]
        flat = np.column_stack([rows.reshape(len(row), -1), -self._order[row].astype(float)])
        return flat, 1.0 - sign * share[row, joint]


def solution_of(problem: "qpsolvers.Problem", solver: str) -> Array | None:
    """Return the solution of a program, as exact as a step needs it; None when the solver fails."""
    import qpsolvers

    solution = qpsolvers.solve_problem(problem, solver=solver, **TOLERANCES.get(solver, {}))
    return solution.x if solution.found else None


def within_reach(rows: SoftRows, travel: Array, duration: float) -> SoftRows:
    """Return the rows that a step can violate, in which variables move by `travel` (M n,) and T by itself at most."""
    reach = np.abs(rows.by_control) @ travel + np.abs(rows.by_duration) * duration
    return rows.only(rows.value < reach)


def soft_program(soft: Sequence[Penalty], scale: Array, duration: float) -> tuple[Array, Array, Array]:
    """Return rows (k, M n + 1 + slacks), right sides (k,) and the price, s, of each slack: one per sample and kind."""
    blocks, right, prices = [], [], []
    columns = [np.unique(part.rows.sample, return_inverse=True) for part in soft]
    total, begin = sum(len(samples) for samples, _ in columns), 0
    for part, (samples, column) in zip(soft, columns, strict=True):
        rows = part.rows
        slack = np.zeros((len(column), total))
        slack[np.arange(len(column)), begin + column] = -1.0
        moving = np.column_stack([rows.by_control * scale, rows.by_duration * duration]) / -part.unit
        blocks.append(np.hstack([moving, slack]))
        right.append(rows.value / part.unit)
        prices.append(np.full(len(samples), part.price))
        begin += len(samples)
    return np.vstack(blocks), np.concatenate(right), np.concatenate(prices)
