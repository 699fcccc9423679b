"""Solvers of CasADi for the program of a curve: their names, their options, which of them are installed."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import field
from typing import Any

from optiplan.kinematics.symbolic.compiled import load_casadi
from optiplan.records import dataclass

DEFAULT = "ipopt"

TOLERANCE = 1e-3
"""Of the optimality of an answer, and of its rows: shares of a limit or of a unit of a term."""

_ITERATIONS = 25
"""Most iterations of a solver in one program; its last point is then the answer."""

_QUIET: dict[str, Any] = {"print_time": False, "error_on_fail": False}

_IPOPT: dict[str, Any] = {
    "print_level": 0,
    "sb": "yes",
    "tol": TOLERANCE,
    "max_iter": _ITERATIONS,
    "hessian_approximation": "limited-memory",
    # A program begins at an answer that is nearly one: the first point is hardly moved inwards.
    "mu_init": 1e-2,
    "bound_push": 1e-4,
    "bound_frac": 1e-4,
    "slack_bound_push": 1e-4,
    "slack_bound_frac": 1e-4,
    # Deep in obstacles, prices are large and no multiplier settles: it ends once the merit does.
    "acceptable_tol": 1e3,
    "acceptable_dual_inf_tol": 1e6,
    "acceptable_compl_inf_tol": 1.0,
    "acceptable_constr_viol_tol": TOLERANCE,
    "acceptable_obj_change_tol": 1e-4,
    "acceptable_iter": 3,
}
_FATROP: dict[str, Any] = {
    "structure_detection": "none",
    "fatrop": {"print_level": 0, "tol": TOLERANCE, "max_iter": _ITERATIONS},
}
_BLOCKSQP: dict[str, Any] = {
    "schur": False,  # qpOASES with it needs MA27 or MA57, which are no free software
    "print_iteration": False,
    "print_header": False,
    "max_iter": _ITERATIONS,
    "opttol": 10.0 * TOLERANCE,
    "nlinfeastol": TOLERANCE,
}


def _sqpmethod(qp: str, told: dict[str, Any]) -> "NlpSolver":
    """Return CasADi's own SQP, whose programs have the Gauss-Newton Hessian."""
    options = {
        "qpsol": qp,
        "print_header": False,
        "print_iteration": False,
        "print_status": False,
        "max_iter": _ITERATIONS,
        "tol_pr": TOLERANCE,
        "tol_du": 10.0 * TOLERANCE,
        "qpsol_options": {"error_on_fail": False, **told},
    }
    return NlpSolver("sqpmethod", qp, options, watched=True, gauss_newton=True)


@dataclass(frozen=True)
class NlpSolver:
    """A solver of nonlinear programs.

    Attributes:
        plugin: of `casadi.nlpsol`.
        qp: of `casadi.conic`, for its quadratic programs; None where it has none.
        options: of the plugin.
        watched: whether it calls back at every iteration, so that it can be stopped there.
        talks: whether it prints what no option keeps it from.
        gauss_newton: whether it is given the Hessian of Gauss and Newton; else it approximates one of its own.
    """

    plugin: str
    qp: str | None
    options: dict[str, Any] = field(default_factory=dict)
    watched: bool = False
    gauss_newton: bool = False
    talks: bool = False

    @property
    def installed(self) -> bool:
        """Return whether this CasADi has its plugins."""
        casadi = load_casadi()
        return bool(casadi.has_nlpsol(self.plugin)) and (self.qp is None or bool(casadi.has_conic(self.qp)))

    def make(self, program: dict[str, Any], gauss_newton: Callable[[], Any], **more: Any) -> Any:
        """Return the `casadi.nlpsol` of a program.

        Args:
            program: `{"x": …, "p": …, "f": …, "g": …}`.
            gauss_newton: returns its Hessian.
            more: further options.
        """
        if self.gauss_newton:
            more["hess_lag"] = gauss_newton()
        return load_casadi().nlpsol("solver", self.plugin, program, {**_QUIET, **self.options, **more})


SOLVERS = {
    "ipopt": NlpSolver("ipopt", None, {"ipopt": _IPOPT}, watched=True),
    "fatrop": NlpSolver("fatrop", None, _FATROP),
    "blocksqp": NlpSolver("blocksqp", None, _BLOCKSQP, talks=True),
    "sqpmethod+piqp": _sqpmethod("piqp", {}),
    "sqpmethod+proxqp": _sqpmethod(
        "proxqp", {"proxqp": {"verbose": False, "backend": "dense", "eps_abs": TOLERANCE, "max_iter": 100}}
    ),
    "sqpmethod+osqp": _sqpmethod("osqp", {"osqp": {"verbose": False}}),
}
"""By name, which problem files and commands use."""


def installed() -> list[str]:
    """Return the names of the solvers that this CasADi has."""
    return [name for name, solver in SOLVERS.items() if solver.installed]


@contextmanager
def silenced() -> Iterator[None]:
    """Have nothing printed to the standard output of this process, by libraries either."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)
