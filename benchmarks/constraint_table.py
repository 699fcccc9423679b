"""Tabulate which planner holds which path constraint, by the verifier.

    python benchmarks/constraint_table.py --markdown table.md      # about two minutes
    python benchmarks/publish.py path-constraints table.md --readme docs/reference/constraint-table.md

Each kind of constraint has the motion of the tests (`tests/planners/constraint_cases.py`). `trajopt` holds it by
optimising, `line`, `sclerp` and the planner made for the constraint by their path, the others not at all. A cell is
verified, *refused* where the verifier finds a violation, or the kind of the failure. The check is exact, continuous or
sampled.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import sys
from pathlib import Path

from published import print_table, table_parser, write_markdown
from rich.console import Console
from rich.progress import track

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the cases are the tests'

import optiplan as op
from tests.planners.constraint_cases import CONSTRAINTS, stated

PLANNERS = ("trajopt", "line", "sclerp", "rrtconnect", "quintic")
THROUGH = {"through": CONSTRAINTS["arc"]["through"]}
OWN = {"arc": ("arc", THROUGH), "circle": ("arc", THROUGH), "screw": ("screw", {}), "screw, pitch": ("screw", {})}
"""The planner whose path is made for the constraint, with its options."""

HEADINGS = ("constraint", "check", *(f"`{name}`" for name in PLANNERS), "its own path")


def outcome(run: op.Run) -> str:
    """Return the run in one word."""
    if run.failure is not None:
        return str(run.failure.kind)
    return "verified" if run.verified else "refused"


def row(name: str, budget: float) -> list[str]:
    """Plan one constraint with all planners."""
    problem, kinds, cells = stated(name), set(), []
    own = [OWN[name]] if name in OWN else []
    for planner, options in [*((planner, None) for planner in PLANNERS), *own]:
        run = op.plan(problem, planner, options, budget=budget)
        checks = [] if run.report is None else [c for c in run.report.checks if c.name.endswith("constraint")]
        kinds |= {check.kind for check in checks}
        cells.append(outcome(run))
    if own:
        cells[-1] += f" (`{own[0][0]}`)"
    return [f"`{name}`", ", ".join(sorted(kinds)), *cells, *([] if own else [""])]


def main() -> None:
    """Plan all of them and print the table."""
    parser = table_parser(__doc__)
    parser.add_argument("--budget", type=float, default=6.0, help="s, of each planner on each problem")
    arguments = parser.parse_args()
    rows = [row(name, arguments.budget) for name in track(CONSTRAINTS, "constraints", console=Console(stderr=True))]
    print_table(HEADINGS, rows)
    write_markdown(arguments.markdown, HEADINGS, rows)


if __name__ == "__main__":
    main()
