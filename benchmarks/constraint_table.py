"""Which planner holds which path constraint, and what the verifier says of it.

    python benchmarks/constraint_table.py --markdown docs/reference/constraint-table.md      # about five minutes

One motion for each kind of constraint, that of the tests (`tests/planners/constraint_cases.py`), with each planner that
can hold constraints: verified or the kind of failure, and whether the check is exact, continuous or sampled.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import sys
from pathlib import Path

from published import print_table

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the cases are the tests'

import optiplan as op
from tests.planners.constraint_cases import CONSTRAINTS, stated

PLANNERS = ("trajopt", "line", "sclerp", "rrtconnect", "quintic")
TITLE = """# Path constraints by planner

Made by `benchmarks/constraint_table.py`: one motion for each constraint, that of the tests.
*verified*: the planner's motion was proved to hold it (*exact*, *continuous*) or looked at (*sampled*); otherwise the
kind of the failure, or *refused* where the motion violates it.
`line` and `sclerp` hold what their path holds by itself.
"""


def outcome(run: op.Run) -> str:
    """Return the run in one word."""
    if run.failure is not None:
        return str(run.failure.kind)
    return "verified" if run.verified else "refused"


def main() -> None:
    """Plan all of them and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--budget", type=float, default=6.0, help="s, of each planner on each problem")
    parser.add_argument("--markdown", type=Path, help="file for the table")
    arguments = parser.parse_args()
    headings, rows = ("constraint", "check", *PLANNERS), []
    for name in CONSTRAINTS:
        problem, kinds, cells = stated(name), set(), []
        for planner in PLANNERS:
            run = op.plan(problem, planner, budget=arguments.budget)
            checks = [] if run.report is None else [c for c in run.report.checks if c.name.endswith("constraint")]
            kinds |= {check.kind for check in checks}
            cells.append(outcome(run))
        rows.append([f"`{name}`", ", ".join(sorted(kinds)), *cells])
        print_table(headings, rows[-1:])
    print_table(headings, rows)
    if arguments.markdown:
        lines = [headings, ["---"] * len(headings), *rows]
        table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
        arguments.markdown.write_text(f"{TITLE}\n{table}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
