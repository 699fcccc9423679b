"""Where robots should stand: durations of tasks at the given base and at the best one found.

    python benchmarks/places.py                              # three tasks of problems/
    python benchmarks/places.py --markdown /tmp/places.md
    python benchmarks/publish.py places /tmp/places.md --readme docs/how-to/place.md

Every motion is verified. *Found after* is the time of one core for map and plans; `--budget` counts it too.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import time
from pathlib import Path
from typing import Any

from published import finish, table_parser

import optiplan as op
from optiplan.planners import base

PROBLEMS = Path(__file__).parent.parent / "problems"
TASKS = ("09_ur5", "42_srra_tends_and_drills", "45_spot_tour")
HEADINGS = (
    "task",
    "bases scored",
    "given, s",
    "found, s",
    "moved by x, y, m, and yaw, rad",
    "found after, s of a core",
)


def measured(name: str, budget: float) -> dict[str, Any]:
    """Look for the best base for one task; return what the table says of it."""
    began = time.process_time()
    found = op.place(op.load_problem(PROBLEMS / f"{name}.yaml"), budget=budget)
    return {
        "task": name,
        "scored": len(found.scores.seconds),
        "given": found.given.duration if found.given is not None and found.given.verified else None,
        "found": None if found.run is None else found.run.duration,
        "moved": found.moved,
        "seconds": time.process_time() - began,
    }


def cells(one: dict[str, Any]) -> list[str]:
    """Return the row of one task."""
    moved = "–" if one["moved"] is None else ", ".join(f"{one['moved'][k]:.2f}" for k in (0, 1, 3))
    times = ("–" if one[key] is None else f"{one[key]:.2f}" for key in ("given", "found"))
    return [one["task"], str(one["scored"]), *times, moved, f"{one['seconds']:.0f}"]


def main() -> None:
    """Place all of them and print the table; budgets count the processor's time, so that another load hardly shows."""
    base.clock = time.process_time
    parser = table_parser(__doc__)
    parser.add_argument("tasks", nargs="*", default=TASKS, help="names of problem files")
    parser.add_argument("--budget", type=float, default=50.0, help="s, of each search")
    arguments = parser.parse_args()
    found = [measured(name, arguments.budget) for name in arguments.tasks]
    rows = [cells(one) for one in found]
    finish(arguments.markdown, HEADINGS, rows, {"budget": arguments.budget, "runs": found})


if __name__ == "__main__":
    main()
