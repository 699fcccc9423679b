"""The curve of one descent as a nonlinear program of CasADi."""

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np

from optiplan.arrays import Array, Index
from optiplan.planners.trajopt.bspline_basis import FIXED
from optiplan.planners.trajopt.nonlinear.blocks import LinearRows, Parameters, RowBlock, function_of, slots_for
from optiplan.planners.trajopt.program.qp import REGULARISATION
from optiplan.planners.trajopt.program.transcription import Transcription
from optiplan.planners.trajopt.terms.integrals import IntegralCost, JerkCost, shares
from optiplan.planners.trajopt.terms.term import Cost, Curve, SoftRows, Term
from optiplan.records import dataclass

SHORTEST, LONGEST = 0.5, 2.0
"""Bounds of the duration in one program, as multiples of the duration that it begins with."""

FLAT = 1e-6
"""Curvature of the duration and the slacks: programs are strictly convex in these too."""

HELD = ("held control points", "held control points by T", "held control points by T^2")
"""Blocks of p; the latter two of moving ends."""

RATES = ("velocity", "acceleration", "jerk")


@dataclass(frozen=True, eq=False)
class _SoftBlock:
    """A term in the program.

    Attributes:
        term: the term.
        rows: its rows, slacks in them.
        slack: (S,) one a sample.
        values: its parameters, by name, on a curve with its linearised rows.
        slots: rows that a sample has for linearised ones; 0 where they are expressions.
    """

    term: Term
    rows: RowBlock
    slack: ca.MX
    values: Callable[[Curve, SoftRows], dict[str, Array]]
    slots: int = 0


