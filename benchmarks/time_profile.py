"""Where the time of a plan goes: the stages of loading, planning, proof and metrics, as a picture.

    python benchmarks/time_profile.py --every 10 --picture docs/pictures/profile.svg

One bar a problem of MotionBenchMaker, sorted, seconds of one core; loading is that of a known robot. The last line
printed is one JSON object with the medians of all stages.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

from mbm import silent, warm_up
from published import commit, import_sets, print_json

from optiplan.errors import InputError
from optiplan.planners.base import Budget
from optiplan.problem.load import load_problem
from optiplan.runs.pipeline import run


def main() -> None:
    """Plan, draw, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", choices=("panda", "ur5", "fetch"), default="panda")
    parser.add_argument("--every", type=int, default=10)
    parser.add_argument("--budget", type=float, default=20.0)
    parser.add_argument("--picture", type=Path, help="draw the stages into this file")
    arguments = parser.parse_args()
    arguments.planner = "trajopt"
    rows: list[dict[str, float]] = []
    with tempfile.TemporaryDirectory() as folder:
        files = [f for group in import_sets(arguments.robot, Path(folder), arguments.every).values() for f in group]
        warm_up(files, arguments)
        for file in files:
            began = time.perf_counter()
            try:
                problem = load_problem(file)
            except InputError:
                continue
            loaded = time.perf_counter() - began
            done = run(problem, "trajopt", {}, Budget(arguments.budget), silent)
            parts = dict(done.stages)
            rest = max(done.timings["plan"] - sum(parts.values()), 0.0)
            ends = {"proof": done.timings.get("verify", 0.0), "other proofs": done.timings.get("other proofs", 0.0)}
            ends["metrics"] = done.timings.get("measure", 0.0)
            rows.append({"load": loaded, **parts, "rest of planning": rest, **ends})
    if arguments.picture is not None:
        draw(rows, arguments.picture)
    names = list(dict.fromkeys(name for row in rows for name in row))
    medians = {name: round(statistics.median(row.get(name, 0.0) for row in rows), 5) for name in names}
    print_json({"commit": commit(), "robot": arguments.robot, "problems": len(rows), "median_s": medians})


def draw(rows: list[dict[str, float]], path: Path) -> None:
    """A stacked bar a problem, the quickest first."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    rows = sorted(rows, key=lambda row: sum(row.values()))
    last = ("rest of planning", "proof", "other proofs", "metrics")
    names = [name for name in dict.fromkeys(name for row in rows for name in row) if name not in last] + [*last]
    figure = Figure(figsize=(8.0, 4.0), layout="constrained")
    ax: Any = figure.subplots()
    base = [0.0] * len(rows)
    for k, name in enumerate(names):
        heights = [row.get(name, 0.0) for row in rows]
        ax.bar(range(len(rows)), heights, bottom=base, width=1.0, color=colormaps["tab20"](k), label=name)
        base = [low + height for low, height in zip(base, heights, strict=True)]
    ax.set(xlabel="problems, the quickest first", ylabel="s", xlim=(-0.5, len(rows) - 0.5))
    top = 1.05 * sorted(base)[int(0.85 * (len(base) - 1))]  # the slowest are cut off, and say how long they are
    ax.set_ylim(0.0, top)
    for k, total in enumerate(base):
        if total > top:
            ax.text(k, 0.97 * top, f"{total:.1f} s", rotation=90, ha="center", va="top", fontsize="small")
    ax.legend(fontsize="small", ncols=2)
    figure.savefig(path)


if __name__ == "__main__":
    main()
