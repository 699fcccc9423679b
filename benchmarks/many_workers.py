"""What `op.plan_many` gives on N cores, from measured costs: a simulation, since this machine has few.

    python benchmarks/many_workers.py --budget 1                       # two minutes
    python benchmarks/many_workers.py --budget 1 --robots panda ur5 --every 20 --markdown many-workers.md

Measured in one process of this machine: the processor seconds of each problem, from its pickled request to its pickled
run; those of the first of a robot in a fresh process, which loads the robot; and those of a fresh process until it can
plan. The schedule is that of the pool: a worker that is free takes the next problem in the order given. *Speed-up* is
the sum of the costs in one used process over the time until the last worker has ended; *ideal* is without the start of
processes and loading. Problems: every k-th of MotionBenchMaker's sets. Cores are taken to be as fast as this one
however many are busy, so memory and clock are left out. The last line printed is JSON.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import heapq
import pickle
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from published import commit, import_sets, print_json, print_table, table_parser, write_markdown

import optiplan as op

WORKERS = (1, 2, 4, 8, 16, 32, 64, 128)
HEADINGS = ("workers", "s until the last has ended", "speed-up", "ideal", "share of the cores busy")


def main() -> None:
    """Measure, simulate, print."""
    parser = table_parser(__doc__)
    parser.add_argument("--robots", nargs="+", default=["panda"])
    parser.add_argument("--every", type=int, default=20, help="every k-th problem of each set")
    parser.add_argument("--budget", type=float, default=1.0, help="seconds of each problem")
    parser.add_argument("--times", type=int, default=4, help="how often the problems are in the list")
    options = parser.parse_args()
    costs: list[float] = []
    starts: list[float] = []
    first: dict[str, float] = {}
    robots: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        for robot in options.robots:
            sets = import_sets(robot, Path(folder) / robot, options.every)
            for file in (file for files in sets.values() for file in files):
                request = pickle.dumps(op.load_problem(file))
                if robot not in first:
                    start, first[robot] = fresh(request, options.budget)
                    starts.append(start)
                    planned(request, options.budget)
                costs.append(planned(request, options.budget))
                robots.append(robot)
    start = min(starts)
    costs, robots = costs * options.times, robots * options.times
    loading = {robot: max(0.0, first[robot] - costs[robots.index(robot)]) for robot in first}
    table, told = [], {}
    for count in WORKERS:
        last, ideal = ends(costs, robots, count, start, loading), ends(costs, robots, count, 0.0, {})
        told[count] = last
        cells = (last, sum(costs) / last, sum(costs) / ideal, sum(costs) / (count * last))
        table.append([f"{count}", *(f"{value:.2f}" for value in cells)])
    print_table(HEADINGS, table)
    remark = f"{len(costs)} problems of {sum(costs) / len(costs):.2f} s on average; a process starts in {start:.2f} s."
    loads = ", ".join(f"{robot} {seconds:.2f} s" for robot, seconds in loading.items())
    write_markdown(options.markdown, HEADINGS, table, [remark, f"The first problem of a robot costs more: {loads}."])
    print_json({"commit": commit(), "costs": costs, "start": start, "loading": loading, "ends": told})


def ends(costs: Sequence[float], robots: Sequence[str], count: int, start: float, loading: dict[str, float]) -> float:
    """Seconds until the last of `count` workers has ended, each taking the next problem when it is free."""
    free = [(start, k) for k in range(min(count, len(costs)))]
    known: list[set[str]] = [set() for _ in free]
    heapq.heapify(free)
    last = 0.0
    for cost, robot in zip(costs, robots, strict=True):
        at, k = heapq.heappop(free)
        at += cost + (0.0 if robot in known[k] else loading.get(robot, 0.0))
        known[k].add(robot)
        heapq.heappush(free, (at, k))
        last = max(last, at)
    return last


def planned(request: bytes, budget: float) -> float:
    """Processor seconds from a pickled problem to its pickled run."""
    began = time.process_time()
    pickle.dumps(op.plan(pickle.loads(request), budget=budget))
    return time.process_time() - began


FRESH = """
import pickle, sys, time
import optiplan as op
from optiplan.planners.registry import load_libraries
op.plan, load_libraries("trajopt")  # both import much, once for all robots
start = time.process_time()
problem = pickle.loads(sys.stdin.buffer.read())
pickle.dumps(op.plan(problem, budget=float(sys.argv[1])))
print(start, time.process_time() - start)
"""


def fresh(request: bytes, budget: float) -> tuple[float, float]:
    """Processor seconds of a fresh process until it can plan, and of the same in it."""
    found = subprocess.run(
        [sys.executable, "-c", FRESH, f"{budget}"], input=request, stdout=subprocess.PIPE, check=True
    )
    start, first = map(float, found.stdout.split())
    return start, first


if __name__ == "__main__":
    main()
