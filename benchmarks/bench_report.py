"""Measure how long a report of 100,000 runs takes.

    python benchmarks/bench_report.py [--runs 100000] [--keep DIR]

The results of 20 planners, five seeds and enough problems are random numbers. They are stored one by one, as a suite
does, and reported as page, figures and Markdown. The last line
printed is one JSON object; times in s.
"""

import argparse
import json
import tempfile
import time
from pathlib import Path

import numpy as np

from optiplan.bench.execution.machine import machine
from optiplan.bench.report.analysis import analyse
from optiplan.bench.report.figures import write_figures
from optiplan.bench.report.page import write_page
from optiplan.bench.report.tables.formats import markdown
from optiplan.bench.results.database import Store
from optiplan.bench.results.records import BenchPlanner, BenchProblem, Outcome, Row
from optiplan.runs.run import versions

PLANNERS, SEEDS = 20, 5
PROBLEM = {
    "version": 1,
    "robot": "planar2r",
    "start": {"joints": [0.5, 1.0]},
    "goal": {"joints": [-0.5, 1.2]},
    "scene": {"obstacles": [{"name": "ball", "shape": {"sphere": 0.1}, "pose": {"position": [-1, 0.18, 1]}}]},
}
FAILURES = (("budget", "no path within {} s"), ("collision", "the motion is not free: 'arm' meets 'ball' at {} s"))


def main() -> None:
    """Make the store, report, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--runs", type=int, default=100_000)
    parser.add_argument("--keep", type=Path)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = arguments.keep or Path(scratch)
        began = time.perf_counter()
        make(folder, -(-arguments.runs // (PLANNERS * SEEDS)))
        print(json.dumps({"stored": time.perf_counter() - began} | report(folder)))


def make(folder: Path, count: int) -> None:
    """Results of a suite that never ran, of so many problems."""
    rng = np.random.default_rng(0)
    planners = tuple(BenchPlanner(f"planner-{k:02d}", "quintic", {}) for k in range(PLANNERS))
    problems = tuple(
        BenchProblem(f"set{k % 7}/{k:04d}", f"set{k % 7}", ("easy", "hard")[k % 2], f"{k:064x}", PROBLEM, {})
        for k in range(count)
    )
    skill, speed = rng.uniform(0.3, 1.3, PLANNERS), rng.lognormal(-1.0, 1.0, PLANNERS)
    parts = {"seeds": list(range(SEEDS)), "repetitions": 1, "budget": 5.0}
    parts |= {"planners": {one.label: [] for one in planners}, "problems": {one.id: [] for one in problems}}
    meta = {"name": "made-up", "suite": "# drawn at random\n", "suite_hash": "0" * 64, "parts": parts}
    with Store.create(folder, meta) as store:
        store.fill(problems, planners)
        store.begin("made up", machine(), versions())
        for k, problem in enumerate(problems):
            hardness = rng.uniform(0.0, 1.0) + 0.2 * (k % 2)
            for p, planner in enumerate(planners):
                for seed in range(SEEDS):
                    good = rng.normal(skill[p] - hardness, 0.2) > 0.0
                    row = {"problem": problem.id, "planner": planner.label, "seed": seed, "repetition": 0}
                    row |= {"set_name": problem.set_name, "difficulty": problem.difficulty}
                    store.add(Outcome(Row(**row, **made_up(rng, bool(good), speed[p]))))
        store.end("complete")


def made_up(rng: np.random.Generator, good: bool, speed: float) -> dict:
    """The columns that a run fills."""
    time_ = float(speed * rng.lognormal(0.0, 0.7))
    if not good:
        kind, words = FAILURES[rng.integers(2)]
        failure = {"failure_kind": kind, "failure_detail": words.format(round(time_, 3)), "witness": {"q": [0.1, 0.2]}}
        return {"plan_time": time_, **failure}
    ratio = float(1.0 + rng.lognormal(-1.5, 0.8))
    numbers = {"plan_time": time_, "plan_cpu": 0.9 * time_, "verify_time": 0.1}
    numbers |= {"duration": 2.0 * ratio, "lower_bound": 2.0, "goal_bound": 2.0}
    return {"planned": True, "timed": True, "verified": True, **numbers}


def report(folder: Path) -> dict:
    """Seconds by part of a report."""
    stamps = {"": time.perf_counter()}
    with Store(folder) as store:
        runs = store.query("SELECT count(*) FROM runs")[0][0]
        analysis = analyse(store)
        stamps["analysis"] = time.perf_counter()
        page = write_page(store, analysis, folder / "report.html")
        stamps["page"] = time.perf_counter()
        write_figures(analysis, folder / "figures")
        stamps["figures"] = time.perf_counter()
        (folder / "report.md").write_text(markdown(analysis), encoding="utf-8")
        stamps["markdown"] = time.perf_counter()
    times = list(stamps.values())
    parts = {name: after - before for name, before, after in zip(list(stamps)[1:], times, times[1:], strict=False)}
    return {"runs": runs, **parts, "report": times[-1] - times[0], "page_bytes": page.stat().st_size}


if __name__ == "__main__":
    main()
