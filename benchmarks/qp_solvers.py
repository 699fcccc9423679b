"""Which solver for the programs of `trajopt`? Those of `SOLVERS` that are installed, on the same programs.

    python benchmarks/qp_solvers.py

The programs are recorded while `trajopt` plans shipped examples. Figures are ratios to PIQP in the same run, medians
over the programs. The last line printed is one JSON object.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import json
import time
from typing import Any

import numpy as np
import qpsolvers
from published import script_parser
from rich.console import Console
from rich.table import Table

from optiplan.planners.base import Budget
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.planners.trajopt.planner import TrajOpt
from optiplan.problem.load import load_problem
from optiplan.resources import problems_dir

SOLVERS = ("piqp", "clarabel", "daqp", "proxqp", "osqp")  # only piqp comes with optiplan; pip installs the others
EXAMPLES = ("01_reach", "02_shelf", "05_cage", "09_ur5")
EVERY = 25
PATIENCE = 10.0  # s


def record() -> list[qpsolvers.Problem]:
    """Programs met while planning the examples, one in `EVERY`."""
    met: list[qpsolvers.Problem] = []
    solve = qpsolvers.solve_problem

    def spy(program: qpsolvers.Problem, **options: Any) -> qpsolvers.Solution:
        met.append(program)
        return solve(program, **options)

    qpsolvers.solve_problem = spy  # `Subproblem.solve` looks it up at each call
    try:
        for name in EXAMPLES:
            problem = load_problem(problems_dir() / f"{name}.yaml")
            TrajOpt(TrajOptOptions(seeds=1, solver="piqp")).plan(problem, Budget(30.0), lambda stage, fraction: None)
    finally:
        qpsolvers.solve_problem = solve
    return met[::EVERY]


def measure(solver: str, programs: list[qpsolvers.Problem]) -> tuple[np.ndarray, float]:
    """Seconds for each program, and the share solved to 1e-4; a slow solver is stopped after `PATIENCE` s."""
    seconds: list[float] = []
    solved = 0
    for program in programs:
        if sum(seconds) > PATIENCE:
            break
        if solver in qpsolvers.dense_solvers and solver not in qpsolvers.sparse_solvers:
            dense = (program.P.toarray(), program.q, program.G.toarray(), program.h)
            program = qpsolvers.Problem(*dense, None, None, program.lb, program.ub)
        began = time.perf_counter()
        try:
            solution = qpsolvers.solve_problem(program, solver=solver)
            good = bool(solution.found) and solution.primal_residual() < 1e-4
        except Exception:  # a solver that raises has not solved it, whatever it raised
            good = False
        seconds.append(time.perf_counter() - began)
        solved += good
    return np.array(seconds), solved / len(seconds)


def main() -> None:
    """Record, measure, print."""
    script_parser(__doc__).parse_args()
    programs = record()
    figures = {name: measure(name, programs) for name in SOLVERS if name in qpsolvers.available_solvers}
    reference = figures["piqp"][0]
    table = Table("solver", "solved", "time / PIQP (median)", "ms (median)")
    result = {}
    for name, (seconds, share) in sorted(figures.items(), key=lambda item: -item[1][1]):
        ratio = float(np.median(seconds / reference[: len(seconds)]))
        table.add_row(name, f"{100 * share:.0f} %", f"{ratio:.2f}", f"{1e3 * np.median(seconds):.1f}")
        result[name] = {"solved": share, "ratio": ratio}
    Console().print(f"{len(programs)} programs of {', '.join(EXAMPLES)}")
    Console().print(table)
    print(json.dumps({"programs": len(programs), "solvers": result}))


if __name__ == "__main__":
    main()
