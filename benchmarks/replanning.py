"""Measure the planning time after a change of 5 cm, with and without the earlier run.

    python benchmarks/replanning.py --markdown replanning.md                 # about ten minutes on one core

Problems: every k-th of MotionBenchMaker's seven Panda sets. Each is planned, then changed in four ways: the obstacle
nearest to the motion moves by 5 cm in a random direction; the goal's pose does; the start changes so that the tool is
5 cm away; and the robot is on its way (at 30 % of the motion) when that obstacle moves. The changed problem is planned
anew and with `warm_start`, which takes `Problem.with_…`, planning, proof and metrics each time. Changes that make the
problem bad input (a start or goal in collision) are drawn again, up to ten times. Shares are of the time of the plan
anew in the same run; *on the way* also shows the largest step of the acceleration at the start, as a share of its
limit. *Planning alone* leaves out the change, proof and metrics. The last line printed is JSON.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from published import commit, import_sets, percentiles, print_json, print_table, table_parser, write_markdown
from rich.console import Console
from rich.progress import track

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.robot.frames import geometric_jacobian

BY, ON_THE_WAY, DRAWS = 0.05, 0.3, 10
HEADINGS = (
    "change of 5 cm",
    "problems",
    "verified anew",
    "verified warm",
    "time warm / anew: median",
    "90 %",
    "planning alone: median",
    "time anew, s, median",
    "duration warm / anew: median",
    "90 %",
    "step at the start",
)


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = table_parser(__doc__)
    parser.add_argument("--every", type=int, default=10, help="every k-th problem of each set")
    parser.add_argument("--problems", type=int, default=1000, help="only so many")
    parser.add_argument("--budget", type=float, default=20.0, help="seconds of each plan")
    return parser.parse_args()


def main() -> None:
    """Plan, change, plan twice, print."""
    options = parse()
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        sets = import_sets("panda", Path(folder), options.every)
        files = [file for files in zip(*sets.values(), strict=False) for file in files][: options.problems]
        op.plan(op.load_problem(files[0]), budget=1.0)  # pays for imports
        try:
            for file in track(files, "replanning", console=Console(stderr=True), transient=True):
                problem = op.load_problem(file).with_parts(clearance=0)
                rows += solve(problem, f"{file.parent.name}/{file.stem}", options.budget)
        except KeyboardInterrupt:
            pass
    table = [line(kind, [row for row in rows if row["change"] == kind]) for kind in CHANGES]
    table.append(line("all", rows))
    print_table(HEADINGS, table)
    remark = f"{len({row['problem'] for row in rows})} problems, budget {options.budget:g} s each."
    write_markdown(options.markdown, HEADINGS, table, [remark])
    print_json({"commit": commit(), "runs": rows})


def solve(problem: op.Problem, name: str, budget: float) -> list[dict[str, Any]]:
    """All changes of one problem."""
    rng = np.random.default_rng(int.from_bytes(name.encode()[-8:], "little"))
    first = op.plan(problem, budget=budget)
    rows = []
    for kind, change in CHANGES.items() if first.verified else ():
        parts = drawn(problem, first, change, rng)
        if parts is not None:
            rows.append({"problem": name, "change": kind, **compared(problem, first, parts, budget)})
    return rows


Parts = dict[str, Any]


def drawn(problem: op.Problem, first: op.Run, change: Callable[..., Parts], rng: np.random.Generator) -> Parts | None:
    """Parts of a changed problem that is no bad input."""
    for _ in range(DRAWS):
        direction = rng.standard_normal(3)
        parts = change(problem, first, BY * direction / np.linalg.norm(direction))
        try:
            problem.with_parts(**parts)
        except op.InputError:
            continue
        return parts
    return None


def compared(problem: op.Problem, first: op.Run, parts: Parts, budget: float) -> dict[str, Any]:
    """The changed problem planned anew, and from the first run."""
    found = {}
    for way, earlier in (("anew", None), ("warm", first)):
        began = time.perf_counter()
        run = op.plan(problem.with_parts(**parts), budget=budget, warm_start=earlier)
        seconds = time.perf_counter() - began
        found |= {f"{way}_s": seconds, f"{way}_duration": run.duration if run.verified else None}
        found[f"{way}_plan_s"] = run.timings["plan"]
    return found | {"step": step(run)}


def step(run: op.Run) -> float | None:
    """Largest step of the acceleration at the start, as a share of its limit."""
    if run.trajectory is None:
        return None
    jump = np.abs(run.trajectory(0.0, 2) - run.problem.start_acceleration)
    return float((jump / run.problem.limits.acceleration).max())


def scene(problem: op.Problem, first: op.Run, by: np.ndarray) -> Parts:
    """The obstacle nearest to the motion, moved."""
    model = CollisionModel(problem.robot, problem.scene)
    obstacles = {body.name for body in problem.scene.obstacles}
    t = np.linspace(0.0, first.duration or 0.0, 100)
    found = model.near(first.trajectory(t), 0.3)
    for k in np.argsort(found.distance):
        pair = model.pairs[found.pairs[k]]
        near = obstacles & {pair.name_a, pair.name_b}
        if near:
            return {"scene": problem.scene.moved(near.pop(), *by)}
    return {"scene": problem.scene.moved(problem.scene.obstacles[0].name, *by)}


def goal(problem: op.Problem, first: op.Run, by: np.ndarray) -> Parts:
    """The goal's pose, moved; of a goal of joints the configuration that moves the tool by as much."""
    end = problem.goal[0]
    if isinstance(end, op.PoseGoal):
        pose = end.X_WG.copy()
        pose.translation = pose.translation + by
        return {"goal": op.PoseGoal(end.frame, pose, end.position, end.orientation)}
    return {"goal": end.q + away(problem, end.q, by)}


