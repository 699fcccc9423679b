"""Solvers of the controller's program: proxsuite's dense one, kept from step to step, and all that qpsolvers finds."""

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
import qpsolvers
from proxsuite import proxqp

from optiplan.arrays import Array
from optiplan.control.qp.program import Program
from optiplan.errors import wrong_argument

PRECISION = 1e-8
"""Absolute residual that is asked of solvers, rad/s or m/s."""
ITERATIONS = 200
"""After which a solver gives up: a step has no time for more."""
DEFAULT = "proxqp"
_CAPACITY = 8
"""Rows are allocated in multiples of this."""


class QpSolver(ABC):
    """Solves a program; what comes out is looked at by its residuals, whatever the solver says of it.

    Attributes:
        name: as records tell it.
    """

    name: str

    @abstractmethod
    def solve(self, program: Program) -> Array | None:
        """x (n,), or None; may hold NaN. Exceptions are taken as None."""


class ProxQp(QpSolver):
    """proxsuite's dense solver, one object for each size of program, updated in place and started from its last answer.

    Not called through qpsolvers, whose `solve_problem` makes and fills a new object in every call: that costs twice
    the solution itself, and its warm start has no multipliers.
    """

    name = "proxqp"

    def __init__(self) -> None:
        self._objects: dict[tuple[int, int, int], _Allocated] = {}

    def solve(self, program: Program) -> Array | None:
        """Minimise; None where the object fails."""
        n, m, p = len(program.g), len(program.C), len(program.A)
        rows = -(-m // _CAPACITY) * _CAPACITY
        key = n, rows, p
        if key not in self._objects:
            self._objects[key] = _Allocated(*key)
        return self._objects[key].solve(program)


class _Allocated:
    """A solver's object with room for so many rows; those that are not used are zero <= infinity."""

    def __init__(self, n: int, rows: int, equations: int) -> None:
        self._n, self._rows, self._equations = n, rows, equations
        self._C, self._low, self._high = np.zeros((rows, n)), np.full(rows, -np.inf), np.full(rows, np.inf)
        self._allocate()

    def _allocate(self) -> None:
        self._qp = proxqp.dense.QP(self._n, self._equations, self._rows, True)
        settings = self._qp.settings
        settings.eps_abs, settings.eps_rel = PRECISION, 0.0
        settings.max_iter = ITERATIONS
        settings.compute_timings = False
        settings.initial_guess = proxqp.WARM_START_WITH_PREVIOUS_RESULT
        self._started = False

    def solve(self, program: Program) -> Array | None:
        m = len(program.C)
        if self._rows:
            self._C[:m], self._low[:m], self._high[:m] = program.C, program.low, program.high
            self._C[m:], self._low[m:], self._high[m:] = 0.0, -np.inf, np.inf
        rows = (self._C, self._low, self._high) if self._rows else (None, None, None)
        equations = (program.A, program.b) if self._equations else (None, None)
        if self._started:
            self._qp.update(program.H, program.g, *equations, *rows, *program.box, update_preconditioner=False)
        else:
            self._qp.init(program.H, program.g, *equations, *rows, *program.box)
            self._started = True
        self._qp.solve()
        x = np.array(self._qp.results.x)
        if not np.isfinite(x.sum()):
            self._allocate()  # what it would start from is spoilt
            return None
        return x


class QpSolvers(QpSolver):
    """Any dense solver that the library qpsolvers finds, by its name."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._last: Array | None = None

    def solve(self, program: Program) -> Array | None:
        """Minimise, from the last answer where the solver can."""
        G, h = _one_sided(program)
        equations = (program.A, program.b) if len(program.A) else (None, None)
        problem = qpsolvers.Problem(program.H, program.g, G, h, *equations, *program.box)
        start = self._last if self._last is not None and len(self._last) == len(program.g) else None
        self._last = qpsolvers.solve_problem(problem, self.name, initvals=start).x
        return self._last


def _one_sided(program: Program) -> tuple[Any, Any]:
    if not len(program.C):
        return None, None
    upper, lower = np.isfinite(program.high), np.isfinite(program.low)
    G = np.vstack([program.C[upper], -program.C[lower]])
    return G, np.concatenate([program.high[upper], -program.low[lower]])


def make_solver(name: object) -> QpSolver:
    """The solver of that name; an object that is one is taken as it is.

    Raises:
        InputError: there is none.
    """
    if isinstance(name, QpSolver):
        return name
    choices = sorted(set(qpsolvers.dense_solvers) | {DEFAULT})
    if name not in choices:
        raise wrong_argument("Controller", "solver", f"{name!r}", f"one of: {', '.join(choices)}")
    return ProxQp() if name == DEFAULT else QpSolvers(str(name))
