"""The program of one step of a stretch: linearised constraints inside a trust region."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.libraries import loading
from optiplan.planners.task.optimisation.line_part import LinePart
from optiplan.planners.task.optimisation.move_part import MovePart
from optiplan.planners.task.optimisation.transcription import StretchCurve, StretchTranscription
from optiplan.planners.trajopt.program.qp import (
    NEAR,
    REGULARISATION,
    Penalty,
    Step,
    soft_program,
    solution_of,
    within_reach,
)

if TYPE_CHECKING:
    import scipy.sparse as sp


class StretchProgram:
    """The program of one step, as `trajopt.program.qp.Subproblem` is for one curve.

    Variables are changes over a scale, without unit. The scale of free control points is v_j `span` tau_k, of control
    points of laws the path, of shares and of T themselves, of states between moves their limits. The slacks follow. A
    row x of order r of part k, |x| <= (tau_k T)^r, becomes at (y', T')

        |x' + dx dy| <= x_max (1 + r dT / T' + r dtau_k / tau_k'),

    which is inside the true bound because the power is convex.
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
        padding = sp.csr_matrix((len(hard_right), len(prices)))
        rows = sp.vstack([sp.hstack([hard_rows, padding]), sp.csr_matrix(soft_rows)], format="csc")
        right = np.concatenate([hard_right, soft_right])
        reach, slacks = np.full(made.size, radius), len(prices)
        low = np.concatenate([-reach, [-0.5], np.zeros(slacks)])
        high = np.concatenate([reach, [1.0], np.full(slacks, np.inf)])
        weight = np.concatenate([np.full(made.size, REGULARISATION), np.full(len(prices) + 1, 1e-6)])
        linear = np.concatenate([np.zeros(made.size), [1.0], prices / duration])
        shares = np.zeros((1, len(linear)))
        shares[0, : len(made.parts)] = scale[: len(made.parts)]
        equations = sp.csc_matrix(shares), np.zeros(1)
        problem = qpsolvers.Problem(sp.diags(weight, format="csc"), linear, rows, right, *equations, low, high)
        x = solution_of(problem, "piqp")
        if x is None:
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

    def _hard(self, curve: StretchCurve, scale: Array, radius: float) -> "tuple[sp.csr_matrix, Array]":
        """Return rows (k, Y + 1) and right sides (k,): limits of the joints, and laws that do not decrease."""
        import scipy.sparse as sp

        made = self.transcription
        blocks: list[sp.csr_matrix] = []
        rights: list[Array] = []
        for k, part in enumerate(made.parts):
            columns, own = made.columns[k], made.local[k]
            rates, seconds = curve.rate_rows(k), curve.seconds(k)
            power = seconds**rates.order
            share, gradient = rates.value / power, rates.gradient * scale[columns] / power[:, None]
            reach = np.minimum(radius * np.abs(gradient).sum(axis=1), 2.0)
            for sign in (1.0, -1.0):
                wanted = (sign * share > NEAR) | (sign * share + reach > 1.0)
                order = rates.order[wanted]
                rows = np.column_stack([sign * gradient[wanted], -order])
                rows[:, own[k]] -= order
                blocks.append(_placed(rows, np.append(columns, made.size), made.size + 1))
                rights.append(1.0 - sign * share[wanted])
            if isinstance(part, LinePart):
                place = made.places[k]
                blocks.append(_placed(-part.rising(), np.arange(place.start, place.stop), made.size + 1))
                rights.append(np.maximum(np.diff(curve.controls[k][:, 0]), 0.0))
        rows = sp.vstack(blocks, format="csr")
        rows.eliminate_zeros()  # most of a row is: the solver's time grows with what is stored
        return rows, np.concatenate(rights)


def _placed(rows: Array, columns: Index, size: int) -> "sp.csr_matrix":
    """Return rows (R, C) whose columns are these (C,) of as many as `size`."""
    import scipy.sparse as sp

    edges = np.arange(len(rows) + 1) * len(columns)
    return sp.csr_matrix((rows.ravel(), np.tile(columns, len(rows)), edges), shape=(len(rows), size))
