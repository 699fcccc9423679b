"""How quick OptiPlan is on this machine, in a minute: times of four examples, as multiples of a fixed piece of work.

    python benchmarks/smoke.py                      # also: make bench-smoke
    python benchmarks/smoke.py --markdown smoke.md

The yardstick is the time of 10,000 distances of coal, queried one by one from Python, of two hulls of the Panda's
links. Times are of the processor, the least of `--repeat`, so another load hardly shows; *first* alone is by the clock.
Compare multiples of different machines, or of one machine before and after a change. *load*: a problem file of a known
robot; *first*: until the first verified answer; *plan*: until the planner stops; *proof*: the verifier, once;
*metrics*; *shell*: `optiplan plan FILE` with its imports. The last line printed is one JSON object.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import platform
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import coal
import numpy as np
from published import commit, print_json, print_table, table_parser, write_markdown

from optiplan._core import variant
from optiplan.planners.base import Budget
from optiplan.problem.load import load_problem
from optiplan.robot.robot import load_robot
from optiplan.runs.metrics import measure
from optiplan.runs.pipeline import run
from optiplan.verify.verify import verify

EXAMPLES = ("01_reach", "02_shelf", "04_box", "09_ur5")
PROBLEMS = Path(__file__).resolve().parents[1] / "problems"
QUERIES = 10_000
HEADINGS = ("machine", "core", "commit", "yardstick ms", "load", "first", "plan", "proof", "metrics", "shell")


def main() -> None:
    """Measure, print."""
    parser = table_parser(__doc__)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--budget", type=float, default=5.0, help="seconds for each example")
    arguments = parser.parse_args()
    yard = yardstick(arguments.repeat)
    files = [next(PROBLEMS.glob(f"{name}*.yaml")) for name in EXAMPLES if list(PROBLEMS.glob(f"{name}*.yaml"))]
    rows = [one(file, arguments) for file in files]
    rows[0]["shell"] = shell(files[0], arguments.repeat)
    kinds = HEADINGS[4:]
    found = {kind: statistics.median([row[kind] for row in rows if kind in row]) for kind in kinds}
    again = yardstick(arguments.repeat)
    shown = [f"{found[kind] / min(yard, again):.2f}" for kind in kinds]
    table = [(processor(), variant, commit(), f"{1e3 * min(yard, again):.1f}", *shown)]
    print_table(HEADINGS, table)
    write_markdown(arguments.markdown, HEADINGS, table)
    print_json(
        {"machine": processor(), "core": variant, "commit": commit(), "yardstick_s": [yard, again], "times_s": found}
    )


def yardstick(repeat: int) -> float:
    """Processor time, s, of 10,000 distances between two hulls."""
    geometry = load_robot("panda").geometry.geometryObjects
    hulls = [body.geometry for body in geometry if isinstance(body.geometry, coal.ConvexBase)][2:4]
    rng, request = np.random.default_rng(0), coal.DistanceRequest()
    places = [coal.Transform3s(np.eye(3), rng.uniform(-0.5, 0.5, 3)) for _ in range(100)]

    def work() -> None:
        result = coal.DistanceResult()
        for k in range(QUERIES):
            result.clear()
            coal.distance(hulls[0], places[k % 100], hulls[1], places[(k + 7) % 100], request, result)

    return least(work, repeat)


def one(file: Path, arguments: argparse.Namespace) -> dict[str, float]:
    """Times, s, of one example."""
    problem = load_problem(file)
    runs: list[Any] = [
        run(problem, "trajopt", {}, Budget(arguments.budget), silent) for _ in range(min(arguments.repeat, 3))
    ]
    done = runs[-1]
    assert done.trajectory is not None
    assert done.report is not None
    return {
        "load": least(lambda: load_problem(file), arguments.repeat),
        "first": min(each.improvements[0][0] for each in runs if each.improvements),
        "plan": min(each.plan_cpu for each in runs if each.plan_cpu is not None),
        "proof": least(lambda: verify(problem, done.trajectory), arguments.repeat),
        "metrics": least(lambda: measure(problem, done.trajectory, done.report), arguments.repeat),
    }


def shell(file: Path, repeat: int) -> float:
    """Processor time, s, of the program in a process of its own."""
    command = [sys.executable, "-c", "from optiplan.cli.main import main; main()", "plan", str(file), "--json"]
    found = []
    for _ in range(repeat + 1):  # the first fills caches
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(command, capture_output=True, check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        found.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(found)


def least(work: Callable[[], object], repeat: int) -> float:
    """The least processor time, s, of some calls."""
    found = []
    for _ in range(repeat):
        began = time.process_time()
        work()
        found.append(time.process_time() - began)
    return min(found)


def silent(stage: str, fraction: float) -> None:
    """Report no progress."""


def processor() -> str:
    """Name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


if __name__ == "__main__":
    main()
