"""The program of one step of a stretch: linearised constraints inside a trust region."""

from collections.abc import Sequence

import numpy as np

from optiplan.arrays import Array
from optiplan.libraries import loading
from optiplan.planners.task.optimisation.line_part import LinePart
from optiplan.planners.task.optimisation.move_part import MovePart
from optiplan.planners.task.optimisation.transcription import StretchCurve, StretchTranscription
from optiplan.planners.trajopt.program.qp import (
    NEAR,
    REGULARISATION,
    TOLERANCES,
    Penalty,
    Step,
    soft_program,
    within_reach,
)


class StretchProgram:
    """Builds and solves it, as `trajopt.program.qp.Subproblem` does for one curve.

    Variables have no unit: changes of free control points over v_j `span` tau_k, of the laws' over the path, of shares
    over themselves, of states between moves over what limits allow; then the change of T over T, and the slacks. Rows
    x of order r of part k, |x| <= (tau_k T)^r at (y', T'): |x' + dx dy| <= x_max (1 + r dT / T' + r dtau_k / tau_k'),
    inside the true bound because the power is convex.
    """

    def __init__(self, transcription: StretchTranscription) -> None:
        self.transcription = transcription

    def solve(
        self, control: Array, duration: float, soft: Sequence[Penalty], radius: float, span: float
    ) -> Step | None:
        """Return one step from (y, duration); None when the solver fails; see `trajopt.program.qp.Subproblem.solve`."""
        with loading():
            import qpsolvers
            import scipy.sparse as sp

        made = self.transcription
        curve = made.curve(control, duration)
        scale = self._scale(control, span)
        within = [part._replace(rows=within_reach(part.rows, scale * radius, duration)) for part in soft]
        soft_rows, soft_right, prices = soft_program(within, scale, duration)
        hard_rows, hard_right = self._hard(curve, scale, radius)
        rows = np.vstack([np.hstack([hard_rows, np.zeros((len(hard_right), len(prices)))]), soft_rows])
        right = np.concatenate([hard_right, soft_right])
        reach, slacks = np.full(made.size, radius), len(prices)
        low = np.concatenate([-reach, [-0.5], np.zeros(slacks)])
        high = np.concatenate([reach, [1.0], np.full(slacks, np.inf)])
        weight = np.concatenate([np.full(made.size, REGULARISATION), np.full(len(prices) + 1, 1e-6)])
        linear = np.concatenate([np.zeros(made.size), [1.0], prices / duration])
        shares = np.zeros((1, len(linear)))
        shares[0, : len(made.parts)] = scale[: len(made.parts)]
        problem = qpsolvers.Problem(
            sp.diags(weight, format="csc"),
            linear,
            sp.csc_matrix(rows),
            right,
            sp.csc_matrix(shares),
            np.zeros(1),
            low,
            high,
        )
        solution = qpsolvers.solve_problem(problem, solver="piqp", **TOLERANCES["piqp"])
        x = solution.x
        if not solution.found or x is None:
            return None
        now = sum(part.cost() for part in soft)
        after = duration * float(
            linear[made.size :] @ np.concatenate([[x[made.size]], np.maximum(x[made.size + 1 :], 0.0)])
        )
        return Step(control + x[: made.size] * scale, duration * (1.0 + float(x[made.size])), float(now - after))

    def _scale(self, y: Array, span: float) -> Array:
        """Return what each variable is measured in, (Y,)."""
        made = self.transcription
        found = np.ones(made.size)
        found[: len(made.parts)] = y[: len(made.parts)]
        for k, (part, place) in enumerate(zip(made.parts, made.places, strict=True)):
            if isinstance(part, MovePart):
                found[place] = np.tile(part.limits.velocity * span * y[k], part.count // made.joints)
        limits = made.parts[0].limits
        for place in made.passing.values():
            found[place] = np.concatenate([limits.velocity * span, limits.acceleration * span**2])
        return found

    def _hard(self, curve: StretchCurve, scale: Array, radius: float) -> tuple[Array, Array]:
        """Return rows (k, Y + 1) and right sides (k,): limits of the joints, and laws that do not decrease."""
        made = self.transcription
        blocks: list[Array] = []
        rights: list[Array] = []
        for k, part in enumerate(made.parts):
            rates, seconds = curve.rate_rows(k), curve.seconds(k)
            power = seconds**rates.order
            share, gradient = rates.value / power, rates.gradient * scale / power[:, None]
            longer = np.zeros((len(share), made.size + 1))
            longer[:, k] = longer[:, -1] = rates.order
            for sign in (1.0, -1.0):
                reach = np.minimum(radius * np.abs(gradient).sum(axis=1), 2.0)
                wanted = (sign * share > NEAR) | (sign * share + reach > 1.0)
                rows = np.column_stack([sign * gradient[wanted], np.zeros(int(wanted.sum()))]) - longer[wanted]
                blocks.append(rows)
                rights.append(1.0 - sign * share[wanted])
            if isinstance(part, LinePart):
                rising = np.zeros((part.basis.size - 1, made.size + 1))
                rising[:, made.places[k]] = -part.rising()
                blocks.append(rising)
                rights.append(np.maximum(part.steps(curve.y[made.places[k]]), 0.0))
        return np.vstack(blocks), np.concatenate(rights)
