"""Robots of other programs that nobody prepared: MuJoCo Menagerie, example-robot-data, MoveIt configurations, USD.

    python benchmarks/imports.py --menagerie ../mujoco_menagerie              # a checkout of it; one MJCF a folder
    python benchmarks/imports.py --urdfs 20                                   # of example-robot-data (extra `robots`)
    python benchmarks/imports.py --moveit ../moveit_resources/panda_moveit_config
    python benchmarks/imports.py --usd ../newton/newton/examples/assets/ant.usda

Each robot is made by `op.init_robot`, which guesses the joints to plan and the tool frame. Then one goal is planned:
the robot starts in its first named configuration, else in the middle of its limits, else in a drawn configuration. The
goal is the pose of the tool frame in a drawn configuration, with the default tolerances. Draws that the program
refuses, in collision or held by too weak a motor, are replaced by the next; after 40 of them the last refusal is the
reason. Each robot has its own process and `--timeout` seconds. The last line printed is one JSON object.
"""

import argparse
import difflib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from published import commit, print_json, print_table, table_parser, write_markdown
from rich.console import Console

HEADINGS = ("robot", "loaded", "joints planned", "tool", "pairs checked/not", "load s", "pose goal", "duration s")
NOT_ROBOTS = ("scene", "mjx", "keyframe", "actuators")
"""Words in the names of MJCF files that are no robot by themselves."""

DRAWS = 40

TOO_WEAK = "gravity alone exceeds the torque limits"
"""In the reason of a failure: a motor that does not hold the start or the goal."""


