"""Options of the planner `casadi`."""

from dataclasses import fields

from optiplan.planners.option_schema import OptionError, option
from optiplan.planners.trajopt.nonlinear.solvers import DEFAULT, SOLVERS, installed
from optiplan.planners.trajopt.options import AUTO, TrajOptOptions
from optiplan.records import dataclass


@dataclass(frozen=True)
class CasadiOptions(TrajOptOptions):
    """Options of `casadi`: those of `trajopt`, whose curves it optimises with solvers of nonlinear programs."""

    iterations: int = option(60, "programs solved in an attempt, at most.", least=1, most=100_000)
    solver: str = option(
        DEFAULT,
        f"of the nonlinear programs, where the installed CasADi has it: {', '.join(SOLVERS)}.",
    )

    compiled: bool = option(
        False,
        "whether torques and other expressions become machine code first: a C compiler takes seconds once, the code is "
        "kept; programs then take a quarter less time, and the motion is the same to rounding.",
    )

    def coarse(self, spans: int, samples: int) -> TrajOptOptions:
        """Return options of `trajopt`: estimates need no solver of nonlinear programs, and have to be cheap."""
        own = {field.name: getattr(self, field.name) for field in fields(TrajOptOptions)}
        return TrajOptOptions(**{**own, "spans": spans, "samples": samples, "solver": AUTO})

    def _check_solver(self) -> None:
        if self.solver not in SOLVERS or not SOLVERS[self.solver].installed:
            raise OptionError("solver", f"'{self.solver}'", f"one of {', '.join(installed())}")
        if self.workers != 1:
            raise OptionError("workers", str(self.workers), "1: solvers of CasADi run one at a time")
