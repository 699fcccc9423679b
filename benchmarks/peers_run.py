"""Planners of other projects and ours on the same problems, one after the other on one core: time, claims, durations.

    python benchmarks/peers_run.py --every 10 --markdown peers.md --picture peers.png
        --peer roboplan=VENV/bin/python:roboplan_rrt.py --peer ompl=VENV/bin/python:ompl_moveit.py

Each peer has an adapter in `benchmarks/peers` and a virtual environment of its own (its README says which). *Claims*:
the planner says it has a motion; *verified*: our verifier proves it; *confirmed*: the second look of `mbm.py`, triangle
meshes at small steps. *Time* is the planner's own: of ours until the first verified answer and until it stops, of peers
what their adapter reports of search and simplifying, start of Python and loading left out. *Duration* is of the timed
motion, over the best known of the problem where there is one; jerk limits are lifted for all with `--no-jerk`. The last
line printed is one JSON object.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mbm import BEST_KNOWN, SecondLook, silent
from published import SHARED, commit, import_sets, percentiles, print_json, print_table, write_markdown
from rich.console import Console
from rich.progress import track

from optiplan.bench.results.best_known import BestKnownTable
from optiplan.errors import InputError
from optiplan.planners.base import Budget
from optiplan.problem.load import load_problem
from optiplan.problem.problem import Problem
from optiplan.runs.pipeline import attempt

PEERS = Path(__file__).parent / "peers"
HEADINGS = (
    "planner",
    "n",
    "claims",
    "verified",
    "confirmed",
    "time ms 50 / 95 / 98",
    "duration s 50",
    "over best known 50 / 90",
)


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peer", action="append", default=[], metavar="LABEL=PYTHON:ADAPTER[:SETTING,…]")
    parser.add_argument("--robot", choices=("panda", "ur5", "fetch"), default="panda")
    parser.add_argument("--every", type=int, default=10)
    parser.add_argument("--offset", type=int, default=0)
    parser.add_argument("--budget", type=float, default=5.0, help="seconds for each planner and problem")
    parser.add_argument("--no-jerk", action="store_true", help="lift the jerk limits, of which peers know nothing")
    parser.add_argument("--markdown", type=Path, help="write the table to this file")
    parser.add_argument("--picture", type=Path, help="draw duration against time into this file")
    return parser.parse_args()


def main() -> None:
    """Run every planner on every problem, print."""
    arguments = parse()
    known = BestKnownTable(BEST_KNOWN / f"mbm-{arguments.robot}.csv")
    planners = {"ours": ("trajopt", {}), **dict(map(peer, arguments.peer))}
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        sets = import_sets(arguments.robot, Path(folder), arguments.every, arguments.offset)
        files = [file for group in sets.values() for file in group]
        look = SecondLook(SHARED / "robots" / f"mbm_{arguments.robot}" / "robot.yaml", Path(folder))
        more: dict[str, Any] = {"limits": {"jerk": "none"}} if arguments.no_jerk else {}
        for file in track(files, "planning", console=Console(stderr=True), transient=True):
            try:
                problem = load_problem(file, **more)
            except InputError:
                continue
            best = known.get(load_problem(file).hash)
            for label, (name, options) in planners.items():
                row = solve(problem, name, options, arguments.budget, look)
                over = row["duration"] / best.duration if best and row["verified"] else None
                rows.append({"planner": label, "problem": f"{file.parent.name}/{file.stem}", "over_best": over, **row})
    table = [line(label, [row for row in rows if row["planner"] == label]) for label in planners]
    print_table(HEADINGS, table)
    write_markdown(arguments.markdown, HEADINGS, table)
    if arguments.picture is not None:
        draw(rows, list(planners), arguments.picture)
    print_json({"robot": arguments.robot, "budget": arguments.budget, "commit": commit(), "runs": rows})


def peer(text: str) -> tuple[str, tuple[str, dict[str, Any]]]:
    """`LABEL=PYTHON:ADAPTER[:SETTING,…]` as a label and a planner with its options."""
    label, _, rest = text.partition("=")
    python, adapter, *settings = rest.split(":")
    options: dict[str, Any] = {"adapter": str(PEERS / adapter), "python": python}
    if settings:
        options["settings"] = settings[0].split(",")
    return label, ("optiplan.bench.peers:Peer", options)


def solve(problem: Problem, name: str, options: dict[str, Any], budget: float, look: SecondLook) -> dict[str, Any]:
    """One planner on one problem."""
    done = attempt(problem, name, options, Budget(budget), silent)
    own = done.stages.get("peer")
    first = done.improvements[0][0] if done.improvements else None
    return {
        "claims": done.trajectory is not None,
        "verified": done.verified,
        "confirmed": done.trajectory is not None and look.confirms(problem, done.trajectory),
        "seconds": first if own is None else own,
        "until_end": done.timings["plan"],
        "duration": done.duration,
        "failure": None if done.failure is None else f"{done.failure.kind}: {done.failure.detail}",
    }


def line(label: str, rows: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    """A planner's line of the table."""
    shares = (
        f"{sum(row[key] for row in rows)} ({100 * sum(row[key] for row in rows) / max(len(rows), 1):.0f} %)"
        for key in ("claims", "verified", "confirmed")
    )
    claimed = [row for row in rows if row["claims"]]
    times = percentiles((row["seconds"] for row in claimed), 50, 95, 98)
    (duration,) = percentiles((row["duration"] for row in claimed), 50)
    over = percentiles((row["over_best"] for row in rows), 50, 90)
    return (
        label,
        str(len(rows)),
        *shares,
        " / ".join(f"{1e3 * t:.0f}" for t in times),
        f"{duration:.3f}",
        " / ".join(f"{ratio:.3f}" for ratio in over),
    )


def draw(rows: Sequence[dict[str, Any]], labels: Sequence[str], path: Path) -> None:
    """Duration against time, a point a motion; hollow where the verifier refuses it."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    ax = figure.subplots()
    for k, label in enumerate(labels):
        own = [row for row in rows if row["planner"] == label and row["claims"] and row["seconds"]]
        for verified in (True, False):
            some = [row for row in own if row["verified"] is verified]
            ax.scatter(
                [1e3 * row["seconds"] for row in some],
                [row["duration"] for row in some],
                s=22,
                facecolors=f"C{k}" if verified else "none",
                edgecolors=f"C{k}",
                label=f"{label}, {'verified' if verified else 'refused'}" if some else None,
            )
    ax.set(xscale="log", yscale="log", xlabel="time of planning, ms", ylabel="duration of the motion, s")
    ax.legend(fontsize="small")
    ax.grid(alpha=0.3)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main()
