"""Seconds by the clock until somebody who asks for a motion has a verified one in hands.

    python benchmarks/first_answer.py --every 5 --markdown first-answer.md   # four robots, about six minutes
    python benchmarks/first_answer.py --every 5 --pose                       # the tool's pose is the goal
    python benchmarks/first_answer.py --every 10 --fresh                     # each problem in a process of its own

Problems: every k-th of MotionBenchMaker's sets of a robot, for Baxter's both arms those of `both_arms.py`, each loaded
anew for each way, since a scene's first proof sets things up. Ways: *recorded* is the first of `run.improvements` of a
call with the whole budget; *told* is when a progress with a method `proved` heard of it; *returned* is a whole call
that such a progress ends then, from `op.plan` to its run, metrics included. Durations are those of *returned* over
those of the whole call. With `--fresh` a process of its own solves each problem once as *told* and *recorded* say, and
the time to load it is told as well (*loaded*: imports, the robot); then once more, loaded anew (*used*, and its load).
The last line printed is JSON.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import gc
import multiprocessing
import tempfile
import threading
import time
from functools import partial
from pathlib import Path
from typing import Any

from both_arms import both_arms
from pose_goals import pose_problem
from published import commit, finish, import_sets, percentiles, table_parser
from rich.console import Console
from rich.progress import track

import optiplan as op

ROBOTS = ("panda", "ur5", "fetch", "baxter")
WAYS = ("recorded", "told", "returned")
FRESH_WAYS = ("loaded", "recorded", "told", "loaded again", "recorded when used", "told when used")
HEADINGS = ("robot", "problems", "way", "s: 50 %", "90 %", "95 %", "verified", "duration over the last: 50 %", "90 %")


class Told:
    """Notes when the first motion is verified, and ends the planning then if it is asked to."""

    def __init__(self) -> None:
        self.began, self.enough = time.perf_counter(), threading.Event()
        self.seconds: float | None = None

    def __call__(self, stage: str, fraction: float) -> None:
        """Take no notice of stages."""

    def proved(self, _motion: op.Trajectory, _seconds: float) -> None:
        """Note the time, and set the event."""
        if self.seconds is None:
            self.seconds = time.perf_counter() - self.began
        self.enough.set()


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = table_parser(__doc__)
    parser.add_argument("--robots", nargs="+", choices=ROBOTS, default=list(ROBOTS))
    parser.add_argument("--every", type=int, default=5, help="every k-th problem of each set")
    parser.add_argument("--offset", type=int, default=0, help="index of the first of them")
    parser.add_argument("--budget", type=float, default=1.0, help="seconds of each call")
    parser.add_argument(
        "--fresh", action="store_true", help="each problem in a process that has planned nothing before"
    )
    parser.add_argument("--pose", action="store_true", help="goals are poses of the tool, in place of configurations")
    return parser.parse_args()


def main() -> None:
    """Plan in three ways, print."""
    options = parse()
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        for robot in options.robots:
            of_robot = both_arms if robot == "baxter" else partial(import_sets, robot)
            sets = of_robot(Path(folder) / robot, options.every, options.offset)
            files = [file for files in sets.values() for file in files if readable(file)]
            op.plan(op.load_problem(files[0]), budget=options.budget)  # pays for imports, and fills the cache on disk
            for file in track(files, robot, console=Console(stderr=True), transient=True):
                found = elsewhere(file, options) if options.fresh else solve(file, options)
                rows.append({"robot": robot, "problem": f"{file.parent.name}/{file.stem}", **found})
    ways = FRESH_WAYS if options.fresh else WAYS
    table = [line(rows, robot, way) for robot in options.robots for way in ways]
    finish(options.markdown, HEADINGS, table, {"commit": commit(), "runs": rows}, [f"Budget {options.budget:g} s."])


def readable(file: Path) -> bool:
    """Whether a problem is no bad input."""
    try:
        op.load_problem(file)
    except op.InputError:
        return False
    return True


def solve(file: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Seconds of the three ways, None without a verified motion, and durations of the first and the last answer."""
    budget = options.budget
    problem, told = fresh(file, options.pose), Told()
    whole = op.plan(problem, budget=budget, progress=told)
    recorded = whole.improvements[0][0] if whole.improvements else None

    problem, first = fresh(file, options.pose), Told()
    run = op.plan(problem, budget=op.Budget(budget, cancel=first.enough), progress=first)
    returned = time.perf_counter() - first.began if run.verified else None
    durations = [found.duration if found.verified else None for found in (run, whole)]
    return {"recorded": recorded, "told": told.seconds, "returned": returned, "durations": durations}


def elsewhere(file: Path, options: argparse.Namespace) -> dict[str, Any]:
    """`first_and_next` of a new process."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(first_and_next, (file, options))


def first_and_next(file: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Seconds to load and to the first motion, when this process has done nothing yet, and once more."""
    found: dict[str, Any] = {"durations": [None, None]}
    for when, loaded in (("", "loaded"), (" when used", "loaded again")):
        began = time.perf_counter()
        problem = fresh(file, options.pose)
        found[loaded] = time.perf_counter() - began
        told = Told()
        run = op.plan(problem, budget=op.Budget(options.budget, cancel=told.enough), progress=told)
        found[f"recorded{when}"] = run.improvements[0][0] if run.improvements else None
        found[f"told{when}"] = told.seconds
    return found


def fresh(file: Path, pose: bool = False) -> op.Problem:
    """The problem, loaded anew, without a wished clearance, and no garbage of what came before it."""
    problem = (pose_problem(file) if pose else op.load_problem(file)).with_parts(clearance=0)
    gc.collect()
    return problem


def line(rows: list[dict[str, Any]], robot: str, way: str) -> list[str]:
    """One row of the table; a problem without a verified answer counts as infinitely long."""
    mine = [row for row in rows if row["robot"] == robot]
    seconds = percentiles([row[way] or float("inf") for row in mine], 50, 90, 95)
    both = [row["durations"] for row in mine if all(row["durations"])]
    ratios = percentiles([first / last for first, last in both], 50, 90) if way == "returned" else ()
    return [
        robot,
        f"{len(mine)}",
        way,
        *(f"{value:.3f}" for value in seconds),
        f"{sum(row[way] is not None for row in mine)}",
        *([f"{ratio:.2f}" for ratio in ratios] or ["", ""]),
    ]


if __name__ == "__main__":
    main()