def start(problem: op.Problem, first: op.Run, by: np.ndarray) -> Parts:
    """The start, from which the tool is moved."""
    return {"start": problem.start + away(problem, problem.start, by)}


def on_the_way(problem: op.Problem, first: op.Run, by: np.ndarray) -> Parts:
    """The state of the running motion, and the scene."""
    state = first.trajectory.state(ON_THE_WAY * first.trajectory.duration)
    return {"start": state, **scene(problem, first, by)}


def away(problem: op.Problem, q: np.ndarray, by: np.ndarray) -> np.ndarray:
    """The least change of the joints that moves the tool so, to first order."""
    J = geometric_jacobian(problem.robot, q, problem.robot.tool_frame)
    return np.linalg.pinv(J[:3]) @ by


CHANGES = {"scene": scene, "goal": goal, "start": start, "on the way": on_the_way}


def line(kind: str, rows: list[dict[str, Any]]) -> list[str]:
    """One row of the table; shares over problems that both ways verify."""
    both = [row for row in rows if row["anew_duration"] and row["warm_duration"]]
    time_share = percentiles([row["warm_s"] / row["anew_s"] for row in both], 50, 90)
    longer = percentiles([row["warm_duration"] / row["anew_duration"] for row in both], 50, 90)
    steps = [row["step"] for row in both if row["change"] == "on the way"]
    return [
        kind,
        f"{len(rows)}",
        *(f"{sum(row[key] is not None for row in rows)}" for key in ("anew_duration", "warm_duration")),
        *(f"{100 * share:.0f} %" for share in time_share),
        f"{100 * percentiles([row['warm_plan_s'] / row['anew_plan_s'] for row in both], 50)[0]:.0f} %",
        f"{percentiles([row['anew_s'] for row in both], 50)[0]:.2f}",
        *(f"{ratio:.3f}" for ratio in longer),
        f"{max(steps):.0e}" if steps else "",
    ]


if __name__ == "__main__":
    main()
