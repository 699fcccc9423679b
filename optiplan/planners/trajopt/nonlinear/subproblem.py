"""A step of a descent as one nonlinear program, solved by a solver of CasADi."""

from collections.abc import Callable, Sequence
from contextlib import nullcontext

import casadi as ca
import numpy as np

from optiplan.arrays import Array
from optiplan.planners.trajopt.nonlinear.curve_program import CurveProgram
from optiplan.planners.trajopt.nonlinear.options import CasadiOptions
from optiplan.planners.trajopt.nonlinear.solvers import SOLVERS, NlpSolver, silenced
from optiplan.planners.trajopt.program.qp import Penalty, Step, within_reach
from optiplan.planners.trajopt.program.sqp import Descended, DescentOptions, Sqp
from optiplan.planners.trajopt.program.transcription import Transcription

SLOW = 4
"""Steps after which a curve has to be good: each of them is an optimum of its own."""


class NlpSubproblem:
    """The step of `qp.Subproblem`, with all expressions as they are: only distances are linearised.

    The program is built once for the samples, and again only where more pairs are near than it has rows for.

    Attributes:
        stop: queried at every iteration of a solver.
    """

    def __init__(self, transcription: Transcription, options: CasadiOptions) -> None:
        self.transcription, self.solver = transcription, SOLVERS[options.solver]
        self._machine_code = options.compiled
        self.stop: Callable[[], bool] = lambda: False
        self._kept: _Kept | None = None

    def solve(
        self, control: Array, duration: float, soft: Sequence[Penalty], radius: float, span: float
    ) -> Step | None:
        """Return one step from (control, duration); None when the solver fails; see `qp.Subproblem.solve`."""
        made, reach = self.transcription, self.transcription.limits.velocity * span * radius
        curve = made.curve(control, duration)
        travel = np.tile(reach, made.basis.variables)
        rows = [within_reach(part.rows, travel, duration) for part in soft]
        if self._kept is None or self._kept.nlp.instants is not made.samples or not self._kept.nlp.fits(rows):
            self._kept = _Kept(
                CurveProgram(made, rows, machine_code=self._machine_code), self.solver, lambda: self.stop()
            )
        nlp = self._kept.nlp
        first, parameters = nlp.point(curve, [part.rows for part in soft]), nlp.values(curve, rows, span)
        x, merit = self._kept.solved(first, parameters, nlp.bounds(curve, reach))
        if self.stop() or not (np.isfinite(x).all() and np.isfinite(merit)):
            return None
        now = made.cost(curve) + sum(part.cost() for part in soft)
        return Step(*nlp.moved(x, control), now - merit)


class NlpDescent(Sqp):
    """Descends by nonlinear programs, which a budget ends too."""

    def __init__(self, subproblem: NlpSubproblem) -> None:
        super().__init__(subproblem)
        self._nlp = subproblem

    def optimise(self, control: Array, options: DescentOptions) -> Descended:
        """Descend from control points (K, n); see `sqp.descend`."""
        self._nlp.stop = options.stop
        return super().optimise(control, options._replace(slow=SLOW))


class _Kept:
    """A program with its solver and the multipliers of its last answer, at which the next one begins."""

    def __init__(self, nlp: CurveProgram, solver: NlpSolver, stop: Callable[[], bool]) -> None:
        self.nlp, self._warm = nlp, dict[str, ca.DM]()
        sizes = nlp.x.numel(), nlp.g.numel(), nlp.p.numel()
        self._quiet = silenced if solver.talks else nullcontext
        self._watch = _Watch(sizes, stop) if solver.watched else None
        more = {} if self._watch is None else {"iteration_callback": self._watch}
        with self._quiet():
            self._solve = solver.make(nlp.program(), nlp.gauss_newton, **more)

    def solved(self, x0: Array, p: Array, bounds: tuple[Array, Array]) -> tuple[Array, float]:
        """Return the answer x (X,) from x0 with these bounds (X,) of x, and its cost with the penalties, s.

        The cost is NaN where a solver fails.
        """
        lbx, ubx = bounds
        nlp = self.nlp
        try:
            with self._quiet():
                found = self._solve(x0=x0, p=p, lbx=lbx, ubx=ubx, lbg=nlp.lbg, ubg=nlp.ubg, **self._warm)
        except RuntimeError as error:  # CasADi's, for whatever a solver or a Ctrl-C raises
            if "KeyboardInterrupt" in str(error):
                raise KeyboardInterrupt from None
            self._warm.clear()
            return x0, np.nan
        self._warm = {"lam_x0": found["lam_x"], "lam_g0": found["lam_g"]}
        return np.array(found["x"]).ravel(), float(found["f"])


class _Watch(ca.Callback):
    """Ends a solver between two of its iterations."""

    def __init__(self, sizes: tuple[int, int, int], stop: Callable[[], bool]) -> None:
        super().__init__()
        self._sizes, self._stop = sizes, stop
        self.construct("watch", {})

    def get_n_in(self) -> int:
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        return 1

    def get_name_in(self, which: int) -> str:
        return str(ca.nlpsol_out(which))

    def get_sparsity_in(self, which: int) -> ca.Sparsity:
        x, g, p = self._sizes
        sizes = {"x": x, "lam_x": x, "g": g, "lam_g": g, "lam_p": p, "f": 1}
        return ca.Sparsity.dense(sizes[str(ca.nlpsol_out(which))], 1)

    def eval(self, arguments: Sequence[ca.DM]) -> list[ca.DM]:
        return [ca.DM(float(self._stop()))]
