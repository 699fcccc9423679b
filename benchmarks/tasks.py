"""Tasks of several steps: what is gained where the arm does not stop, and where all between two stops is one program.

    python benchmarks/tasks.py                                     # the four worked tasks, about a minute
    python benchmarks/tasks.py --budget 60 --markdown /tmp/tasks.md
    python benchmarks/publish.py tasks /tmp/tasks.md --readme docs/how-to/tasks.md

Each task has three durations: with a stop after every step; with the same moves and lines joined to timed paths; and
that of the answer, in which all steps between two stops were optimised together. Then come the remaining stops, the
sum of the lower bounds from stop to stop over the duration, the planning time, and the share of the optimisation.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

from itertools import pairwise
from pathlib import Path
from typing import Any

from published import finish, table_parser

import optiplan as op
from optiplan.trajectory.timing.lower_bound import lower_bounds

PROBLEMS = Path(__file__).parent.parent / "problems"
TASKS = ("40_panda_sorts_cubes", "41_delbot_fetches", "42_srra_tends_and_drills", "43_baxter_carries_a_tray")
HEADINGS = (
    "task",
    "verified",
    "steps",
    "stops",
    "with all stops, s",
    "joined, s",
    "as one program, s",
    "bounds / duration",
    "planning, s of a core",
    "of it optimisation",
)


def bounds_between_stops(run: op.Run) -> float:
    """Return the sum of the lower bounds from stop to stop, s; standing still counts as it is."""
    motion = run.trajectory
    times = [0.0, *(stop["t"] for stop in run.info["stops"]), motion.duration]
    still = sum(one.end - one.begin for one in motion.segments if one.kind == "dwell")
    ends = [motion(t) for t in times]
    return still + sum(float(lower_bounds(a, b[None], run.problem.limits)[0]) for a, b in pairwise(ends))


def measured(name: str, budget: float) -> dict[str, Any]:
    """Plan one task and return what the table says of it."""
    run = op.plan(op.load_problem(PROBLEMS / f"{name}.yaml"), budget=budget)
    if run.trajectory is None:
        return {"task": name, "verified": False, "failure": str(run.failure)}
    return {
        "task": name,
        "verified": run.verified,
        "steps": run.trajectory.segments[-1].step,
        "stops": run.info["stops"],
        "with_stops": run.info["duration_with_stops"],
        "joined": run.info["duration_joined"],
        "duration": run.duration,
        "bounds": bounds_between_stops(run),
        "planning": run.plan_cpu,
        "wall": run.timings["plan"],
        "stages": dict(run.stages),
    }


def cells(one: dict[str, Any]) -> list[str]:
    """Return the row of one task."""
    if "duration" not in one:
        return [one["task"], "no", *["–"] * (len(HEADINGS) - 2)]
    return [
        one["task"],
        "yes" if one["verified"] else "no",
        str(one["steps"]),
        str(len(one["stops"])),
        *(f"{one[key]:.2f}" for key in ("with_stops", "joined", "duration")),
        f"{one['bounds'] / one['duration']:.3f}",
        f"{one['planning']:.1f}",
        f"{100.0 * one['stages']['optimisation'] / one['wall']:.0f} %",
    ]


def main() -> None:
    """Plan all of them and print the table."""
    parser = table_parser(__doc__)
    parser.add_argument("tasks", nargs="*", default=TASKS, help="names of problem files")
    parser.add_argument("--budget", type=float, default=40.0, help="s, of each plan")
    arguments = parser.parse_args()
    found = [measured(name, arguments.budget) for name in arguments.tasks]
    rows = [cells(one) for one in found]
    finish(arguments.markdown, HEADINGS, rows, {"budget": arguments.budget, "runs": found})


if __name__ == "__main__":
    main()
