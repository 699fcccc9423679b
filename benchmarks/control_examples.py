"""Every shipped problem that `taskspace` takes, with several seeds, each twice: solved, how long, and the same again?

    python benchmarks/control_examples.py --markdown examples.md                    # 4 minutes on one core
    python benchmarks/control_examples.py --problems 05_cage 16_delbot --seeds 5

The last line printed is one JSON object; exit code 1 if a problem was not solved with a seed, or not twice alike.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import sys
import time
from typing import Any

import numpy as np
from published import ROOT, print_json, print_table, table_parser, write_markdown

import optiplan as op

PLANNER = "taskspace"
HEADINGS = ("problem", "solved", "motion s", "planning s, processor", "twice alike")


def main() -> None:
    """Plan, print, write."""
    parser = table_parser(__doc__)
    parser.add_argument("--problems", nargs="+", help="only these, such as 02_shelf")
    parser.add_argument("--seeds", type=int, default=3, help="0, 1, … of each")
    parser.add_argument("--budget", type=float, default=60.0, help="seconds for each run")
    options = parser.parse_args()
    names = [f.stem for f in sorted((ROOT / "problems").glob("*.yaml")) if f.stem in (options.problems or (f.stem,))]
    rows, left = [], []
    for name in names:
        row = solve(name, options.seeds, options.budget)
        if isinstance(row, str):
            left.append(f"{name}: {row}")
            continue
        rows.append(row)
        print(cells(row), file=sys.stderr, flush=True)
    bad = [row["problem"] for row in rows if not all(row["solved"]) or not row["alike"]]
    runs = sum(len(row["solved"]) for row in rows)
    remark = f"{sum(sum(row['solved']) for row in rows)} of {runs} runs solved, of {len(rows)} problems."
    print_table(HEADINGS, [cells(row) for row in rows])
    write_markdown(options.markdown, HEADINGS, [cells(row) for row in rows], [remark])
    print_json({"bad": bad, "left_out": left, "problems": rows})
    sys.exit(int(bool(bad)))


def solve(name: str, seeds: int, budget: float) -> dict[str, Any] | str:
    """What became of one problem; a reason in words where the planner does not take it."""
    if op.load_problem(name).task:
        return "a task of several steps"
    found: dict[str, Any] = {"problem": name, "solved": [], "seconds": [], "duration": [], "alike": True}
    for seed in range(seeds):
        once = attempt(name, seed, budget, found["seconds"])
        if once.failure is not None and once.failure.kind == "unsupported":
            return once.failure.detail
        again = attempt(name, seed, budget, [])
        found["solved"].append(bool(once.verified))
        found["duration"].append(None if once.trajectory is None else once.trajectory.duration)
        found["alike"] &= same(once.trajectory, again.trajectory)
    return found


def same(a: op.Trajectory | None, b: op.Trajectory | None) -> bool:
    """Whether two motions agree to the last bit at a thousand moments."""
    if a is None or b is None:
        return a is b
    times = np.linspace(0.0, a.duration, 1000)
    return a.duration == b.duration and bool(np.array_equal(a(times), b(times)))


def attempt(name: str, seed: int, budget: float, seconds: list[float]) -> op.Run:
    """One run; adds its planning time on the processor to `seconds`."""
    problem = op.load_problem(name)
    begin = time.process_time()
    run = op.plan(problem, planner=PLANNER, budget=budget, seed=seed)
    seconds.append(time.process_time() - begin)
    return run


def cells(row: dict[str, Any]) -> list[str]:
    """One line of the table; several figures are those of the seeds."""
    durations = " / ".join("–" if d is None else f"{d:.2f}" for d in row["duration"])
    times = " / ".join(f"{s:.1f}" for s in row["seconds"])
    solved = f"{sum(row['solved'])} of {len(row['solved'])}"
    return [row["problem"], solved, durations, times, "yes" if row["alike"] else "**no**"]


if __name__ == "__main__":
    main()
