"""`QpSequence`: solutions of a step's program that are accepted for their residuals, and the relaxation of rows."""

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array
from optiplan.control.arguments import squares_are_finite
from optiplan.control.qp.active_set import ActiveSet, active_at, solve_from
from optiplan.control.qp.program import FEASIBLE, Program
from optiplan.control.qp.solvers import QpSolver

_RELAXED = 1e-9
"""rad/s or m/s: how much more than its least slack a row is given, so that rounding does not make it impossible."""
_NEAR = 1e-4
"""Weight of staying near the witness while the slack of a group of rows is made least."""
_TOUCHES = 1e-6
"""rad/s or m/s: constraints that a solver's answer is nearer to than this are taken for active."""


class RowGroup(NamedTuple):
    """Rows first … last - 1 of a program, which one limit of that name made."""

    name: str
    first: int
    last: int


class QpSequence:
    """Finds what a step commands.

    An answer is accepted if it keeps bounds and rows, and is optimal for the constraints that it touches; else, as far
    on the way to it from the witness as bounds and rows allow, if that is better than the witness. What a solver says
    of itself is not asked.

    Args:
        solver: asked in every step, or where no guess leads to the solution.
        guess: whether the active limits of the last step are tried first, without the solver.
    """

    def __init__(self, solver: QpSolver, guess: bool) -> None:
        self._solver, self._guess = solver, guess
        self._active: dict[int, ActiveSet] = {}
        self.solve_seconds = 0.0
        self.how = ""

    def reset(self) -> None:
        """Forget what was active."""
        self._active.clear()

    def find(self, program: Program, witness: Array, level: int = 0) -> Array | None:
        """A solution, within the bounds exactly; None where there is none that can be accepted.

        `witness` (n,) keeps all constraints; `level` tells the programs of one step apart.
        """
        begin = time.perf_counter()
        try:
            return self._find(program, witness, level)
        finally:
            self.solve_seconds += time.perf_counter() - begin

    def _find(self, program: Program, witness: Array, level: int) -> Array | None:
        if not squares_are_finite(program.H, program.g):
            return None  # a task has a NaN in it
        if self._guess:
            found = solve_from(program, self._active.get(level, ActiveSet()))
            if found is not None:
                self._active[level] = found[1]
                self.how = "active set" if found[1].bounds or found[1].rows or len(program.A) else "unconstrained"
                return found[0]
        x = self._answer(program)
        if x is None:
            return None
        self.how = self._solver.name
        polished = solve_from(program, active_at(program, x, _TOUCHES))
        if polished is not None:
            self._active[level] = polished[1]
            return polished[0]
        x = program.towards(witness, program.clipped(x))
        if program.infeasibility(x) <= FEASIBLE and program.value(x) <= program.value(witness) + FEASIBLE:
            return x
        return None

    def _answer(self, program: Program) -> Array | None:
        """The solver's answer if it is numbers of the right size."""
        try:
            x = self._solver.solve(program)
        except Exception:  # whatever a solver raises, the robot must be told something
            return None
        if x is None or x.shape != program.g.shape or not np.isfinite(x).all():
            return None
        return x

    def relaxed(
        self, program: Program, groups: Sequence[RowGroup], witness: Array
    ) -> tuple[Program, Array, dict[str, float]]:
        """The program with rows that cannot hold moved until they can, and a witness that keeps all.

        `groups` come in the order of their importance. Each is moved by the least that the more important ones allow,
        and these are never moved for it: lexicographic.

        Returns:
            The program, a witness (n,), and the largest move of each group that was moved, in units of the rows.
        """
        low, high = program.low.copy(), program.high.copy()
        kept: list[int] = []
        slack = {}
        for group in groups:
            rows = list(range(group.first, group.last))
            if _outside(program.C[rows] @ witness, low[rows], high[rows]) > _RELAXED:
                witness = self._least_slack(replace(program, low=low, high=high), kept, rows, witness)
                y = program.C[rows] @ witness
                moved = _outside(y, low[rows], high[rows])
                if moved > _RELAXED:
                    slack[group.name] = moved
                low[rows], high[rows] = np.minimum(low[rows], y - _RELAXED), np.maximum(high[rows], y + _RELAXED)
            kept += rows
        return replace(program, low=low, high=high), witness, slack

    def _least_slack(self, program: Program, kept: list[int], rows: list[int], witness: Array) -> Array:
        """A point near the witness that keeps the bounds and rows `kept`, and violates `rows` least.

        Minimise ½ s² + ½ weight² |x - witness|² over x and s >= 0 with low - s <= C x <= high + s.
        """
        n, C = len(witness), program.C
        H = np.diag([_NEAR**2] * n + [1.0])
        g = np.append(-(_NEAR**2) * witness, 0.0)
        ones = np.ones((len(rows), 1))
        stacked = [
            np.hstack([C[kept], np.zeros((len(kept), 1))]),
            np.hstack([C[rows], ones]),
            np.hstack([C[rows], -ones]),
        ]
        endless = np.full(len(rows), np.inf)
        room = _outside(C[rows] @ witness, program.low[rows], program.high[rows])
        phase = Program(
            H,
            g,
            np.vstack(stacked),
            np.concatenate([program.low[kept], program.low[rows], -endless]),
            np.concatenate([program.high[kept], endless, program.high[rows]]),
            (np.append(program.box[0], 0.0), np.append(program.box[1], room + 1.0)),
            np.zeros((0, n + 1)),
            np.zeros(0),
        )
        start = np.append(witness, room)
        found = solve_from(phase, active_at(phase, start, _TOUCHES)) if self._guess else None
        x = self._answer(phase) if found is None else found[0]
        if x is None:
            return witness
        x = program.clipped(x[:n])
        better = _outside(C[rows] @ x, program.low[rows], program.high[rows]) < room
        holds = _outside(C[kept] @ x, program.low[kept], program.high[kept]) <= FEASIBLE
        return x if better and holds else witness


def _outside(y: Array, low: Array, high: Array) -> float:
    """The largest violation of low <= y <= high, or 0."""
    return max(0.0, float((low - y).max(initial=0.0)), float((y - high).max(initial=0.0)))
