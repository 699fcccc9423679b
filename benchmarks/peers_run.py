"""Planners of other projects and ours on the same problems, one after the other on one core: time, claims, durations.

    python benchmarks/peers_run.py --every 10 --markdown peers.md --picture peers.png
        --peer roboplan=VENV/bin/python:roboplan_rrt.py --peer ompl=VENV/bin/python:ompl_moveit.py

Each peer has an adapter in `benchmarks/peers` and a virtual environment of its own (its README says which). *Claims*:
the planner reports a motion. *Free*: our verifier proves that nothing touches, whatever the limits; *on meshes*:
the second look of `mbm.py`, triangle meshes at small steps, sees no contact. *Within v, a*: position, velocity and
acceleration limits are kept; *within all*: those of jerk and torque too, which no peer knows. *Verified*: all of
that, proved. *Time* is the planner's own. Ours has three lines, the first verified answer, that after 1 s and the last,
each with the time and the duration of that answer, proofs included; of peers it is what their adapter counts of search,
simplifying and their own timing, start of Python and loading left out. *Duration* is of the timed motion; over the best
known of the problem where there is one, of those that are free. Jerk limits are lifted for all with `--no-jerk`; best
known ones keep them, so ratios may be below 1 then. Peers that take a limit of time get 0.8 of `--budget` for their
search. The last line printed is one JSON object.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mbm import BEST_KNOWN, SecondLook, silent
from published import SHARED, commit, import_sets, percentiles, print_json, print_table, table_parser, write_markdown
from rich.console import Console
from rich.progress import track

from optiplan.bench.results.best_known import BestKnownTable
from optiplan.errors import InputError
from optiplan.planners.base import Budget
from optiplan.problem.load import load_problem
from optiplan.problem.problem import Problem
from optiplan.runs.pipeline import plan_and_verify_once

STARTUP = 30.0
"""s beyond its budget after which a peer that has not answered is ended: Python, libraries and models are loaded."""
FIRST, SOON, LAST = "ours, first", "ours, 1 s", "ours, last"
WITHIN = 1.0
"""s of planning and proof at which our answer has a row of its own."""
RATES, LIMITS = {"position", "velocity", "acceleration"}, {"jerk", "torque", "rest", "continuity"}
JUDGED = ("claims", "free", "meshes", "rates", "limits", "verified")
PEERS = Path(__file__).parent / "peers"
HEADINGS = (
    "planner",
    "n",
    "claims",
    "free",
    "free on meshes",
    "within v, a",
    "within all",
    "verified",
    "time ms 50 / 95 / 98",
    "duration s 50",
    "over best known 50 / 90",
)


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = table_parser(__doc__)
    parser.add_argument("--peer", action="append", default=[], metavar="LABEL=PYTHON:ADAPTER[:SETTING,…]")
    parser.add_argument("--robot", choices=("panda", "ur5", "fetch"), default="panda")
    parser.add_argument("--every", type=int, default=10)
    parser.add_argument("--offset", type=int, default=0)
    parser.add_argument("--budget", type=float, default=5.0, help="seconds for each planner and problem")
    parser.add_argument("--no-jerk", action="store_true", help="lift the jerk limits, of which peers know nothing")
    parser.add_argument("--picture", type=Path, help="draw duration against time into this file")
    return parser.parse_args()


def main() -> None:
    """Run every planner on every problem, print."""
    arguments = parse()
    known = BestKnownTable(BEST_KNOWN / f"mbm-{arguments.robot}.csv")
    planners = {"ours": ("trajopt", {}), **dict(peer(text, arguments.budget) for text in arguments.peer)}
    labels = [FIRST, SOON, LAST, *list(planners)[1:]]
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
                seconds = arguments.budget + (STARTUP if options else 0.0)
                row = {"planner": label, "problem": f"{file.parent.name}/{file.stem}"}
                row |= solve(problem, name, options, seconds, look)
                for one in [row] if options else ours(row):
                    over = one["duration"] / best.duration if best and one["free"] else None
                    rows.append({**one, "over_best": over})
    table = [line(label, [row for row in rows if row["planner"] == label]) for label in labels]
    print_table(HEADINGS, table)
    write_markdown(arguments.markdown, HEADINGS, table)
    if arguments.picture is not None:
        draw(rows, [label for label in labels if label != SOON], arguments.picture)
    print_json({"robot": arguments.robot, "budget": arguments.budget, "commit": commit(), "runs": rows})


def peer(text: str, budget: float) -> tuple[str, tuple[str, dict[str, Any]]]:
    """`LABEL=PYTHON:ADAPTER[:SETTING,…]` as a label and a planner with its options."""
    label, _, rest = text.partition("=")
    python, adapter, *settings = rest.split(":")
    options: dict[str, Any] = {"adapter": str(PEERS / adapter), "python": python, "search": budget}
    if settings:
        options["settings"] = settings[0].split(",")
    return label, ("optiplan.bench.peers:Peer", options)


def solve(problem: Problem, name: str, options: dict[str, Any], budget: float, look: SecondLook) -> dict[str, Any]:
    """One planner on one problem."""
    done = plan_and_verify_once(problem, name, options, Budget(budget), silent)
    failed = {check.name for check in done.report.checks if not check.passed} if done.report else None
    own = sum(done.timings.get(key, 0.0) for key in ("plan", "verify", "other proofs"))
    return {
        "claims": done.trajectory is not None,
        "free": failed is not None and "collision" not in failed,
        "meshes": done.trajectory is not None and look.free(problem, done.trajectory),
        "rates": failed is not None and not failed & RATES,
        "limits": failed is not None and not failed & (RATES | LIMITS),
        "verified": done.verified,
        "seconds": done.stages.get("peer", own),
        "duration": done.duration,
        "improvements": done.improvements,
        "failure": None if done.failure is None else f"{done.failure.kind}: {done.failure.detail}",
        "refused": sorted(failed or ()),
    }


def ours(row: dict[str, Any]) -> list[dict[str, Any]]:
    """Our first verified answer, that after `WITHIN` and the last as rows, each with its time and its duration."""
    first, soon, last = ({**row, "planner": label} for label in (FIRST, SOON, LAST))
    if row["improvements"]:
        first["seconds"], first["duration"] = row["improvements"][0]
        known = [found for found in row["improvements"] if found[0] <= WITHIN]
        if known:
            soon["seconds"], soon["duration"] = known[-1]
        else:
            soon |= dict.fromkeys(JUDGED, False) | {"seconds": None, "duration": None}
    return [first, soon, last]


def line(label: str, rows: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    """A planner's line of the table."""
    shares = (
        f"{sum(row[key] for row in rows)} ({100 * sum(row[key] for row in rows) / max(len(rows), 1):.0f} %)"
        for key in JUDGED
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
        " / ".join(f"{ratio:.3f}" if np.isfinite(ratio) else "–" for ratio in over),
    )


