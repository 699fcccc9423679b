"""What a larger budget buys: durations after 1, 2, 5, 20 and 60 s of budget, under the table and in cages.

    python benchmarks/anytime.py --markdown anytime.md                     # about 2 hours on one core
    python benchmarks/anytime.py --part 1/2 > a.json & python benchmarks/anytime.py --part 2/2 > b.json; wait
    python benchmarks/anytime.py --merge a.json b.json --markdown anytime.md

Problems: every fifth of MotionBenchMaker's Panda sets `table_under_pick` and `cage`, from the first one on (0001, 0006,
…): ten each. The default planner's patience depends on its budget, so every budget is a run of its own: 1, 2, 5
and 20 s with seed 0, 60 s with each of the seeds. *Best known* is the shortest verified motion of the problem in any
of these runs; a problem without one is not counted. A run without a verified answer counts as infinitely long.
Also writes figures/anytime.svg and .png. Ctrl-C ends early and prints what was done. The last line printed is one JSON
object.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import json
import math
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from published import commit, import_sets, percentiles, print_json, print_table, table_parser, write_markdown
from rich.console import Console
from rich.progress import track

from optiplan.planners.base import Budget
from optiplan.problem.load import load_problem
from optiplan.runs.pipeline import run

SETS = ("table_under_pick", "cage")
EVERY = 5
BUDGETS = (1.0, 2.0, 5.0, 20.0, 60.0)
FIGURES = Path(__file__).parent / "figures"
HEADINGS = ("budget s", "runs", "verified", "over best known: median", "90 %", "worst", "planning s median")


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = table_parser(__doc__)
    parser.add_argument("--planner", default="trajopt")
    parser.add_argument("--problems", type=int, default=20, help="only so many, of both sets in turn")
    parser.add_argument("--budgets", type=float, nargs="+", default=list(BUDGETS), help="the last one with all seeds")
    parser.add_argument("--seeds", type=int, default=5, help="seeds of the largest budget")
    parser.add_argument("--part", default="1/1", help="k/n: problems k, k + n, … only, for processes side by side")
    parser.add_argument("--merge", type=Path, nargs="+", help="plan nothing; read what parts have printed")
    parser.add_argument("--figures", type=Path, default=FIGURES, help="folder of the plot")
    return parser.parse_args()


def main() -> None:
    """Plan or merge, then print."""
    options = parse()
    done = merged(options.merge) if options.merge else planned(options)
    rows = done["runs"]
    table, summary = lines(rows), summarise(rows)
    print_table(HEADINGS, table)
    count = len({row["problem"] for row in rows})
    made = f"{done['planner']}, {count} problems, largest budget with {done['seeds']} seeds."
    if not done["complete"]:
        made += " Interrupted: not all runs were made."
    if done["part"] == "1/1" and rows:
        plot(rows, options.figures / "anytime")
        made += "\n\n![Duration over the best known, by budget](figures/anytime.svg)"
    commits = done["commit"]
    if options.merge and commits != commit():
        made += f"\n\nThe runs were made by commit `{commits}`."
    write_markdown(options.markdown, HEADINGS, table, [made])
    print_json({**done, "summary": summary})


def planned(options: argparse.Namespace) -> dict[str, Any]:
    """All runs of this part, problem by problem, so that an interrupted call has whole problems."""
    k, n = map(int, options.part.split("/"))
    rows: list[dict[str, Any]] = []
    told = {"planner": options.planner, "seeds": options.seeds, "part": options.part, "commit": commit()}
    with tempfile.TemporaryDirectory() as folder:
        sets = import_sets("panda", Path(folder), EVERY)
        both = [file for files in zip(*(sets[name] for name in SETS), strict=True) for file in files]
        files = both[: options.problems][k - 1 :: n]
        largest = max(options.budgets)
        jobs = [
            (file, budget, seed)
            for file in files
            for budget in sorted(options.budgets)
            for seed in range(options.seeds if budget == largest else 1)
        ]
        try:
            run(load_problem(files[0]), options.planner, {}, Budget(1.0), lambda stage, share: None)  # pays for imports
            for job in track(jobs, "planning", console=Console(stderr=True), transient=True):
                rows.append(solve(*job, options.planner))
        except KeyboardInterrupt:
            pass
    return {**told, "complete": len(rows) == len(jobs), "runs": rows}


def solve(file: Path, budget: float, seed: int, planner: str) -> dict[str, Any]:
    """One run: duration of the verified answer and how it came, None without one."""
    done = run(load_problem(file, seed=seed), planner, {}, Budget(budget), lambda stage, share: None)
    return {
        "problem": f"{file.parent.name}/{file.stem}",
        "budget": budget,
        "seed": seed,
        "duration": done.duration if done.verified else None,
        "ratio": done.ratio if done.verified else None,
        "plan_s": round(done.timings["plan"], 4),
        "improvements": done.improvements,
    }


def merged(files: list[Path]) -> dict[str, Any]:
    """What several parts have printed, as one."""
    parts = [json.loads(file.read_text().splitlines()[-1]) for file in files]
    commits = sorted({part["commit"] for part in parts})
    if len(commits) > 1:
        raise SystemExit(f"parts of different commits: {', '.join(commits)}")
    complete = all(part["complete"] for part in parts)
    first = {key: parts[0][key] for key in ("planner", "seeds", "commit")}
    return {**first, "part": "1/1", "complete": complete, "runs": [row for part in parts for row in part["runs"]]}


def best_known(rows: list[dict[str, Any]]) -> dict[str, float]:
    """Shortest verified duration of each problem in any run, s."""
    best: dict[str, float] = {}
    for row in rows:
        if row["duration"] is not None:
            best[row["problem"]] = min(row["duration"], best.get(row["problem"], math.inf))
    return best


def excess(rows: list[dict[str, Any]]) -> dict[float, list[float]]:
    """Duration / best known of every run with seed 0, by budget; inf where nothing is verified."""
    best = best_known(rows)
    found: dict[float, list[float]] = {}
    for row in rows:
        if row["seed"] == 0 and row["problem"] in best:
            found.setdefault(row["budget"], []).append((row["duration"] or math.inf) / best[row["problem"]])
    return dict(sorted(found.items()))


def summarise(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """By budget: number of runs with seed 0, verified ones, and percentiles of duration / best known."""
    told = {}
    for budget, ratios in excess(rows).items():
        own = [row for row in rows if row["seed"] == 0 and row["budget"] == budget]
        told[f"{budget:g}"] = {
            "runs": len(own),
            "verified": sum(row["duration"] is not None for row in own),
            "over_best": {str(p): round(percentiles(ratios, p)[0], 4) for p in (50, 90, 100)},
            "plan_s": round(percentiles((row["plan_s"] for row in own), 50)[0], 3),
        }
    return told


def lines(rows: list[dict[str, Any]]) -> list[list[str]]:
    """One line a budget, in the order of `HEADINGS`."""
    return [
        [
            budget,
            str(s["runs"]),
            str(s["verified"]),
            *(f"{100 * (s['over_best'][p] - 1):+.1f} %" for p in ("50", "90", "100")),
            f"{s['plan_s']:.2f}",
        ]
        for budget, s in summarise(rows).items()
    ]


def plot(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw duration over the best known against the budget: a thin line a problem, and the median."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
    for name, line in by_problem(rows):
        axes.plot(*zip(*line, strict=True), color="C0" if name.startswith("cage") else "C1", lw=0.6, alpha=0.6)
    median = [
        (float(b), s["over_best"]["50"]) for b, s in summarise(rows).items() if math.isfinite(s["over_best"]["50"])
    ]
    axes.plot(*zip(*median, strict=True), color="k", lw=2, marker="o", label="median")
    for color, name in (("C0", "cage"), ("C1", "table_under_pick")):
        axes.plot([], [], color=color, lw=0.8, label=name)
    axes.set(xscale="log", xlabel="budget, s", ylabel="duration / best known")
    axes.set_xticks([b for b in excess(rows)], [f"{b:g}" for b in excess(rows)])
    axes.minorticks_off()
    axes.grid(alpha=0.3)
    axes.legend()
    path.parent.mkdir(exist_ok=True)
    for suffix in (".svg", ".png"):
        figure.savefig(path.with_suffix(suffix), dpi=150)


def by_problem(rows: list[dict[str, Any]]) -> Iterator[tuple[str, list[tuple[float, float]]]]:
    """(budget, duration / best known) of seed 0 in order, for each problem, verified runs alone."""
    best = best_known(rows)
    for name in best:
        own = [row for row in rows if row["problem"] == name and row["seed"] == 0 and row["duration"] is not None]
        if own:
            yield name, sorted((row["budget"], row["duration"] / best[name]) for row in own)


if __name__ == "__main__":
    main()
