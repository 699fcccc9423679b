"""MotionBenchMaker with one planner: verified share, planning time, duration over lower bound.

    python benchmarks/mbm.py --planner trajopt                 # 350 Panda problems, about 10 minutes on one core
    python benchmarks/mbm.py --planner rrtconnect --sets box cage --count 10

Problems are read from `$OPTIPLAN_SHARED/mbm/<robot>` (by default `../shared` beside the checkout). Each result is
judged twice: *verified* is the verifier's word; *confirmed* is a second look that shares nothing with it but the robot
files: the robot's triangle meshes as they are, not hulls, against the obstacles, by plain collision queries at joint
steps of at most 0.01 rad. The last line printed is one JSON object.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import json
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from optiplan.errors import InputError
from optiplan.model.collision import CollisionModel
from optiplan.model.robot import Robot, load_robot
from optiplan.pipeline import run
from optiplan.planners.base import Budget
from optiplan.problem.load import load_problem
from optiplan.problem.mbm import import_mbm
from optiplan.problem.problem import Problem
from optiplan.trajectory.trajectory import Trajectory

SHARED = Path(os.environ.get("OPTIPLAN_SHARED", Path(__file__).parents[2] / "shared"))
UNPLANNED: dict[str, Any] = {
    **dict.fromkeys(("planned", "verified", "confirmed"), False),
    **dict.fromkeys(("plan_s", "verify_s"), 0.0),
    **dict.fromkeys(("duration", "ratio"), None),
    "refused": [],
}
STEP = 0.01  # rad, largest joint step of the second look


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="panda", help="panda (default) or ur5")
    parser.add_argument("--planner", default="trajopt")
    parser.add_argument("--sets", nargs="*", help="only these sets, such as box cage")
    parser.add_argument("--count", type=int, help="only the first COUNT problems of each set")
    parser.add_argument("--budget", type=float, default=20.0, help="seconds for each problem")
    parser.add_argument("--seed", type=int, default=0)
    return parser.parse_args()


def main() -> None:
    """Import, plan, print."""
    arguments = parse()
    source = SHARED / "robots" / f"mbm_{arguments.robot}" / "robot.yaml"
    with tempfile.TemporaryDirectory() as folder:
        written = import_mbm(SHARED / "mbm" / arguments.robot, folder, str(source)).written
        sets: dict[str, list[Path]] = defaultdict(list)
        for file in sorted(written):
            sets[file.parent.name].append(file)
        files = [
            f for name, group in sets.items() if name in (arguments.sets or sets) for f in group[: arguments.count]
        ]
        meshes = mesh_robot(source, Path(folder))
        solve(files[0], arguments, meshes)  # pays for imports; not counted
        console = Console(stderr=True)
        rows = [solve(file, arguments, meshes) for file in track(files, "planning", console=console, transient=True)]
    print_tables(rows)
    print(json.dumps({"planner": arguments.planner, "robot": arguments.robot, **summary(rows), "runs": rows}))


def solve(file: Path, arguments: argparse.Namespace, meshes: Robot) -> dict[str, Any]:
    """One problem planned, verified and looked at a second time."""
    row: dict[str, Any] = {"set": file.parent.name, "problem": file.stem}
    try:
        problem = load_problem(file, seed=arguments.seed)
    except InputError as error:  # a start or a goal that touches something under this robot's geometry
        return {**row, **UNPLANNED, "failure": f"bad input: {error.issues[0].found}"}
    done = run(problem, arguments.planner, {}, Budget(arguments.budget), lambda stage, fraction: None)
    return {
        **row,
        "planned": done.trajectory is not None,
        "verified": done.verified,
        "confirmed": done.trajectory is not None and confirmed(problem, done.trajectory, meshes),
        "plan_s": round(done.timings["plan"], 4),
        "verify_s": round(done.timings.get("verify", 0.0), 4),
        "duration": done.duration,
        "ratio": done.ratio,
        "failure": None if done.failure is None else f"{done.failure.kind}: {done.failure.detail}",
        "refused": [check.name for check in done.report.checks if not check.passed] if done.report else [],
    }


def mesh_robot(source: Path, folder: Path) -> Robot:
    """The same robot with its triangle meshes as they are."""
    text = source.read_text().replace("collision:", "collision: mesh #")
    for key in ("urdf", "srdf"):
        text = text.replace(f"{key}: ", f"{key}: {source.parent}/")
    (folder / "mesh_robot.yaml").write_text(text)
    return load_robot(str(folder / "mesh_robot.yaml"))


def confirmed(problem: Problem, trajectory: Trajectory, meshes: Robot) -> bool:
    """Free of mesh collision at small steps, inside all limits there, from the start to the goal."""
    peak = np.abs(np.array(trajectory.extrema(1))).max()
    t = np.linspace(0.0, trajectory.duration, int(np.ceil(trajectory.duration * peak / STEP)) + 1)
    Q, limits, slack = trajectory(t), problem.limits, 1.0 + 1e-6
    model = CollisionModel(meshes, problem.scene)
    bounds = (limits.velocity, limits.acceleration, limits.jerk)
    return (
        not any(model.collides(q) for q in Q)
        and bool((Q >= limits.lower - 1e-9).all() and (Q <= limits.upper + 1e-9).all())
        and all((np.abs(trajectory(t, k + 1)) <= bound * slack).all() for k, bound in enumerate(bounds))
        and float(np.abs(Q[0] - problem.start).max()) < 1e-6
        and any(float(np.abs(Q[-1] - goal.q).max()) < 1e-6 for goal in problem.goal if hasattr(goal, "q"))
    )


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Shares of all problems; times of all; ratios of the verified ones."""
    times = np.array([row["plan_s"] for row in rows if row["plan_s"]] or [np.nan])
    proofs = np.array([row["verify_s"] for row in rows if row["verify_s"]] or [np.nan])
    ratios = np.array([row["ratio"] for row in rows if row["verified"] and row["ratio"] is not None] or [np.nan])
    return {
        "problems": len(rows),
        **{key: round(float(np.mean([row[key] for row in rows])), 4) for key in ("planned", "verified", "confirmed")},
        "plan_s": {str(p): round(float(np.percentile(times, p)), 3) for p in (50, 90, 95, 100)},
        "verify_s": {str(p): round(float(np.percentile(proofs, p)), 3) for p in (50, 95, 100)},
        "ratio": {str(p): round(float(np.percentile(ratios, p)), 4) for p in (50, 90, 95, 100)},
    }


def print_tables(rows: list[dict[str, Any]]) -> None:
    """One line a set and one for all, and every problem that is not verified."""
    table = Table("set", "n", "planned", "verified", "confirmed", "plan s 50/95/max", "verify s 50", "ratio 50/90")
    groups = {name: [row for row in rows if row["set"] == name] for name in dict.fromkeys(row["set"] for row in rows)}
    for name, group in {**groups, "all": rows}.items():
        s = summary(group)
        table.add_row(
            name,
            str(s["problems"]),
            *(f"{100 * s[key]:.1f} %" for key in ("planned", "verified", "confirmed")),
            " / ".join(f"{s['plan_s'][p]:.2f}" for p in ("50", "95", "100")),
            f"{s['verify_s']['50']:.2f}",
            " / ".join(f"{s['ratio'][p]:.3f}" for p in ("50", "90")),
        )
    console = Console(width=120)
    console.print(table)
    for row in rows:
        if not row["verified"]:
            console.print(f"{row['set']}/{row['problem']}: {row['failure'] or 'refused: ' + ', '.join(row['refused'])}")


if __name__ == "__main__":
    main()
