"""Measure what the runner costs on top of the runs themselves.

    python benchmarks/bench_overhead.py

Four suites of one worker on the numbered examples: real planners, and a planner that only waits (0.05, 0.2 and 1 s).
*Runs' time* is what the worker spent in planning, verifying, measuring and simulating. *Overhead* is the rest of the
wall time up to the last run, as a share of the runs' time: loading problems, messages, packing trajectories, storing.
The start of the worker and the warm-up do not count. Run it on a quiet machine. The last line printed is one JSON
object.
"""

import json
import os
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from published import script_parser

from optiplan.bench.execution.pool import LocalPool
from optiplan.bench.execution.runner import open_results, run_suite
from optiplan.bench.suite.suite import load_suite
from optiplan.planners.base import Budget, PlanResult, Progress
from optiplan.problem.problem import JointGoal, Problem
from optiplan.trajectory.timing.stops import stop_at_corners

ROOT = Path(__file__).parents[1]
STAGES = ("plan", "verify", "other proofs", "measure", "execute")


@dataclass(frozen=True)
class WaitsOptions:
    """`seconds` to wait."""

    seconds: float = 0.2


class Waits:
    """A straight line after some seconds."""

    Options = WaitsOptions

    def __init__(self, options: WaitsOptions) -> None:
        self.options = options

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Wait, without using the processor."""
        time.sleep(0.0 if problem.name == "warm-up" else self.options.seconds)
        goal = problem.goal[0]
        end = goal.q if isinstance(goal, JointGoal) else problem.start + 0.1
        path = np.array([problem.start, end])
        return PlanResult(stop_at_corners(path, problem.limits, problem.robot.joint_names), None, {})


def main() -> None:
    """Run the suites, print a line for each."""
    script_parser(__doc__).parse_args()
    sys.path.insert(0, str(Path(__file__).parent))
    result = {"real": measure(["trajopt", "rrtconnect", "quintic"], 3)}
    for seconds, count in ((0.05, 40), (0.2, 20), (1.0, 3)):
        planner = {"name": "bench_overhead:Waits", "label": "waits", "seconds": seconds}
        result[f"waits {seconds:g} s"] = measure([planner], count)
    print(json.dumps(result))


def measure(planners: list[Any], repetitions: int) -> dict[str, float]:
    """One suite, one worker."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        glob = {"glob": str(ROOT / "problems" / "0[1-9]*.yaml"), "set": "examples"}
        suite = {"version": 1, "name": "overhead", "problems": [glob], "planners": planners, "budget": 5}
        path = folder / "suite.yaml"
        path.write_text(json.dumps(suite | {"repetitions": repetitions}))
        loaded = load_suite(path, folder)
        with open_results(loaded, folder / "out") as store:
            pool, moments = LocalPool(1), [0.0]
            began = time.perf_counter()
            run_suite(loaded, store, pool, "1 local", lambda outcome: moments.append(time.perf_counter()))
            wall = moments[-1] - began
            rows = [json.loads(row["timings"]) for row in store.query("SELECT timings FROM runs")]
        warm = sum(row.get("warm_up", 0.0) for row in rows)
        busy = sum(row.get(stage, 0.0) for row in rows for stage in STAGES)
        load = sum(row.get("load", 0.0) for row in rows)
        overhead = wall - warm - busy - pool.starting
    shown = {
        "runs": len(rows),
        "runs_s": busy,
        "loading": load / busy,
        "overhead": overhead / busy,
        "per_run_ms": 1e3 * overhead / len(rows),
    }
    print(f"{planners}: {shown}", file=sys.stderr)
    return {key: round(value, 5) for key, value in shown.items()}


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main()
