"""Every shipped problem, executed with a speed that changes at random: tool errors, contact, where objects end.

    python benchmarks/execute_examples.py --markdown examples.md          # about 12 minutes
    python benchmarks/execute_examples.py --problems 40_panda_sorts_cubes 41_delbot_fetches --seed 3

Each problem is planned by its own planner. Its run is executed by `op.execute` in MuJoCo and in our own plant, with
the set-points and torques of an `op.Executor` whose speed changes at random, which pauses and goes back now and then.
Runs that the executor refuses, such as those among obstacles that move by the clock, are executed at the planned speed;
the table says so. Tasks are executed once more with grips by friction, mecanum bases on wheels. Problems of robots
without inertias are left out. The last line printed is JSON. Exit code 1: a tool error above 1 mm RMS, a contact, or an
object that ends farther than 2 mm from the plan; grips by friction are reported, not judged.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from published import ROOT, commit, print_json, print_table, table_parser, write_markdown

import optiplan as op
from optiplan.simulation.execution_report import OBJECT_ERROR
from optiplan.simulation.log import Log

BAR = 1e-3  # m, tool error RMS
RATE, LEAST, LASTING = 2.0, 0.1, 0.3  # changes a second; least speed; s of a pause or a way back
FINGERS, PADS = 30.0, {"srra": 200.0, "baxter": 200.0}  # N, of each finger; of pads, where no fingers are modelled
CALM = 60.0  # s after which nothing changes any more
HEADINGS = (
    "problem",
    "speed",
    "s planned / executed",
    "own: tool mm RMS / max",
    "MuJoCo: tool mm RMS / max",
    "contact",
    "objects mm own / MuJoCo",
    "by friction: objects / slip mm, margin %",
    "on wheels: tool mm RMS / max, drift mm a m",
)


def main() -> None:
    """Plan, execute, print."""
    parser = table_parser(__doc__)
    parser.add_argument("--problems", nargs="+", help="only these, such as 40_panda_sorts_cubes")
    parser.add_argument("--budget", type=float, default=20.0, help="seconds of planning for each")
    parser.add_argument("--seed", type=int, default=1, help="of the changes of speed")
    options = parser.parse_args()
    files = [
        file for file in sorted((ROOT / "problems").glob("*.yaml")) if file.stem in (options.problems or [file.stem])
    ]
    found: list[dict[str, Any]] = []
    left: list[str] = []
    for file in files:
        began = time.perf_counter()
        row = executed(file, options.budget, options.seed)
        if isinstance(row, str):
            left.append(f"{file.stem}: {row}")
            print(f"{file.stem}: left out, {row}", flush=True)
        else:
            found.append(row)
            verdict = "bad: " + "; ".join(row["bad"]) if row["bad"] else "good"
            print(f"{file.stem}: {verdict} ({time.perf_counter() - began:.1f} s)", flush=True)
    rows, bad = [cells(row) for row in found], [row["problem"] for row in found if row["bad"]]
    remarks = [f"{len(found) - len(bad)} of {len(found)} within 1 mm RMS, without contact, objects within 2 mm."]
    remarks += [
        f"Grips: fingers press with {FINGERS:g} N, pads of a model (SRRA, Baxter, which are welded) with 200 N."
    ]
    remarks += [f"Left out: {'; '.join(left)}."] if left else []
    print_table(HEADINGS, rows)
    write_markdown(options.markdown, HEADINGS, rows, remarks)
    print_json({"commit": commit(), "seed": options.seed, "bad": bad, "left_out": left, "problems": found})
    sys.exit(int(bool(bad)))


def executed(file: Path, budget: float, seed: int) -> dict[str, Any] | str:
    """Return figures of one problem; in words why it cannot be executed."""
    run = op.plan(op.load_problem(file), budget=budget)
    if not run.verified:
        return "no verified motion"
    speed, ways = "at random", {"own": {}, "mujoco": {}}
    if run.problem.task:
        ways["friction"] = {"engine": "mujoco", "grip": op.FrictionGrip(PADS.get(run.problem.robot.name, FINGERS))}
    if run.problem.robot.mecanum is not None:
        ways["wheels"] = {"engine": "mujoco", "wheels": True}
    try:
        op.Executor(run)
    except op.InputError as error:
        speed = f"as planned: {error.issues[0].found}"
    logs: dict[str, Log] = {}
    for name, way in ways.items():
        speeds = changing(np.random.default_rng(seed)) if speed == "at random" else None
        try:
            logs[name] = op.execute(run, **{"engine": name, "speeds": speeds, **way})
        except op.InputError as error:
            return error.issues[0].found
    figures = {name: told(log) for name, log in logs.items()}
    bad = [f"{name}: {fault}" for name in ("own", "mujoco", "wheels") if name in logs for fault in faults(logs[name])]
    return {"problem": file.stem, "speed": speed, "planned": run.duration, "bad": bad, **figures}


def changing(rng: np.random.Generator) -> Callable[[op.Executor], None]:
    """Return a function that changes the speed of an executor at random, and lets it go on after a while."""
    due, calm = 0.0, False

    def change(executor: op.Executor) -> None:
        nonlocal due, calm
        if calm or executor.time < due:
            return
        executor.resume()
        executor.override = float(rng.uniform(LEAST, 1.0))
        due, what = executor.time + rng.exponential(1.0 / RATE), rng.integers(8)
        if executor.time > CALM:
            executor.override, calm = 1.0, True
        elif what == 0:
            executor.pause()
            due = executor.time + LASTING
        elif what == 1:
            executor.reverse()
            due = executor.time + LASTING

    return change


def faults(log: Log) -> list[str]:
    """Return in words what is beyond the bounds."""
    found = [f"tool error {1e3 * log.tracking.tool_rms:.3g} mm RMS"] if log.tracking.tool_rms > BAR else []
    found += [f"'{a}' and '{b}' touch" for a, b in (log.contacts.touched if log.contacts else ())]
    found += [
        f"{name} ends {1e3 * one.error:.3g} mm off" for name, one in log.objects.items() if one.error > OBJECT_ERROR
    ]
    return found + ([log.stopped] if log.stopped else [])


def told(log: Log) -> dict[str, Any]:
    """Return figures of one execution, JSON-ready."""
    objects = {name: {"error": one.error, "turn": one.turn, "slip": one.slip} for name, one in log.objects.items()}
    return {
        "duration": float(log.t[-1]),
        "tool_rms": log.tracking.tool_rms,
        "tool_peak": log.tracking.tool_peak,
        "touched": sorted(map(list, log.contacts.touched)) if log.contacts else [],
        "saturated": float(log.tracking.saturated.max()),
        "objects": objects,
        "slip_margin": log.slip_margin,
        "wheels": log.wheels and vars(log.wheels),
    }


def cells(row: dict[str, Any]) -> list[str]:
    """Return one line of the table."""

    def tool(found: dict[str, Any]) -> str:
        return f"{1e3 * found['tool_rms']:.3f} / {1e3 * found['tool_peak']:.3f}"

    def worst(found: dict[str, Any], key: str) -> float:
        return 1e3 * max(one[key] for one in found["objects"].values())

    own, mujoco, friction = row["own"], row["mujoco"], row.get("friction")
    objects = f"{worst(own, 'error'):.2f} / {worst(mujoco, 'error'):.2f}" if mujoco["objects"] else "–"
    gripped = "–"
    if friction is not None:
        gripped = f"{worst(friction, 'error'):.2f} / {worst(friction, 'slip'):.2f}, {100 * friction['slip_margin']:.0f}"
    rolled = "–"
    if "wheels" in row:
        rolled = (
            f"{tool(row['wheels'])}, {1e3 * row['wheels']['wheels']['drift'] / row['wheels']['wheels']['travel']:.1f}"
        )
    return [
        row["problem"],
        row["speed"].partition(":")[0],
        f"{row['planned']:.2f} / {mujoco['duration']:.2f}",
        tool(own),
        tool(mujoco),
        "**yes**" if own["touched"] or mujoco["touched"] else "no",
        objects,
        gripped,
        rolled,
    ]


if __name__ == "__main__":
    main()
