"""Compare seeds on pose goals: does every seed find the shortest motion, to whichever of the goal's ends?

    python benchmarks/pose_goals.py --markdown pose-goals.md        # 40 goals x 4 seeds, about 10 minutes on one core
    python benchmarks/pose_goals.py --robots ur5 --every 50 --seeds 8
    python benchmarks/pose_goals.py --results runs.jsonl --resume   # goes on where an interrupted call ended

Problems: the index 0, k, 2 k, … (`--every`) of each set of MotionBenchMaker for Panda (seven joints), UR5 (six) and
Fetch (eight), in turn of robots and sets, until there are `--count`. The goal is the pose that the tool has at the
problem's goal configuration, with the tolerances of every pose (0.1 mm, 1 mrad): the planner chooses the configuration.
Each problem is planned with every seed within the program's budget. Listed of each, once it
is planned with all of them: the shortest verified motion of all seeds, and what each seed takes over it; – where a seed
has no verified motion. *Within 2 %* is the share of problems in which all seeds are, and *runs* that of all runs.
Figures are of motions, so that a busy machine changes them little; *cpu* is processor time of planning. Every run is
written to `--results` as soon as it is made, a line of JSON each; Ctrl-C ends early and prints what was done. The last
line printed is one JSON object; exit code 1 below `--share`.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator
from itertools import zip_longest
from pathlib import Path
from typing import Any

from published import commit, import_sets, percentiles, print_json, print_table, table_parser, write_markdown
from rich.console import Console
from rich.progress import track

import optiplan as op
from optiplan.errors import InputError
from optiplan.planners.base import Budget
from optiplan.robot.frames import frame_pose
from optiplan.runs.pipeline import run

ROBOTS = ("panda", "ur5", "fetch")
WITHIN = 1.02
"""Of the best of all seeds."""


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = table_parser(__doc__)
    parser.add_argument("--robots", nargs="+", choices=ROBOTS, default=list(ROBOTS))
    parser.add_argument("--count", type=int, default=40, help="goals, at most")
    parser.add_argument("--every", type=int, default=25, help="only every so many problems of each set")
    parser.add_argument("--offset", type=int, default=0, help="index of the first of them")
    parser.add_argument("--seeds", type=int, default=4, help="seeds 0, 1, … of each goal")
    parser.add_argument("--budget", type=float, default=20.0, help="s, of each run; the program's own")
    parser.add_argument("--share", type=float, default=0.95, help="of goals whose seeds are all to be within 2 %%")
    parser.add_argument("--results", type=Path, help="file that gets every run at once, a line of JSON each")
    parser.add_argument("--resume", action="store_true", help="leave out what that file has already")
    return parser.parse_args()


def main() -> int:
    """Plan, print; return the exit code."""
    arguments = parse()
    rows = recorded(arguments)
    with tempfile.TemporaryDirectory() as folder:
        files = in_turn(arguments, Path(folder))
        known = {(row["problem"], row["seed"]) for row in rows}
        try:
            for file in track(files, "planning", console=Console(stderr=True)):
                if len({row["problem"] for row in rows} | {name_of(file)}) > arguments.count:
                    break
                for row in solved(file, arguments, known):
                    rows.append(row)
                    append(arguments.results, row)
        except KeyboardInterrupt:
            pass
    whole = complete(rows, arguments.seeds)
    table = list(lines(whole))
    headings = ("problem", "best s", *(f"seed {seed}" for seed in range(arguments.seeds)), "cpu s 50", "within 2 %")
    figures = summary(whole)
    print_table(headings, table)
    form = "{within} of {problems} goals have every seed within 2 % of the best ({share:.1%}); of all runs {runs:.1%}."
    remark = form.format(**figures)
    print(remark, file=sys.stderr)
    write_markdown(arguments.markdown, headings, table, [remark])
    print_json({"budget": arguments.budget, "commit": commit(), **figures, "rows": rows})
    return int(not figures["share"] >= arguments.share)


def recorded(arguments: argparse.Namespace) -> list[dict[str, Any]]:
    """Return the runs that the results file has, with `--resume`; empty the file without it."""
    file: Path | None = arguments.results
    if arguments.resume and file is not None and file.exists():
        text = file.read_text()
        whole = text[: text.rfind("\n") + 1]  # a kill may have cut the last line
        file.write_text(whole)
        rows: list[dict[str, Any]] = [json.loads(line) for line in whole.splitlines()]
        budgets = {row.get("budget", "unknown") for row in rows} - {arguments.budget}
        if budgets:
            sys.exit(f"{file}: runs with --budget {budgets.pop()}; expected {arguments.budget:g}, or another file")
        return rows
    if file is not None:
        file.write_text("")
    return []


def append(file: Path | None, row: dict[str, Any]) -> None:
    """Write a run at the end of the results file."""
    if file is not None:
        with file.open("a") as stream:
            stream.write(json.dumps(row) + "\n")


def in_turn(arguments: argparse.Namespace, folder: Path) -> list[Path]:
    """Return problem files: the first of every robot and set, then the second, and so on."""
    groups: list[list[Path]] = []
    for robot in arguments.robots:
        groups += import_sets(robot, folder / robot, arguments.every, arguments.offset).values()
    return [file for files in zip_longest(*groups) for file in files if file is not None]


def name_of(file: Path) -> str:
    """Return robot, set and number."""
    return "/".join((*file.parts[-3:-1], file.stem))


def solved(file: Path, arguments: argparse.Namespace, known: set[tuple[str, int]]) -> Iterator[dict[str, Any]]:
    """Plan one problem with each seed that is not known; nothing where its start or goal is in collision."""
    seeds = [seed for seed in range(arguments.seeds) if (name_of(file), seed) not in known]
    try:
        problem = pose_problem(file)
    except InputError:
        return
    for seed in seeds:
        done = run(problem.with_seed(seed), "trajopt", {}, Budget(arguments.budget), lambda stage, share: None)
        yield {
            "problem": name_of(file),
            "seed": seed,
            "budget": arguments.budget,
            "duration": done.duration if done.verified else None,
            "lower_bound": done.lower_bound,
            "cpu": done.plan_cpu,
            "first": done.improvements[0] if done.improvements else None,
            "failure": None if done.failure is None else done.failure.kind,
        }


def pose_problem(file: Path) -> op.Problem:
    """Return the problem with its tool's pose at the goal as the goal."""
    problem = op.load_problem(file)
    robot, goal = problem.robot, problem.goal[0]
    assert isinstance(goal, op.JointGoal), "MotionBenchMaker states configurations"
    X = frame_pose(robot, goal.q, robot.tool_frame)
    return problem.with_goal(op.PoseGoal(robot.tool_frame, X))


