"""The clearance that is wished where a problem requires none: how often it is kept, and at what cost.

    python benchmarks/wished.py --every 5 --markdown wished.md      # 70 Panda problems

Problems are read from `$OPTIPLAN_SHARED/mbm/<robot>` and answered as `op.plan` answers them. *Kept by itself* counts
answers that keep the wish unchanged, *kept* those and the ones with another motion in their place; *longer* is over the
answer without it. The outside judge of `clearance.py` looks at every kept one; the exit code is 1 where it finds a pair
below its floor. The last line printed is one JSON object.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

from clearance import judged
from mbm import silent, warm_up
from published import by_set, commit, import_sets, percentiles, print_json, print_table, sets_parser, write_markdown
from rich.console import Console
from rich.progress import track

from optiplan.errors import InputError
from optiplan.planners.base import Budget
from optiplan.problem.load import load_problem
from optiplan.runs.pipeline import answer

HEADINGS = ("set", "n", "verified", "kept by itself", "kept", "longer 50 / 90 / max", "wish s 50 / 95", "below a floor")


def main() -> None:
    """Answer, judge, print."""
    parser = sets_parser(__doc__)
    parser.add_argument("--planner", default="trajopt")
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        sets = import_sets(options.robot, Path(folder), options.every, options.offset)
        files = [file for name in options.sets or sets for file in sets[name]]
        warm_up(files, options)
        for file in track(files, "planning", console=Console(stderr=True), transient=True):
            try:
                rows.append(solved(file, options))
            except InputError:  # a start or a goal that touches something
                continue
    table = lines(rows)
    print_table(HEADINGS, table)
    write_markdown(options.markdown, HEADINGS, table)
    print_json({"robot": options.robot, "budget": options.budget, "commit": commit(), "runs": rows})
    sys.exit(1 if any(row["below"] for row in rows) else 0)


def solved(file: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Return what became of one problem's wish."""
    problem = load_problem(file)
    done = answer(problem, options.planner, {}, Budget(options.budget), silent)
    wish = done.info.get("wish") or {"kept": False, "longer": None}
    kept = done.trajectory is not None and wish["kept"]
    return {
        "set": file.parent.name,
        "problem": file.stem,
        "verified": done.verified,
        **wish,
        "seconds": done.timings.get("wish"),
        "below": judged(problem, done.trajectory, wish["clearance"])["below"] if kept else 0,
    }


def lines(rows: list[dict[str, Any]]) -> list[list[str]]:
    """Return one line a set and one for all, in the order of `HEADINGS`."""
    table = []
    for name, group in by_set(rows).items():
        kept = [row for row in group if row["kept"]]
        longer = percentiles([row["longer"] for row in kept], 50, 90, 100)
        seconds = percentiles([row["seconds"] for row in group], 50, 95)
        table.append(
            [
                name,
                str(len(group)),
                str(sum(row["verified"] for row in group)),
                str(sum(row["longer"] == 0.0 for row in kept)),
                str(len(kept)),
                " / ".join(f"{value:+.1%}" for value in longer),
                " / ".join(f"{value:.2f}" for value in seconds),
                str(sum(row["below"] for row in group)),
            ]
        )
    return table


if __name__ == "__main__":
    main()
