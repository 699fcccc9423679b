"""Every shipped problem with every planner: is `trajopt` at least as short as each of the others?

    python benchmarks/examples.py --markdown examples.md                # about 45 minutes on one core
    python benchmarks/examples.py --problems 02_shelf 12_planar --planners trajopt rrtconnect --budget 5

All planners of the registry with their defaults, budget 20 s a run, the seed of the problem file. What a planner cannot
do (no vias, no pose goals, …) is not held against it. *Kept* says that `trajopt` is verified, and no other verified
motion is shorter by more than 0.5 %; where nobody has a verified motion there is nothing to keep. Problems with another
objective than time are compared by duration all the same, and marked with a star. Ctrl-C ends early and prints what was
done. The last line printed is one JSON object; exit code 1 if `trajopt` is beaten.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import sys
from pathlib import Path
from typing import Any

from published import ROOT, commit, print_json, print_table, table_parser, write_markdown
from rich.console import Console
from rich.progress import track

from optiplan.planners.base import Budget
from optiplan.planners.registry import PLANNERS
from optiplan.problem.load import load_problem
from optiplan.runs.pipeline import plan_and_verify_once
from optiplan.runs.run import Run

OURS, ROUNDING = "trajopt", 1.005
HEADINGS = ("problem", "trajopt s", "planning s", "shortest other", "its s", "trajopt / it", "others verified", "kept")


def main() -> None:
    """Plan, compare, print."""
    parser = table_parser(__doc__)
    parser.add_argument("--problems", nargs="+", help="only these, such as 02_shelf")
    parser.add_argument("--planners", nargs="+", choices=list(PLANNERS), default=list(PLANNERS))
    parser.add_argument("--budget", type=float, default=20.0, help="seconds for each run")
    parser.add_argument("--part", default="1/1", help="k/n: problems k, k + n, … only, for processes side by side")
    options = parser.parse_args()
    planners = [OURS, *(name for name in options.planners if name != OURS)]
    k, n = map(int, options.part.split("/"))
    if unknown := set(options.problems or ()) - {file.stem for file in (ROOT / "problems").glob("*.yaml")}:
        parser.error(f"--problems: {', '.join(sorted(unknown))}; expected names of files in problems/")
    files = [f for f in sorted((ROOT / "problems").glob("*.yaml")) if f.stem in (options.problems or (f.stem,))]
    jobs = [(file, planner) for file in files[k - 1 :: n] for planner in planners]
    rows: list[dict[str, Any]] = []
    try:
        plan_and_verify_once(
            load_problem(files[0]), OURS, {}, Budget(1.0), lambda stage, share: None
        )  # pays for imports
        for file, planner in track(jobs, "planning", console=Console(stderr=True), transient=True):
            rows.append(solve(file, planner, options.budget))
    except KeyboardInterrupt:
        pass
    compared = compare(rows)
    table = [cells(row) for row in compared]
    beaten = [row["problem"] for row in compared if row["kept"] is False]
    remark = f"{len(compared) - len(beaten)} of {len(compared)} kept; budget {options.budget:g} s, {len(rows)} runs."
    if len(rows) < len(jobs):
        remark += f" Interrupted: {len(jobs)} runs were asked for."
    print_table(HEADINGS, table)
    Console(stderr=True).print(remark)
    write_markdown(options.markdown, HEADINGS, table, [remark])
    told = {"budget": options.budget, "commit": commit(), "complete": len(rows) == len(jobs), "beaten": beaten}
    print_json({**told, "problems": compared, "runs": rows})
    sys.exit(int(bool(beaten)))


def solve(file: Path, planner: str, budget: float) -> dict[str, Any]:
    """One run: verdict, duration in s, time of planning in s."""
    problem = load_problem(file)
    done: Run = plan_and_verify_once(problem, planner, {}, Budget(budget), lambda stage, share: None)
    return {
        "problem": file.stem,
        "objective": sorted(name for name, weight in vars(problem.objective).items() if weight and name != "time"),
        "planner": planner,
        "verified": done.verified,
        "duration": done.duration,
        "ratio": done.ratio,
        "plan_s": round(done.timings["plan"], 4),
        "failure": done.failure and done.failure.kind,
    }


def compare(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """For each problem that `trajopt` was run on: its duration beside the shortest verified one of the others."""
    told = []
    for name in dict.fromkeys(row["problem"] for row in rows):
        own = next(row for row in rows if row["problem"] == name and row["planner"] == OURS)
        others = [row for row in rows if row["problem"] == name and row["verified"] and row["planner"] != OURS]
        best = min(others, key=lambda row: row["duration"], default=None)
        mine = own["duration"] if own["verified"] else None
        kept = mine is not None and (best is None or mine <= ROUNDING * best["duration"])
        told.append(
            {
                "problem": name + ("*" if own["objective"] else ""),
                "trajopt": mine,
                "plan_s": own["plan_s"],
                "failure": own["failure"],
                "other": best and best["planner"],
                "duration": best and best["duration"],
                "others_verified": len(others),
                "kept": None if mine is None and best is None else kept,
            }
        )
    return told


def cells(row: dict[str, Any]) -> list[str]:
    """One line of the table, in the order of `HEADINGS`."""
    mine, best = row["trajopt"], row["duration"]
    share = f"{mine / best:.4f}" if mine is not None and best else "–"
    return [
        row["problem"],
        f"{mine:.4f}" if mine is not None else f"none: {row['failure'] or 'refused'}",
        f"{row['plan_s']:.2f}",
        row["other"] or "–",
        f"{best:.4f}" if best is not None else "–",
        share,
        str(row["others_verified"]),
        {True: "yes", False: "**no**", None: "–"}[row["kept"]],
    ]


if __name__ == "__main__":
    main()