def grouped(rows: list[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Return the runs of each problem, by seed."""
    names = dict.fromkeys(row["problem"] for row in rows)
    groups = {name: [row for row in rows if row["problem"] == name] for name in names}
    return {name: sorted(group, key=lambda row: int(row["seed"])) for name, group in groups.items()}


def complete(rows: list[dict[str, Any]], seeds: int) -> list[dict[str, Any]]:
    """Return the runs of the problems of which every seed is there; the best of some is not the best of all."""
    wanted = set(range(seeds))
    whole = {name for name, group in grouped(rows).items() if wanted <= {row["seed"] for row in group}}
    return [row for row in rows if row["problem"] in whole and row["seed"] in wanted]


def ratios(group: list[dict[str, Any]]) -> list[float]:
    """Return the duration of each run over the shortest, infinite where there is none."""
    durations = [float("inf") if row["duration"] is None else row["duration"] for row in group]
    best = min(durations)
    return [duration / best if best < float("inf") else float("inf") for duration in durations]


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the shares of problems and runs within 2 % of the best of all seeds, and processor times."""
    over = [ratios(group) for group in grouped(rows).values()]
    within = sum(max(some) <= WITHIN for some in over)
    good = [ratio <= WITHIN for some in over for ratio in some]
    cpu = percentiles((row["cpu"] for row in rows), 50, 95)
    first = percentiles((row["first"][0] if row["first"] else None for row in rows), 50, 95)
    return {
        "problems": len(over),
        "within": within,
        "share": within / max(len(over), 1),
        "runs": sum(good) / max(len(good), 1),
        "cpu": cpu,
        "first": first,
    }


def lines(rows: list[dict[str, Any]]) -> Iterator[list[str]]:
    """Yield the lines of the table, one a problem."""
    for name, group in grouped(rows).items():
        over = ratios(group)
        best = min((row["duration"] for row in group if row["duration"] is not None), default=None)
        cells = [f"{ratio:.3f}" if ratio < float("inf") else "–" for ratio in over]
        (cpu,) = percentiles((row["cpu"] for row in group), 50)
        told = "yes" if max(over) <= WITHIN else "no"
        yield [name, "–" if best is None else f"{best:.3f}", *cells, f"{cpu:.2f}", told]


if __name__ == "__main__":
    sys.exit(main())
