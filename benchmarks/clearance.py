"""A clearance of 5 mm beside none: what it costs on MotionBenchMaker, and an outside check of the distances.

    python benchmarks/clearance.py                          # 350 Panda problems, twice: an hour on one core
    python benchmarks/clearance.py --every 5 --budget 5     # 70 of them
    python benchmarks/clearance.py --markdown clearance.md

Problems are read from `$OPTIPLAN_SHARED/mbm/<robot>`. Each is planned without and with the clearance, from the scene
and of the robot from itself. *First* is the time after which the first verified answer was there. *Longer* is the
duration with the clearance over that without, of problems verified with both. *Nearer at an end* counts problems whose
start or goal is nearer than required; about those ends the floor of a pair is 0.8 of its own distance.

The judge shares nothing with planner and verifier but the bodies: coal's distance of every pair at configurations
between which no joint moves by more than 0.01 rad, floors worked out here. The exit code is 1 where a pair is below its
floor by more than coal's 1e-6 m. *Least* is the smallest distance that it met of pairs which have no lower floor. The
last line printed is one JSON object.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from mbm import silent, steps, warm_up
from published import by_set, commit, import_sets, percentiles, print_json, print_table, sets_parser, write_markdown
from rich.console import Console
from rich.progress import track

from optiplan.collision.model import CollisionModel
from optiplan.errors import InputError
from optiplan.planners.base import Budget
from optiplan.problem.load import load_problem
from optiplan.problem.problem import Problem
from optiplan.runs.pipeline import run
from optiplan.runs.run import Run
from optiplan.trajectory.trajectory import Trajectory

OWN_SHARE, WITHIN = 0.8, 0.5  # of docs/how-to/clearance.md: a nearer pair's floor, and rad over which it grows
ROUNDED = 1e-6  # m, what coal's distances are trusted to
HEADINGS = (
    "set",
    "n",
    "bad input",
    "verified without",
    "verified with",
    "nearer at an end",
    "longer 50 / 90 / max",
    "first s 50 / 95 without",
    "first s 50 / 95 with",
    "least mm without",
    "least mm with",
    "below a floor",
)


def main() -> None:
    """Plan with and without, judge, print."""
    parser = sets_parser(__doc__)
    parser.add_argument("--planner", default="trajopt")
    parser.add_argument("--clearance", type=float, default=0.005, help="m")
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        sets = import_sets(options.robot, Path(folder), options.every, options.offset)
        files = [file for name in options.sets or sets for file in sets[name]]
        warm_up(files, options)
        try:
            for file in track(files, "planning", console=Console(stderr=True), transient=True):
                rows.append(solved(file, options))
        except KeyboardInterrupt:
            print(f"interrupted after {len(rows)} of {len(files)} problems", file=sys.stderr)
    table = lines(rows)
    print_table(HEADINGS, table)
    remarks = [remark for row in rows if (remark := in_words(row))]
    asked = f"Asked: {1e3 * options.clearance:g} mm from the scene and of the robot from itself."
    samples, below = (sum(row.get(key, 0) for row in rows) for key in ("samples", "below"))
    judged = f"Judged from outside: {samples:,} configurations, {below} of them with a pair below its floor."
    write_markdown(options.markdown, HEADINGS, table, [asked, judged, *(["\n".join(remarks)] if remarks else [])])
    told = {"robot": options.robot, "budget": options.budget, "clearance": options.clearance, "commit": commit()}
    print_json({**told, "samples": samples, "below": below, "runs": rows})
    sys.exit(1 if below else 0)


def solved(file: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Return both runs of one problem in figures."""
    row: dict[str, Any] = {"set": file.parent.name, "problem": file.stem, "bad_input": None}
    try:
        problem = load_problem(file).with_parts(clearance=0.0)
    except InputError as error:
        return {**row, "bad_input": "; ".join(f"{issue.field}: {issue.found}" for issue in error.issues)}
    for key, asked in (("without", 0.0), ("with", options.clearance)):
        done = run(problem.with_parts(clearance=asked), options.planner, {}, Budget(options.budget), silent)
        row |= {f"{name} {key}": value for name, value in measured(done).items()}
        if done.trajectory is not None and done.verified:
            found = judged(problem, done.trajectory, asked)
            row[f"least {key}"] = found.pop("least")
            row |= found if asked else {}
    if row["verified without"] and row["verified with"]:
        row["longer"] = row["duration with"] / row["duration without"] - 1.0
    return row