def draw(rows: Sequence[dict[str, Any]], labels: Sequence[str], path: Path) -> None:
    """Duration against time, a point a motion; hollow where something touches. Our first and last are joined."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import ScalarFormatter

    figure = Figure(figsize=(8.5, 4.5), layout="constrained")
    ax = figure.subplots()
    for k, label in enumerate(labels):
        own = [row for row in rows if row["planner"] == label and row["claims"] and row["seconds"]]
        for free in (True, False):
            some = [row for row in own if row["free"] is free]
            ax.scatter(
                [1e3 * row["seconds"] for row in some],
                [row["duration"] for row in some],
                s=12,
                linewidths=0.7,
                facecolors=f"C{k}" if free else "none",
                edgecolors=f"C{k}",
                label=f"{label}, {'free' if free else 'touches'}: {len(some)}" if some else None,
            )
    ends_of = ([row for row in rows if row["planner"] == label and row["claims"]] for label in (FIRST, LAST))
    for first, last in zip(*ends_of, strict=True):
        ends = [[1e3 * row["seconds"] for row in (first, last)], [row["duration"] for row in (first, last)]]
        ax.plot(*ends, color="0.8", linewidth=0.4, zorder=0)
    ax.set(xscale="log", yscale="log", xlabel="time of planning, ms", ylabel="duration of the motion, s")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter(ScalarFormatter())
    ax.yaxis.set_minor_formatter(ScalarFormatter())
    ax.grid(alpha=0.3)
    figure.legend(loc="outside right upper", fontsize="small")
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main()
