"""Planner `casadi` beside `trajopt`, solver by solver, on MotionBenchMaker's Panda problems or the shipped examples.

    python benchmarks/casadi_planner.py --every 5 --markdown casadi.md      # 70 problems: ten of each set
    python benchmarks/casadi_planner.py --examples --solvers ipopt fatrop --markdown examples.md

Each problem is planned by `trajopt` and by `casadi` with each of the solvers, in turn, and every motion is proved.
Budgets and times count the processor, not the clock, so that what else the machine does changes nothing. *ratio* is
the duration over its lower bound; *T / trajopt* compares the durations of motions that are both verified. *shorter* and
*longer* count those that differ by more than 0.5 %. Ctrl-C ends early and still prints what was done, and what was
asked for. The last line printed is one JSON object.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from published import ROOT, commit, import_sets, percentiles, print_json, print_table, table_parser, write_markdown
from rich.console import Console
from rich.progress import track

from optiplan import libraries
from optiplan.errors import InputError
from optiplan.planners.base import Budget
from optiplan.planners.trajopt.nonlinear.solvers import SOLVERS, installed
from optiplan.problem.load import load_problem
from optiplan.runs.pipeline import run

OURS, SAME = "trajopt", 0.005
SOLVER_HEADINGS = ("planner", "verified", "plan s 50 / 95", "ratio 50 / 90", "T / trajopt 50 / 90", "shorter", "longer")


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = table_parser(__doc__)
    parser.add_argument("--examples", action="store_true", help="the shipped problems instead of MotionBenchMaker's")
    parser.add_argument("--problems", nargs="+", help="only these of the examples, such as 02_shelf")
    parser.add_argument("--every", type=int, default=5, help="only every so many problems of each set")
    parser.add_argument("--offset", type=int, default=0, help="index of the first of them")
    parser.add_argument("--solvers", nargs="+", choices=list(SOLVERS), default=["ipopt", "sqpmethod+piqp"])
    parser.add_argument("--budget", type=float, default=5.0, help="processor seconds for each problem and planner")
    return parser.parse_args()


def main() -> None:
    """Plan, compare, print."""
    arguments = parse()
    libraries.time = SimpleNamespace(perf_counter=time.process_time)  # type: ignore[assignment]  # what budgets count
    names = [OURS, *(name for name in arguments.solvers if name in installed())]
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        files = problem_files(arguments, Path(folder))
        for name in names:
            solve(ROOT / "problems" / "01_reach.yaml", name, 1.0)  # pays for imports
        try:
            for file in track(files, "planning", console=Console(stderr=True), transient=True):
                rows += [solve(file, name, arguments.budget) for name in names]
        except KeyboardInterrupt:
            pass
    done = len({row["problem"] for row in rows if row["planner"] == names[-1]})
    headings, table = by_example(rows, names) if arguments.examples else (SOLVER_HEADINGS, by_solver(rows, names))
    remarks = [f"{done} problems, {arguments.budget:g} s of the processor each."]
    if done < len(files):
        remarks.append(f"Interrupted: {len(files)} problems were asked for.")
    print_table(headings, table)
    write_markdown(arguments.markdown, headings, table, remarks)
    told = {"budget": arguments.budget, "commit": commit(), "complete": done == len(files)}
    print_json({**told, "runs": rows})


def problem_files(arguments: argparse.Namespace, folder: Path) -> list[Path]:
    """The requested problems, of all sets in turn."""
    if arguments.examples:
        shipped = sorted((ROOT / "problems").glob("*.yaml"))
        return [file for file in shipped if file.stem in (arguments.problems or (file.stem,))]
    sets = import_sets("panda", folder, arguments.every, arguments.offset)
    most = max(map(len, sets.values()))
    return [files[k] for k in range(most) for files in sets.values() if k < len(files)]


def solve(file: Path, name: str, budget: float) -> dict[str, Any]:
    """One run: verdict, duration in s, processor time of planning in s; None where the problem is refused."""
    planner, options = (OURS, {}) if name == OURS else ("casadi", {"solver": name})
    row: dict[str, Any] = {"problem": f"{file.parent.name}/{file.stem}", "planner": name}
    try:
        problem = load_problem(file)
        found = run(problem, planner, options, Budget(budget), lambda stage, share: None)
    except InputError:
        return {**row, "verified": False, "refused": True}
    ratio = found.ratio if found.verified else None
    duration = found.duration if found.verified else None
    return {**row, "verified": found.verified, "duration": duration, "ratio": ratio, "plan_s": found.timings["plan"]}


def compared(rows: list[dict[str, Any]], name: str) -> list[float]:
    """Durations over those of `trajopt`, where both are verified."""
    ours = {row["problem"]: row["duration"] for row in rows if row["planner"] == OURS and row["verified"]}
    own = [row for row in rows if row["planner"] == name and row["verified"] and row["problem"] in ours]
    return [row["duration"] / ours[row["problem"]] for row in own]


def by_solver(rows: list[dict[str, Any]], names: list[str]) -> list[list[str]]:
    """One line a planner."""
    table = []
    for name in names:
        own = [row for row in rows if row["planner"] == name and not row.get("refused")]
        shares, seconds = compared(rows, name), [row["plan_s"] for row in own]
        table.append(
            [
                label(name),
                f"{sum(row['verified'] for row in own)} of {len(own)}",
                "{:.2f} / {:.2f}".format(*percentiles(seconds, 50, 95)),
                "{:.3f} / {:.3f}".format(*percentiles([row["ratio"] for row in own], 50, 90)),
                "{:.4f} / {:.4f}".format(*percentiles(shares, 50, 90)),
                str(sum(share < 1.0 - SAME for share in shares)),
                str(sum(share > 1.0 + SAME for share in shares)),
            ]
        )
    return table


def by_example(rows: list[dict[str, Any]], names: list[str]) -> tuple[list[str], list[list[str]]]:
    """One line a problem: duration and time of `trajopt`, then of each solver T / trajopt and time."""
    headings = ["problem", "trajopt T, s", "plan s"]
    for name in names[1:]:
        headings += [f"{name}: T / trajopt", "plan s"]
    found = {(row["problem"], row["planner"]): row for row in rows}
    table = []
    for problem in dict.fromkeys(row["problem"] for row in rows):
        line = [problem.rpartition("/")[2]]
        ours = found[problem, OURS]
        for name in names:
            row = found.get((problem, name), {"verified": False, "refused": True})
            if not row["verified"]:
                line += ["refused" if row.get("refused") else "not verified", f"{row.get('plan_s', 0.0):.2f}"]
            elif name == OURS or not ours["verified"]:
                line += [f"{row['duration']:.4f}" + ("" if name == OURS else " s"), f"{row['plan_s']:.2f}"]
            else:
                line += [f"{row['duration'] / ours['duration']:.4f}", f"{row['plan_s']:.2f}"]
        table.append(line)
    return headings, table


def label(name: str) -> str:
    """What a planner is called in the table."""
    return f"`{name}`" if name == OURS else f"`casadi`, {name}"


if __name__ == "__main__":
    main()