def main() -> None:
    """Measure the requested robots."""
    parser = table_parser(__doc__)
    parser.add_argument("--menagerie", type=Path, help="a checkout of MuJoCo Menagerie")
    parser.add_argument("--urdfs", type=int, default=0, help="how many robots of example-robot-data, one a folder")
    parser.add_argument("--moveit", type=Path, nargs="*", default=[], help="MoveIt configuration folders")
    parser.add_argument("--usd", type=Path, nargs="*", default=[], help="USD stages with a robot")
    parser.add_argument("--only", nargs="*", default=[], help="words, one of which is in the name of each robot")
    parser.add_argument("--budget", type=float, default=20.0, help="seconds for planning and proof of the goal")
    parser.add_argument("--timeout", type=float, default=300.0, help="seconds for a robot")
    parser.add_argument(
        "--rows", type=Path, help="append a line of JSON a robot here; those that have one are not redone"
    )
    parser.add_argument("--one", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one is not None:
        print_json(measured(options.one, options.budget))
        return
    rows = done_before(options.rows)
    for name, path in sources(options):
        if name not in rows and (not options.only or any(word in name for word in options.only)):
            Console(stderr=True).print(f"{name} …")
            rows[name] = {"robot": name, **in_process(path, options)}
            if options.rows is not None:
                with options.rows.open("a") as file:
                    file.write(json.dumps(rows[name]) + "\n")
    table = [line(row) for row in rows.values()]
    print_table(HEADINGS, table)
    loaded, verified = (sum(bool(row.get(key)) for row in rows.values()) for key in ("loaded", "verified"))
    remarks = [f"{len(rows)} robots: {loaded} loaded, {verified} with a pose goal planned and verified."]
    write_markdown(options.markdown, HEADINGS, table, remarks)
    print_json({"commit": commit(), "rows": list(rows.values())})


def done_before(path: Path | None) -> dict[str, dict[str, Any]]:
    """Rows of an earlier call."""
    if path is None or not path.exists():
        return {}
    rows = [json.loads(text) for text in path.read_text().splitlines()]
    return {row["robot"]: row for row in rows}


def sources(options: argparse.Namespace) -> Iterator[tuple[str, Path]]:
    """Name and file of every robot."""
    if options.menagerie is not None:
        for folder in sorted(path for path in options.menagerie.iterdir() if path.is_dir()):
            files = [path for path in sorted(folder.glob("*.xml")) if not any(word in path.name for word in NOT_ROBOTS)]
            if files:
                yield folder.name, max(files, key=lambda path: likeness(path.stem, folder.name))
    if options.urdfs:
        from optiplan.robot.description_files import package_robots

        folders = {path.parent.parent: path for path in sorted(set(package_robots().values()), reverse=True)}
        for folder, path in sorted(folders.items())[: options.urdfs]:
            yield f"{folder.name.removesuffix('_description')}/{path.name}", path
    for path in (*options.moveit, *options.usd):
        yield path.name, path


def likeness(a: str, b: str) -> float:
    """How much of two names is alike, 0 to 1."""
    return difflib.SequenceMatcher(None, a, b).ratio()


def in_process(path: Path, options: argparse.Namespace) -> dict[str, Any]:
    """One row, made by a process of its own."""
    command = [sys.executable, __file__, "--one", str(path.resolve()), "--budget", str(options.budget)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, env=environment, timeout=options.timeout, check=False
        )
    except subprocess.TimeoutExpired:
        return {"reason": f"no answer in {options.timeout:g} s"}
    try:
        row: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    except (json.JSONDecodeError, IndexError):
        last = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        return {"reason": last}
    return row


def measured(path: Path, budget: float) -> dict[str, Any]:
    """Make the robot, plan one goal; a failure is a `reason`."""
    import optiplan as op

    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        try:
            robot = op.init_robot(path, folder)
        except op.OptiPlanError as error:
            return {"reason": str(error).replace(str(path.parent), path.parent.name).replace(folder, "")}
        loaded = {
            "loaded": True,
            "joints": list(robot.joint_names),
            "tool": robot.tool_frame,
            "checked": len(robot.geometry.collisionPairs),
            "unchecked": len(robot.allowed),
            "load": time.perf_counter() - began,
        }
        return {**loaded, **goal_planned(robot, budget)}


def goal_planned(robot: Any, budget: float) -> dict[str, Any]:
    """Plan to the pose of a drawn configuration."""
    import optiplan as op
    from optiplan.geometry.poses import pose_to_data
    from optiplan.kinematics.jacobians import frame_pose

    rng = np.random.default_rng(0)
    lower, upper = np.maximum(robot.limits.lower, -np.pi), np.minimum(robot.limits.upper, np.pi)
    starts = [*robot.configurations.values(), 0.5 * (lower + upper)]
    reason = "no configuration to start from"
    for _ in range(DRAWS):
        start = starts.pop(0) if starts else rng.uniform(lower, upper)
        goal = rng.uniform(lower, upper)
        try:
            op.Problem(robot, start=start, goal=goal)  # both ends are held against limits, bodies and motors
            pose = pose_to_data(frame_pose(robot, goal, robot.tool_frame))
            run = op.plan(op.Problem(robot, start=start, goal={"pose": pose}), budget=budget)
        except op.OptiPlanError as error:
            reason = str(error)
            starts = [start, *starts] if "goal" in reason and "start" not in reason else starts
            continue
        if run.failure is not None and (run.failure.kind == "unsupported" or TOO_WEAK in run.failure.detail):
            reason = run.failure.detail
            continue
        told = run.failure.detail if run.failure is not None else "" if run.verified else "found, not verified"
        return {"verified": run.verified, "duration": run.duration, "reason": told}
    return {"reason": f"{DRAWS} draws refused, the last: {reason}"}


def line(row: dict[str, Any]) -> list[str]:
    """The cells of a row, in the order of `HEADINGS`."""
    reason = " ".join(str(row.get("reason") or "").split())[:220]
    if not row.get("loaded"):
        return [row["robot"], f"no: {reason}", *[""] * (len(HEADINGS) - 2)]
    joints = f"{len(row['joints'])}: {row['joints'][0]} … {row['joints'][-1]}"
    pairs = f"{row['checked']}/{row['unchecked']}"
    goal = "verified" if row.get("verified") else f"no: {reason}"
    duration = "" if row.get("duration") is None else f"{row['duration']:.2f}"
    return [row["robot"], "yes", joints, row["tool"], pairs, f"{row['load']:.1f}", goal, duration]


if __name__ == "__main__":
    main()
