"""The program of one step, built and solved by the native core."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.planners.trajopt.bspline_basis import FIXED
from optiplan.planners.trajopt.options import AUTO
from optiplan.planners.trajopt.program.qp import Penalty, Step, Subproblem
from optiplan.planners.trajopt.program.transcription import Transcription

if TYPE_CHECKING:
    from optiplan._core._core_base import Spline


GAP = 3e-3
"""Duality gap at which the interior point method ends a step, as a share of the duration.

Among nearly optimal steps, the central one stays away from inactive rows. On twelve Panda problems the motions are
within 0.1 % of the best with 1e-3 or 1e-4, and 0.4 % longer with 1e-6. With 3e-3 they are as short as with 1e-3, in a
tenth less time.
"""


class NativeSubproblem:
    """The same program as `qp.Subproblem`, with all bounds on derivatives from the start.

    The core's interior point method uses the structure: every row depends on a few neighbouring control points, so the
    matrix is a band with the duration as border. The slacks are eliminated (`_core/src/program/arrow_qp.hpp`).
    """

    def __init__(self, transcription: Transcription, gap: float = GAP) -> None:
        self.transcription, self.gap = transcription, gap
        self._solver = core.StepSolver(native_spline(transcription))

    def solve(
        self, control: Array, duration: float, soft: Sequence[Penalty], radius: float, span: float
    ) -> Step | None:
        """Return one step from (control, duration); None when the solver fails; see `qp.Subproblem.solve`."""
        rows = [
            (
                part.rows.sample.astype(np.int64),
                part.rows.value,
                part.rows.by_control,
                part.rows.by_duration,
                part.price,
                part.unit,
            )
            for part in soft
        ]
        found = self._solver.solve(control, duration, rows, radius, span, self.gap, self._costs(control, duration))
        return None if found is None else Step(*found[:3])

    def _costs(self, control: Array, duration: float) -> tuple[Array, float, Array, float] | None:
        """Return the derivatives of the costs outside the core; None without any."""
        made = self.transcription
        if not made.further:
            return None
        model = made.cost_model(made.curve(control, duration), made.further)
        band = np.ascontiguousarray(model.band.reshape(len(model.band), -1))
        return model.gradient, model.by_duration, band, model.twice_by_duration


def native_spline(transcription: Transcription) -> "Spline":
    """Return the core's form of a transcription's spline, limits and objective."""
    basis, limits, objective = transcription.basis, transcription.limits, transcription.objective
    orders = [len(rows) for rows in basis.bounded]
    return core.Spline(
        np.vstack(basis.bounded),
        np.repeat(np.array([1, 2, 3], dtype=np.int64), orders),
        np.array(transcription.rates),
        np.ascontiguousarray(basis.jerk_gram),
        np.array([limits.lower, limits.upper]),
        FIXED,
        objective.time,
        objective.jerk,
        basis.open_end,
    )


def step_solver(transcription: Transcription, solver: str) -> NativeSubproblem | Subproblem:
    """Return the native core for `auto`, where there is one, and a solver of qpsolvers otherwise."""
    if solver == AUTO:
        return Subproblem(transcription, "piqp") if core is None else NativeSubproblem(transcription)
    return Subproblem(transcription, solver)