class CurveProgram:
    """Minimise cost + penalty over the free control points of a spline, its duration and what is missing of terms.

    The spline is q(u), u = t / T. Its ends are held: three control points each, which are parameters. Those of an open
    end move as one. With `moving` ends they depend on the duration: H0 + H1 T + H2 T². Variables are C (n, M), one
    control point after another, T, and a slack s >= 0 for each sample of each term. With rows lbg <= g(x, p) <= ubg:

        velocity, acceleration, jerk    V / (T v), A / (T² a), J / (T³ j) in [-1, 1] of derivative control points, which
                                        bound the curve at all times
        torques, path constraints       (g(q, v, a) - least) / unit + s >= 0 at samples, with exact derivatives
        clearance                       (d + grad d . (q - q')) / unit + s >= 0 of the nearest pairs at samples, whose
                                        numbers are parameters: linearised at the curve q'

        cost      time w T + jerk w T^-5 C' H C + w T sum share_k |r_k|², r of the objective's integrals
        penalty   sum of price s

    Nothing in it calls back into Python: `casadi.Function.save` writes it.

    Attributes:
        x: (X,) variables; `p`: (P,) parameters, `blocks` says how many of each name.
        cost, penalty: s.
        g: (R,) rows; `lbg`, `ubg` bounds.
        control: (n, M), `duration`: the variables as one knows them; `slack`: (S,).
        q, v, a: (n, N) at the samples; use them in a cost of your own.
        samples: (N,) fractions of the duration.
    """

    def __init__(
        self,
        transcription: Transcription,
        first: Sequence[SoftRows],
        *,
        moving: bool = False,
        machine_code: bool = False,
    ) -> None:
        joint_names, self._machine_code = transcription.robot.joint_names, machine_code
        self.transcription, self.joint_names, self.instants = transcription, joint_names, transcription.samples
        basis, samples, count = transcription.basis, transcription.samples, len(joint_names)
        self.samples, self._parameters = samples.u, Parameters()
        self.control, self.duration = ca.MX.sym("C", count, basis.variables), ca.MX.sym("T")
        T = self.duration
        powers = [self._parameters.block(name, count, 2 * FIXED) for name in (HELD if moving else HELD[:1])]
        self._held = sum((points * T**order for order, points in enumerate(powers)), ca.MX(0))
        self.q, self.v, self.a = (self.points(matrix) / T**order for order, matrix in enumerate(samples.at))
        terms = enumerate(zip(transcription.terms, first, strict=True))
        self.soft: list[_SoftBlock] = []
        for k, (term, linearised) in terms:
            self._add(f"term {k}", term, linearised)
        self._linear_costs: list[tuple[IntegralCost, LinearRows]] = []
        self._squares: list[ca.MX] = []  # residuals of the costs, each times the root of its weight
        self.cost = transcription.objective.time * T + sum(self._cost(cost) for cost in transcription.costs)
        prices = self._parameters.block("prices", len(self.soft))
        self.penalty = sum((prices[k] * ca.sum1(block.slack) for k, block in enumerate(self.soft)), ca.MX(0))
        self.slack = ca.vertcat(*(block.slack for block in self.soft))
        self.x = ca.veccat(self.control, T, self.slack)
        self.p, self.blocks = self._parameters.vector, dict(self._parameters.sizes)
        self.rows = [*self._rate_rows(), *(block.rows for block in self.soft)]
        self.g = ca.vertcat(*(block.rows for block in self.rows))
        self.lbg, self.ubg = (np.concatenate([getattr(b, side) for b in self.rows]) for side in ("least", "most"))

    def program(self) -> dict[str, ca.MX]:
        """Return `{"x": …, "p": …, "f": …, "g": …}` for `casadi.nlpsol`, f = cost + penalty."""
        return {"x": self.x, "p": self.p, "f": self.cost + self.penalty, "g": self.g}

    def gauss_newton(self) -> ca.Function:
        """Return the Hessian for CasADi's SQP: (x, p, ., .) -> (X, X), with the curvature of squares alone.

        2 w T share J' J of residuals r with J = dr / dx, likewise of the jerk, and `REGULARISATION` of each control
        point over what its joint can travel in that time, so that programs are strictly convex.
        """
        travel = ca.DM(np.tile(self.transcription.limits.velocity, self.transcription.basis.variables))
        flat = ca.DM(np.full(self.slack.numel() + 1, FLAT))
        hessian = ca.diag(ca.vertcat(REGULARISATION / (travel**2 * self.duration), flat))
        for squares in self._squares:
            slopes = ca.jacobian(squares, self.x)
            hessian += 2.0 * slopes.T @ slopes
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", self.g.numel())
        names = ["x", "p", "lam_f", "lam_g"], ["hess_gamma_x_x"]
        return ca.Function("nlp_hess_l", [self.x, self.p, lam_f, lam_g], [hessian], *names)

    def fits(self, rows: Sequence[SoftRows]) -> bool:
        """Return whether linearised rows of all terms, in their order, have slots for all of them."""
        by_term = dict(zip(self.transcription.terms, rows, strict=True))
        return all(slots_for(by_term[block.term]) <= block.slots for block in self.soft if block.slots)

    def values(self, curve: Curve, rows: Sequence[SoftRows], span: float, held: Sequence[Array] | None = None) -> Array:
        """Return p (P,): linearised at a curve, whose terms have these rows, prices for motions of `span` s.

        Args:
            curve: the curve.
            rows: of each term.
            span: s.
            held: (6, n) each, the held control points H0, H1, H2 of moving ends; None: those of the curve.
        """
        points = [np.vstack([curve.control[:FIXED], curve.control[-FIXED:]])] if held is None else held
        by_name = {
            **dict(zip(HELD, points, strict=False)),
            "prices": np.array([block.term.price * span for block in self.soft]),
        }
        by_term = dict(zip(self.transcription.terms, rows, strict=True))
        for block in self.soft:
            by_name |= block.values(curve, by_term[block.term])
        for cost, linear in self._linear_costs:
            value, (slope, _, _) = cost.residuals(curve)
            by_name |= linear.at(curve, np.arange(len(value)), value[:, 0], slope[:, 0])
        return self._parameters.values(by_name)

    def point(self, curve: Curve, rows: Sequence[SoftRows]) -> Array:
        """Return x (X,) of a curve: slacks are what is missing."""
        by_term = dict(zip(self.transcription.terms, rows, strict=True))
        parts = [self.transcription.basis.moving(curve.control).ravel(), np.array([curve.duration])]
        for block in self.soft:
            worst, found = np.zeros(len(self.samples)), by_term[block.term]
            np.maximum.at(worst, found.sample, -found.value / block.term.unit)
            parts.append(worst[block.rows.columns])
        return np.concatenate(parts)

    def bounds(self, curve: Curve, reach: Array | None = None) -> tuple[Array, Array]:
        """Return lbx and ubx (X,): joint limits, at most `reach` (n,) from the curve; slacks at least 0."""
        limits, moving = self.transcription.limits, self.transcription.basis.moving(curve.control)
        low, high = np.broadcast_to(limits.lower, moving.shape), np.broadcast_to(limits.upper, moving.shape)
        if reach is not None:
            low, high = np.maximum(low, moving - reach), np.minimum(high, moving + reach)
        low, high = np.minimum(low, moving), np.maximum(high, moving)
        slacks = self.slack.numel()
        lbx = np.concatenate([low.ravel(), [SHORTEST * curve.duration], np.zeros(slacks)])
        return lbx, np.concatenate([high.ravel(), [LONGEST * curve.duration], np.full(slacks, np.inf)])

    def moved(self, x: Array, control: Array) -> tuple[Array, float]:
        """Return the control points (K, n) of variables x, ends as of `control` (K, n), and the duration, s."""
        basis, count = self.transcription.basis, self.control.numel()
        change = x[:count].reshape(basis.variables, -1) - basis.moving(control)
        return basis.moved(control, change), float(x[count])

    def points(self, matrix: Array) -> ca.MX:
        """Return (n, R), what a matrix (R, K) makes of the control points, held ones too."""
        basis = self.transcription.basis
        held = np.column_stack([matrix[:, :FIXED], matrix[:, -FIXED:] * (not basis.open_end)])
        free = basis.by_variables(matrix)
        return self.control @ ca.sparsify(ca.DM(free.T)) + self._held @ ca.sparsify(ca.DM(held.T))

    def _rate_rows(self) -> list[RowBlock]:
        """Return the rows of velocities, accelerations and jerks."""
        found = []
        made = zip(RATES, self.transcription.basis.bounded, self.transcription.rates, strict=True)
        for order, (kind, matrix, limit) in enumerate(made, start=1):
            known = np.flatnonzero(np.isfinite(limit)).tolist()
            if known:
                rows = self.points(matrix)[known, :] / ca.repmat(ca.DM(limit[known]), 1, len(matrix))
                most = np.ones(rows.numel())
                names = tuple(f"{kind} of {self.joint_names[j]}" for j in known)
                flat = ca.vec(rows) / self.duration**order
                found.append(RowBlock(kind, flat, -most, most, np.arange(len(matrix)), names))
        return found

    def _add(self, name: str, term: Term, first: SoftRows) -> None:
        """Add a term as expressions, or as slots for linearised rows; nothing where it has no rows at all."""
        expressed = term.expressed()
        if expressed is None:
            self.soft.append(self._linearised(name, term, first))
            return
        made, count = self._function("rows", expressed.build), len(expressed.samples)
        if made is None or not count:
            return
        where = expressed.samples.tolist()
        value = made.map(count)(self.q[:, where], self.v[:, where], self.a[:, where])
        least = self._parameters.block(f"{name}, {term.name}: least", *value.shape)
        (key,) = list(self._parameters.sizes)[-1:]
        slack = ca.MX.sym(name, count)
        rows = (value - least) / term.unit + ca.repmat(slack.T, value.shape[0], 1)
        labels = expressed.labels or self._labels(term, value.shape[0])
        block = _at_least_zero(term, rows, expressed.samples, labels)
        self.soft.append(_SoftBlock(term, block, slack, lambda curve, _: {key: expressed.least(curve)}))

    def _linearised(self, name: str, term: Term, first: SoftRows) -> _SoftBlock:
        joints, count, slots = len(self.joint_names), len(self.samples), slots_for(first)
        linear = LinearRows.among(self._parameters, f"{name}, {term.name}", slots, joints, count)
        slack = ca.MX.sym(name, count)
        rows = linear.expression(self.q, self.duration) / term.unit + ca.repmat(slack, 1, slots)
        block = _at_least_zero(term, rows.T, np.arange(count), self._labels(term, slots))
        return _SoftBlock(term, block, slack, lambda curve, rows: linear.values(rows, curve, term.unit), slots)

    def _labels(self, term: Term, count: int) -> tuple[str, ...]:
        """Return names of the rows of a sample; terms of one name count on."""
        first = sum(len(block.rows.labels) for block in self.soft if block.term.name == term.name)
        return tuple(f"{term.name} {first + k}" for k in range(count))

    def _cost(self, cost: Cost) -> ca.MX:
        """Return a cost beside the duration."""
        if isinstance(cost, JerkCost):
            jerks = self.points(self.transcription.basis.jerk_root)
            return self._squared(ca.vec(jerks) * ca.sqrt(cost.weight / self.duration**5))
        assert isinstance(cost, IntegralCost)
        if cost.build is None:
            linear = LinearRows.among(self._parameters, cost.name, 1, len(self.joint_names), len(self.samples))
            self._linear_costs.append((cost, linear))
            residuals = linear.expression(self.q, self.duration).T
        else:
            made = self._function("residual", cost.build)
            assert made is not None
            residuals = made.map(len(self.samples))(self.q, self.v, self.a)
        weights = ca.DM(np.sqrt(cost.weight * shares(self.samples))[None])
        return self._squared(ca.vec(residuals * ca.repmat(weights, residuals.shape[0], 1)) * ca.sqrt(self.duration))

    def _function(self, name: str, build: Callable[[Any], Any]) -> ca.Function | None:
        return function_of(self.transcription.robot, name, build, self._machine_code)

    def _squared(self, residuals: ca.MX) -> ca.MX:
        self._squares.append(residuals)
        return ca.sumsqr(residuals)


def _at_least_zero(term: Term, rows: ca.MX, samples: Index, labels: tuple[str, ...]) -> RowBlock:
    """Return rows (m, S) >= 0 of a term at samples (S,)."""
    size = rows.numel()
    return RowBlock(term.name, ca.vec(rows), np.zeros(size), np.full(size, np.inf), samples, labels)
