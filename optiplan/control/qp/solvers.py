"""Solvers of the controller's program: proxsuite's dense one, kept from step to step, and all that qpsolvers finds."""

from abc import ABC, abstractmethod

import numpy as np
import qpsolvers
from proxsuite import proxqp

from optiplan.arrays import Array
from optiplan.control.qp.program import Program
from optiplan.errors import described, wrong_argument

PRECISION = 1e-8
"""Absolute residual that is asked of solvers, rad/s or m/s."""
ITERATIONS = 200
"""After which a solver gives up: a step has no time for more."""
NATIVE, PROXQP = "native", "proxqp"
"""The active set that begins at the limits of the last step, with ProxQP where that fails; ProxQP in every step."""
DEFAULT = NATIVE
"""It answers the programs of the shipped loops, in a seventh of ProxQP's time (`benchmarks/control_qp.py`)."""
_CAPACITY = 8
"""Rows are allocated in multiples of this."""
_PRECISIONS = {"proxqp": {"eps_abs": PRECISION, "eps_rel": 0.0}, "osqp": {"eps_abs": PRECISION, "eps_rel": 0.0}}
"""What solvers of qpsolvers are told that would stop far earlier by themselves."""
_LEAST = 1e-9
"""Widths of bounds, and sizes of rows, count as this at least where they are divided by."""


class QpSolver(ABC):
    """Solves a program; what comes out is looked at by its residuals, whatever the solver says of it.

    Attributes:
        name: as records tell it.
    """

    name: str

    @abstractmethod
    def solve(self, program: Program) -> Array | None:
        """X (n,), or None; may hold NaN. Exceptions are taken as None."""


class ProxQp(QpSolver):
    """proxsuite's dense solver, one object for each size of program, allocated once and updated in place.

    Not called through qpsolvers, whose `solve_problem` makes and fills a new object in every call: that costs twice
    the solution itself. Programs are put to it in the scale of their bounds and rows, and each is started afresh: from
    the last answer and its multipliers ProxQP 0.8 takes up to a thousand iterations where active limits have changed,
    and calls one in twenty infeasible that is not. What the last step knows is used by `active_set.solve_from` instead.
    """

    name = "proxqp"

    def __init__(self) -> None:
        self._objects: dict[tuple[int, int, int], _Allocated] = {}

    def solve(self, program: Program) -> Array | None:
        """Minimise; None where the object fails."""
        rows = -(-len(program.C) // _CAPACITY) * _CAPACITY
        key = len(program.g), rows, len(program.A)
        if key not in self._objects:
            self._objects[key] = _Allocated(*key)
        return self._objects[key].solve(program)


class _Allocated:
    """A solver's object with room for so many rows; those that are not used are zero <= infinity."""

    def __init__(self, n: int, rows: int, equations: int) -> None:
        self._C, self._low, self._high = np.zeros((rows, n)), np.full(rows, -np.inf), np.full(rows, np.inf)
        self._rows, self._equations = rows, equations
        self._qp = proxqp.dense.QP(n, equations, rows, True)
        settings = self._qp.settings
        settings.eps_abs, settings.eps_rel = PRECISION, 0.0
        # Without this ProxQP calls answers solved whose multipliers belong to the program before.
        settings.check_duality_gap, settings.eps_duality_gap_abs, settings.eps_duality_gap_rel = True, PRECISION, 0.0
        settings.max_iter = ITERATIONS
        settings.compute_timings = False
        settings.initial_guess = proxqp.NO_INITIAL_GUESS
        self._started = False

    def solve(self, program: Program) -> Array | None:
        """With x = centre + width y, so that bounds are -1 <= y <= 1, and rows of unit size in y."""
        low, high = program.box
        bounded = np.isfinite(high - low)
        centre = np.where(bounded, 0.5 * (low + high), 0.0)
        width = np.where(bounded, np.maximum(0.5 * (high - low), _LEAST), 1.0)
        H = program.H * (width * width[:, None])
        g = width * (program.H @ centre + program.g)
        scale = 1.0 / max(float(np.abs(H).max()), _LEAST)
        matrices = [scale * H, scale * g, None, None, None, None, None, (low - centre) / width, (high - centre) / width]
        if self._equations:
            matrices[2:4] = program.A * width, program.b - program.A @ centre
        if self._rows:
            m = len(program.C)
            C = program.C * width
            unit = 1.0 / np.maximum(np.sqrt(np.einsum("ij,ij->i", C, C)), _LEAST)
            offset = program.C @ centre
            np.multiply(C, unit[:, None], out=self._C[:m])
            np.multiply(program.low - offset, unit, out=self._low[:m])
            np.multiply(program.high - offset, unit, out=self._high[:m])
            self._C[m:], self._low[m:], self._high[m:] = 0.0, -np.inf, np.inf
            matrices[4:7] = self._C, self._low, self._high
        if self._started:
            self._qp.update(*matrices, update_preconditioner=False)
            self._qp.solve()
        # A program of another kind than the first needs a preconditioner of its own.
        if not self._started or self._qp.results.info.status != proxqp.PROXQP_SOLVED:
            self._qp.init(*matrices)
            self._started = True
            self._qp.solve()
        return np.asarray(centre + width * np.array(self._qp.results.x))


class QpSolvers(QpSolver):
    """Any dense solver that the library qpsolvers finds, by its name."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._last: Array | None = None

    def solve(self, program: Program) -> Array | None:
        """Minimise, from the last answer where the solver can."""
        problem = qpsolvers_problem(program)
        start = self._last if self._last is not None and len(self._last) == len(program.g) else None
        precision = _PRECISIONS.get(self.name, {})
        self._last = qpsolvers.solve_problem(problem, self.name, initvals=start, **precision).x
        return self._last


def qpsolvers_problem(program: Program) -> qpsolvers.Problem:
    """Return the program with one-sided rows G x <= h: the finite upper sides of C, then the finite lower ones."""
    G = h = None
    if len(program.C):
        upper, lower = np.isfinite(program.high), np.isfinite(program.low)
        G = np.vstack([program.C[upper], -program.C[lower]])
        h = np.concatenate([program.high[upper], -program.low[lower]])
    equations = (program.A, program.b) if len(program.A) else (None, None)
    return qpsolvers.Problem(program.H, program.g, G, h, *equations, *program.box)


def solver_names() -> list[str]:
    """Return the names of the solvers that are installed, `native` and `proxqp` among them."""
    return sorted({*qpsolvers.dense_solvers, NATIVE, PROXQP})


def make_solver(name: object) -> QpSolver:
    """The solver of that name, of `native` the one that is asked where it fails; an object is taken as it is.

    Raises:
        InputError: there is none.
    """
    if isinstance(name, QpSolver):
        return name
    if not isinstance(name, str) or name not in solver_names():
        raise wrong_argument("Controller", "solver", described(name), f"one of: {', '.join(solver_names())}")
    return ProxQp() if name in (NATIVE, PROXQP) else QpSolvers(str(name))
