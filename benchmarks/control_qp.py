"""The programs of every loop, by the native active set and by ProxQP and PIQP: time, what fails, iterations.

    python benchmarks/control_qp.py --steps 1500 --markdown control_qp.md

Loops: the shipped control files with the task-space controller, in both forms; Panda on a figure 8 with all limits and
ten rows of clearance; its six families of motions (`control_rate.py`). The programs are recorded while `solver: native`
runs the loop, and then every solver gets all of them, in their order:

    native          the active set, beginning at the one before, as the loop does
    ProxQP          proxsuite's dense solver, object kept, each program afresh: `solver: proxqp`
    ProxQP, warm    the same from the last answer and its multipliers
    ProxQP, PIQP by qpsolvers: a new object each time

Times are the processor's, us, median and 99 %, without the polish. *gave up*: ProxQP called a program infeasible or
stopped early, and solved it when it was begun anew. *failed*: no answer within 1e-5 of all bounds and rows, or one
whose value is more than 1e-6 of its size worse than the best answer of all. The last line is JSON.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import time
from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any

import control_rate
import numpy as np
from proxsuite import proxqp
from published import ROOT, print_json, print_table, table_parser, write_markdown
from ruamel.yaml import YAML

import optiplan as op
from optiplan.arrays import Array
from optiplan.control.qp import qp_sequence, solvers
from optiplan.control.qp.active_set import ActiveSet, solve_from
from optiplan.control.qp.program import Program
from optiplan.errors import InputError

NEAR, WORSE = 1e-5, 1e-6
SIZES = ("loop", "form", "joints", "rows 50 / most", "programs")
HEADINGS = (*SIZES, "solver", "us 50 / 99 %", "iterations 50 / most", "gave up", "failed")
Solve = Callable[[Program], tuple[Array | None, int, bool]]
"""From a program to its answer, the iterations of the solver, 0 where it tells none, and whether it gave up first."""


class Enough(Exception):
    """As many programs as requested are recorded."""


class Recorder:
    """Keeps the programs of a loop."""

    def __init__(self, most: int) -> None:
        self.programs: list[Program] = []
        self._most, self._find = most, qp_sequence.QpSequence.find

    def __enter__(self) -> "Recorder":
        def find(sequence: Any, program: Program, witness: Array, level: int = 0) -> Array | None:
            if len(self.programs) == self._most:
                raise Enough
            box = program.box[0].copy(), program.box[1].copy()
            arrays = (getattr(program, name).copy() for name in ("H", "g", "C", "low", "high"))
            self.programs.append(Program(*arrays, box, program.A.copy(), program.b.copy()))
            return self._find(sequence, program, witness, level)

        qp_sequence.QpSequence.find = find  # type: ignore[method-assign]
        return self

    def __exit__(self, *_: object) -> None:
        qp_sequence.QpSequence.find = self._find  # type: ignore[method-assign]


def loops(most: int) -> Iterator[tuple[str, str, list[Program]]]:
    """Name, form and programs of each loop."""
    for file in sorted((ROOT / "control").glob("*.yaml")):
        stated = YAML(typ="safe").load(file)
        if "task_space" not in stated["controller"]:
            continue
        for form in ("velocity", "acceleration"):
            options = {**(stated["controller"]["task_space"] or {}), "form": form}
            changed = {**stated, "controller": {"task_space": options}}
            yield file.stem, form, recorded(most, lambda changed=changed: op.simulate(changed))  # type: ignore[misc]
    robot = op.load_robot("panda")
    joints = [op.PositionLimit(), op.VelocityLimit(), op.AccelerationLimit(), op.JerkLimit()]
    more = [op.TorqueLimit(), op.ToolSpeedLimit(linear=1.7, angular=2.5)]
    for form in ("velocity", "acceleration"):
        rows = [*joints, *more, op.ClearanceLimit(control_rate.ten_rows(robot))]
        eight = control_rate.figure_eight(robot, 8.0)
        follow = control_rate.ours(robot, rows, form=form)
        yield "figure 8, all limits", form, recorded(most, lambda f=follow, e=eight: control_rate.run(f, robot, e))
    for family, targets in control_rate.FAMILIES.items():
        follow = control_rate.ours(robot, None, scene=op.Scene())
        yield family, "velocity", recorded(most, lambda f=follow, t=targets: control_rate.run(f, robot, t(robot)))


def recorded(most: int, run: Callable[[], Any]) -> list[Program]:
    """The first programs of a loop."""
    with Recorder(most) as recorder:
        try:
            run()
        except (Enough, InputError):
            pass
    return recorder.programs


def native() -> Solve:
    """The active set."""
    last = ActiveSet()

    def solve(program: Program) -> tuple[Array | None, int, bool]:
        nonlocal last
        found = solve_from(program, last)
        if found is None:
            return None, 0, False
        last = found[1]
        return found[0], 0, False

    return solve


class Watched:
    """An object of ProxQP that counts how often it is begun anew, since it reported no solution."""

    def __init__(self, qp: Any) -> None:
        self.qp, self.begun = qp, 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self.qp, name)

    def init(self, *matrices: Any) -> None:
        """Count, and pass on."""
        self.begun += 1
        self.qp.init(*matrices)


def kept_proxqp(warm: bool) -> Solve:
    """ProxQP, its object kept."""
    solver = solvers.ProxQp()

    def solve(program: Program) -> tuple[Array | None, int, bool]:
        key = len(program.g), -(-len(program.C) // solvers._CAPACITY) * solvers._CAPACITY, len(program.A)
        one = solver._objects.get(key)
        if one is None:
            one = solver._objects[key] = solvers._Allocated(*key)
            one._qp = Watched(one._qp)
            one._qp.begun = -1  # the first time is none of those
        if warm and one._started:
            one._qp.settings.initial_guess = proxqp.WARM_START_WITH_PREVIOUS_RESULT
        before = max(one._qp.begun, 0)
        x = solver.solve(program)
        return x, int(one._qp.results.info.iter), max(one._qp.begun, 0) > before

    return solve


def by_qpsolvers(name: str) -> Solve:
    """A solver of qpsolvers."""
    solver = solvers.QpSolvers(name)

    def solve(program: Program) -> tuple[Array | None, int, bool]:
        solver._last = None
        return solver.solve(program), 0, False

    return solve


SOLVERS: dict[str, Callable[[], Solve]] = {
    "native": native,
    "ProxQP": lambda: kept_proxqp(False),
    "ProxQP, warm": lambda: kept_proxqp(True),
    "ProxQP by qpsolvers": lambda: by_qpsolvers("proxqp"),
    "PIQP by qpsolvers": lambda: by_qpsolvers("piqp"),
}


def measured(programs: list[Program]) -> dict[str, dict[str, Any]]:
    """Seconds, iterations and what failed of every solver."""
    answers: dict[str, list[Array | None]] = {}
    told: dict[str, dict[str, Any]] = {}
    for name, make in SOLVERS.items():
        solve, seconds, iterations, again = make(), [], [], 0
        answers[name] = []
        for program in programs:
            begin = time.thread_time()
            try:
                x, count, gave_up = solve(program)
            except Exception:  # what solvers raise counts as failed
                x, count, gave_up = None, 0, True
            seconds.append(time.thread_time() - begin)
            iterations.append(count)
            again += gave_up
            good = x is not None and np.isfinite(x).all() and program.infeasibility(x) < NEAR
            answers[name].append(x if good else None)
        told[name] = {"seconds": seconds, "iterations": iterations, "failed": 0, "gave up": again}
    for k, program in enumerate(programs):
        values = {name: program.value(x) for name in SOLVERS if (x := answers[name][k]) is not None}
        best = min(values.values(), default=0.0)
        for name in SOLVERS:
            told[name]["failed"] += name not in values or values[name] > best + WORSE * max(1.0, abs(best))
    return told


def cells(loop: str, form: str, programs: list[Program], told: dict[str, dict[str, Any]]) -> list[list[str]]:
    """One line a solver, in the order of HEADINGS."""
    rows = [len(program.C) for program in programs]
    size = str(max(len(program.g) for program in programs))
    first = [loop, form, size, f"{np.median(rows):.0f} / {max(rows)}", str(len(programs))]
    table = []
    for name, one in told.items():
        median, late = np.quantile(one["seconds"], (0.5, 0.99))
        counts = one["iterations"]
        shown = f"{np.median(counts):.0f} / {max(counts)}" if any(counts) else "–"
        counted = [str(one["gave up"]), str(one["failed"])]
        table.append([*first, name, f"{1e6 * median:.0f} / {1e6 * late:.0f}", shown, *counted])
        first = [""] * len(first)
    return table


def main() -> None:
    """Record, solve, print."""
    parser = table_parser(__doc__)
    parser.add_argument("--steps", type=int, default=1500, help="programs of each loop, at most")
    parser.add_argument("--loops", type=int, help="only the first so many loops")
    options = parser.parse_args()
    table: list[list[str]] = []
    totals: dict[str, dict[str, Any]] = {
        name: {"seconds": [], "iterations": [], "failed": 0, "gave up": 0} for name in SOLVERS
    }
    every: list[Program] = []
    for loop, form, programs in islice(loops(options.steps), options.loops):
        if not programs:
            continue
        told = measured(programs)
        table += cells(loop, form, programs, told)
        every += programs
        for name, one in told.items():
            totals[name] = {key: totals[name][key] + one[key] for key in one}
    table += cells("**all**", "", every, totals)
    print_table(HEADINGS, table)
    write_markdown(options.markdown, HEADINGS, table)
    print_json(
        {
            name: {"failed": one["failed"], "median_us": 1e6 * float(np.median(one["seconds"]))}
            for name, one in totals.items()
        }
    )


if __name__ == "__main__":
    main()
