"""An exact answer from a guess of which limits are active: a few linear equations instead of a solver's iterations."""

from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dposv, dpotrs

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.control.qp.program import FEASIBLE, Program

CHANGES = 6
"""Guesses that are tried: from one step to the next few limits become active, and few cease to be."""
_SIGN = 1e-9
"""Multipliers above minus this, relative to the largest, count as not negative."""
_TOUCHES = 1e-9
"""rad/s or m/s: rows nearer than this to their bound are as good as active."""


class ActiveSet(NamedTuple):
    """Active bounds, as ±(joint + 1), and active rows, as ±(row + 1): plus for the upper end, minus for the lower."""

    bounds: tuple[int, ...] = ()
    rows: tuple[int, ...] = ()


def solve_in_python(program: Program, guess: ActiveSet) -> tuple[Array, ActiveSet] | None:
    """The program's solution, found from a guess of its active set; None where a few changes do not lead there.

    With the constraints N x = b of the guess, x = x_0 - H⁻¹ Nᵀ y with (N H⁻¹ Nᵀ) y = N x_0 - b and x_0 the least
    without constraints. It is the solution if no multiplier y is negative and no other constraint is violated. Else
    the most negative one leaves, or the most violated one enters.
    """
    factor, free, info = dposv(program.H, -program.g)
    if info != 0:
        return None
    bounds, rows = list(guess.bounds), [row for row in guess.rows if abs(row) <= len(program.C)]
    for _ in range(CHANGES):
        x, multipliers = _equality_solution(program, factor, free, bounds, rows)
        if x is None:
            return None
        if len(multipliers):
            worst = int(multipliers.argmin())
            if multipliers[worst] < -_SIGN * (1.0 + float(np.abs(multipliers).max())):
                (bounds if worst < len(bounds) else rows).pop(worst if worst < len(bounds) else worst - len(bounds))
                continue
        entering = _most_violated(program, x)
        if entering is None:
            return program.clipped(x), ActiveSet(tuple(bounds), tuple(rows))
        kind, signed = entering
        where = bounds if kind == "bound" else rows
        if signed in where:
            return None
        where.append(signed)
    return None


def _equality_solution(
    program: Program, factor: Array, free: Array, bounds: list[int], rows: list[int]
) -> tuple[Array | None, Array]:
    """X (n,) on the chosen constraints, and their multipliers; None where these depend on each other."""
    n, equations = len(free), len(program.A)
    k = len(bounds) + len(rows) + equations
    if k == 0:
        return free, np.zeros(0)
    if k > n:
        return None, np.zeros(0)
    N, b = np.zeros((k, n)), np.empty(k)
    for i, signed in enumerate(bounds):
        j = abs(signed) - 1
        N[i, j], b[i] = (1.0, program.box[1][j]) if signed > 0 else (-1.0, -program.box[0][j])
    for i, signed in enumerate(rows, len(bounds)):
        j = abs(signed) - 1
        if signed > 0:
            N[i], b[i] = program.C[j], program.high[j]
        else:
            np.negative(program.C[j], out=N[i])
            b[i] = -program.low[j]
    if equations:
        N[-equations:], b[-equations:] = program.A, program.b
    Y, _ = dpotrs(factor, N.T)
    _, y, info = dposv(N @ Y, N @ free - b)
    if info != 0 or not np.isfinite(y.sum()):
        return None, np.zeros(0)
    x = free - Y @ y
    if np.abs(N @ x - b).max() > 0.01 * FEASIBLE:  # constraints that nearly depend on each other
        return None, np.zeros(0)
    return x, y[: k - equations]


def _most_violated(program: Program, x: Array) -> tuple[str, int] | None:
    """The constraint that x leaves farthest behind, as kind and signed number; None if there is none."""
    over, under = x - program.box[1], program.box[0] - x
    j, k = int(over.argmax()), int(under.argmax())
    worst, found = _TOUCHES, None
    if over[j] > worst:
        worst, found = float(over[j]), ("bound", j + 1)
    if under[k] > worst:
        worst, found = float(under[k]), ("bound", -(k + 1))
    if len(program.C):
        y = program.C @ x
        over, under = y - program.high, program.low - y
        j, k = int(over.argmax()), int(under.argmax())
        if over[j] > worst:
            worst, found = float(over[j]), ("row", j + 1)
        if under[k] > worst:
            found = ("row", -(k + 1))
    return found


def active_at(program: Program, x: Array, within: float) -> ActiveSet:
    """The constraints that x touches."""
    bounds = [j + 1 for j in np.flatnonzero(program.box[1] - x <= within).tolist()]
    bounds += [-(j + 1) for j in np.flatnonzero(x - program.box[0] <= within).tolist() if j + 1 not in bounds]
    rows = []
    if len(program.C):
        y = program.C @ x
        rows = [j + 1 for j in np.flatnonzero(program.high - y <= within).tolist()]
        rows += [-(j + 1) for j in np.flatnonzero(y - program.low <= within).tolist() if j + 1 not in rows]
    return ActiveSet(tuple(bounds), tuple(rows))


def _solve_natively(program: Program, guess: ActiveSet) -> tuple[Array, ActiveSet] | None:
    p = program
    found = core.solve_from(p.H, p.g, p.C, p.low, p.high, *p.box, p.A, p.b, guess.bounds, guess.rows, _RULES)
    return None if found is None else (found[0], ActiveSet(tuple(found[1]), tuple(found[2])))


_RULES = np.array([CHANGES, _SIGN, _TOUCHES, 0.01 * FEASIBLE])
solve_from = solve_in_python if core is None else _solve_natively
"""`solve_in_python`, in the native core where that is there: the same method, other rounding."""
