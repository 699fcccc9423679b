"""MotionBenchMaker's Panda with 3 kg in the hand: how many of the feasible problems are planned within torque limits.

    python benchmarks/payload.py --every 1 --markdown payload.md             # 350 problems, about 20 minutes
    python benchmarks/payload.py --every 10                                  # 35

The load has the inertia of a cube of steel and its centre at the grasp target; its shape lies within the hand, so that
the load alone makes a problem harder. Feasible: the torques of gravity at the start, and at one goal configuration at
least that is free of contact, are within the limits (pinocchio, apart from the planners' own test). Of a goal pose
configurations are looked for as the planner does, but more of them. The last line printed is JSON.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from published import by_set, commit, import_sets, percentiles, print_json, print_table, table_parser, write_markdown
from rich.console import Console
from rich.progress import track

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.problem.goals import GoalOptions, goal_configurations

HAND, FINGERS, TARGET = "panda_hand", ("panda_leftfinger", "panda_rightfinger"), "panda_grasptarget"
INSIDE, SIDE = 0.03, 0.005
"""m: where the load's shape is in the hand, and its edge."""

DENSITY = 7850.0
"""kg/m³ of steel, for the inertia."""

MANY = GoalOptions(count=64, solutions=64, attempts=300)

HEADINGS = (
    "set",
    "n",
    "start too heavy",
    "goals too heavy",
    "feasible",
    "verified",
    "share",
    "plan s 50 / 95",
    "duration / without load 50 / 90",
)


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = table_parser(__doc__)
    parser.add_argument("--mass", type=float, default=3.0, help="kg")
    parser.add_argument("--every", type=int, default=10, help="every k-th problem of each set")
    parser.add_argument("--offset", type=int, default=0, help="index of the first of them")
    parser.add_argument("--budget", type=float, default=10.0, help="seconds for each problem")
    parser.add_argument("--compare", action="store_true", help="plan without the load too")
    return parser.parse_args()


def main() -> None:
    """Load the hand, plan, print."""
    options = parse()
    rows: list[dict[str, Any]] = []
    console = Console(stderr=True)
    with tempfile.TemporaryDirectory() as folder:
        sets = import_sets("panda", Path(folder), options.every, options.offset)
        files = [file for name in sets for file in sets[name]]
        try:
            for file in track(files, "payload", console=console, transient=True):
                row = solve(file, options)
                if row is not None:
                    rows.append(row)
                    if row["feasible"] and not row["verified"]:
                        console.print(f"{row['set']}/{row['problem']}: {row['why']}", markup=False)
        except KeyboardInterrupt:
            pass
    table = [line(name, group) for name, group in by_set(rows).items()]
    print_table(HEADINGS, table)
    failed = [
        f"- {row['set']}/{row['problem']}: {row['why']}" for row in rows if row["feasible"] and not row["verified"]
    ]
    write_markdown(options.markdown, HEADINGS, table, ["\n".join(failed)] if failed else [])
    print_json({"commit": commit(), "mass": options.mass, "runs": rows})


def loaded(problem: op.Problem, mass: float) -> op.Problem:
    """The problem with the load in the hand."""
    data, model = problem.robot.model.createData(), problem.robot.model
    pin.framesForwardKinematics(model, data, problem.start)
    X_HT = data.oMf[problem.robot.frame_id(HAND)].actInv(data.oMf[problem.robot.frame_id(TARGET)])
    centre = X_HT.translation - [0.0, 0.0, INSIDE]
    moment = mass * (mass / DENSITY) ** (2.0 / 3.0) / 6.0
    body = op.Box("load", size=(SIDE, SIDE, SIDE), position=(0.0, 0.0, INSIDE))
    held = body.attached_to(HAND, FINGERS, mass=mass, centre=centre.tolist(), inertia=[moment] * 3)
    return problem.with_scene(problem.scene.with_attached(held))


def solve(file: Path, options: argparse.Namespace) -> dict[str, Any] | None:
    """One problem; None where it is bad input without a load already."""
    try:
        problem = op.load_problem(file)
    except op.InputError:
        return None
    row: dict[str, Any] = {"set": file.parent.name, "problem": file.stem, "verified": False, "why": None}
    try:
        heavy = loaded(problem, options.mass)
    except op.InputError as error:
        return row | {"feasible": False, "held": ("start", "goal"), "why": str(error)}
    held = holds(heavy)
    row |= {"held": held, "feasible": len(held) == 2}
    if not row["feasible"]:
        return row
    run = op.plan(heavy, "trajopt", budget=options.budget)
    light = op.plan(problem, "trajopt", budget=options.budget) if options.compare else None
    why = [] if run.report is None else [check.name for check in run.report.failures]
    return row | {
        "verified": run.verified,
        "why": f"{run.failure.kind}: {run.failure.detail}" if run.failure else ", ".join(why),
        "plan_s": run.timings["plan"],
        "duration": run.duration,
        "light": None if light is None else light.duration,
    }


def holds(problem: op.Problem) -> tuple[str, ...]:
    """Which of start and goal can be held at rest."""
    model, data, limit = problem.robot.model, problem.robot.model.createData(), problem.limits.torque

    def light(q: np.ndarray) -> bool:
        return bool((np.abs(pin.computeGeneralizedGravity(model, data, q)) < limit).all())

    rng = np.random.default_rng(problem.seed)
    goals = goal_configurations(problem, CollisionModel(problem.robot, problem.scene), rng, MANY).configurations
    found = (("start", light(problem.start)), ("goal", any(light(q) for q in goals)))
    return tuple(name for name, good in found if good)


def line(name: str, rows: list[dict[str, Any]]) -> list[str]:
    """One row of the table."""
    feasible = [row for row in rows if row["feasible"]]
    good = [row for row in feasible if row["verified"]]
    seconds = percentiles([row["plan_s"] for row in feasible], 50, 95)
    longer = percentiles([row["duration"] / row["light"] for row in good if row["light"]], 50, 90)
    return [
        name,
        f"{len(rows)}",
        f"{sum('start' not in row['held'] for row in rows)}",
        f"{sum('goal' not in row['held'] for row in rows)}",
        f"{len(feasible)}",
        f"{len(good)}",
        f"{100 * len(good) / max(1, len(feasible)):.1f} %",
        " / ".join(f"{value:.2f}" for value in seconds),
        " / ".join(f"{value:.3f}" for value in longer) if np.isfinite(longer).all() else "–",
    ]


if __name__ == "__main__":
    main()