def measured(done: Run) -> dict[str, Any]:
    """Return verdict, times and duration, s."""
    refused = [check.name for check in done.report.failures] if done.report else []
    return {
        "verified": done.verified,
        "first": done.improvements[0][0] if done.improvements and done.verified else None,
        "duration": done.duration,
        "why": None if done.verified else done.failure.detail if done.failure else f"refused: {', '.join(refused)}",
    }


def judged(problem: Problem, motion: Trajectory, asked: float) -> dict[str, Any]:
    """Return the least distance of pairs without a lower floor, m, and how many samples have a pair below its floor."""
    distances = Distances(problem)
    Q = motion(steps(motion))
    ends = np.array([motion.start, motion.end])
    at_ends = np.array([distances.at(q) for q in ends])
    base = np.where(at_ends < asked, OWN_SHARE * at_ends, asked)  # (2, P)
    way = np.abs(Q[:, None] - ends).sum(axis=2)  # (N, 2)
    floor = (base + (asked - base) * np.minimum(way[..., None] / WITHIN, 1.0)).min(axis=1)
    D = np.array([distances.at(q) for q in Q])
    lower = (at_ends < asked).any(axis=0)
    below = int((D < floor - ROUNDED).any(axis=1).sum())
    return {
        "least": float(D[:, ~lower].min(initial=np.inf)),
        "nearer": bool(lower.any()),
        "samples": len(Q),
        "below": below,
    }


class Distances:
    """Distances of all pairs of bodies by coal, one query a pair."""

    def __init__(self, problem: Problem) -> None:
        model = CollisionModel(problem.robot, problem.scene)
        self.model, self.geometry = model.model, model.geometry
        self.pairs = [(pair.a, pair.b) for pair in model.pairs]
        self.data, self.placed = self.model.createData(), self.geometry.createData()

    def at(self, q: np.ndarray) -> np.ndarray:
        """Return them at q (n,): (P,), m."""
        pin.updateGeometryPlacements(self.model, self.data, self.geometry, self.placed, q)
        bodies, places = self.geometry.geometryObjects, self.placed.oMg
        X = [coal.Transform3s(place.rotation, place.translation) for place in places]
        request = coal.DistanceRequest()
        return np.array(
            [
                coal.distance(bodies[a].geometry, X[a], bodies[b].geometry, X[b], request, coal.DistanceResult())
                for a, b in self.pairs
            ]
        )


def lines(rows: list[dict[str, Any]]) -> list[list[str]]:
    """Return one line a set and one for all, in the order of `HEADINGS`."""
    table = []
    for name, group in by_set(rows).items():
        good = [row for row in group if row["bad_input"] is None]
        longer = percentiles((row.get("longer") for row in good), 50, 90, 100)
        firsts = [percentiles((row[f"first {key}"] for row in good), 50, 95) for key in ("without", "with")]
        least = [1e3 * min((row.get(f"least {key}", np.inf) for row in good), default=np.inf) for key in SIDES]
        table.append(
            [
                name,
                str(len(group)),
                str(len(group) - len(good)),
                *(f"{sum(row[f'verified {key}'] for row in good)} of {len(good)}" for key in SIDES),
                str(sum(row.get("nearer", False) for row in good)),
                " / ".join(f"{value:+.1%}" for value in longer),
                *(" / ".join(f"{value:.2f}" for value in first) for first in firsts),
                *(f"{value:.3g}" for value in least),
                str(sum(row.get("below", 0) for row in good)),
            ]
        )
    return table


SIDES = "without", "with"


def in_words(row: dict[str, Any]) -> str | None:
    """Return why a problem is not verified with the clearance; None if it is."""
    name = f"- {row['set']}/{row['problem']}"
    if row["bad_input"] is not None:
        return f"{name}: bad input: {row['bad_input']}"
    return None if row["verified with"] else f"{name}: {row['why with']}"


if __name__ == "__main__":
    main()
