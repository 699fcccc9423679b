"""Robots that nobody prepared: three lines of robot.yaml, seeded random problems in free space, one table.

    python benchmarks/own_robots.py                                # the optiplan of this Python, about 15 minutes
    PYTHONPATH=/path/to/another/checkout python benchmarks/own_robots.py --count 3 --robots z1 tiago

Robots are those of example-robot-data (extra `robots`). All goes through the command line (`optiplan robots show`
and `optiplan plan`, with --json), so the same script measures other versions. Start and goal are drawn uniformly within
the joint limits, joints without an end within a turn; the draws are the same for every version that plans the same
joints. A draw that the program under test refuses as in collision, or as held by too weak a motor, is replaced by the
next. Ctrl-C ends early and prints what was done. The last line printed is one JSON object.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from published import commit, print_json, print_table, table_parser, write_markdown
from rich.console import Console

FINGERS = [*(f"panda_joint{k}" for k in range(1, 8)), "panda_finger_joint1"]
ROBOTS: dict[str, tuple[str, dict[str, Any]]] = {
    "kinova": ("kinova", {}),
    "z1": ("z1", {}),
    "tiago": ("tiago", {}),
    "g1": ("g1_29dof_with_hand_rev_1_0", {}),
    "ur10": ("ur10", {}),
    "panda": ("panda", {}),
    "panda_fingers": ("panda", {"group": FINGERS}),
    "talos_reduced": ("talos_reduced", {}),
    "centauro": ("centauro", {}),
}
"""Name in the table: name in the data package, and what its robot.yaml says beside the three lines."""

RUN = "import sys; from optiplan.cli.main import run; sys.exit(run(sys.argv[1:]))"


def optiplan(*arguments: str, timeout: float = 900.0) -> dict[str, Any]:
    """What a command prints with --json; its exit code is in it."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-c", RUN, *arguments, "--json"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=timeout, check=False)
    except subprocess.TimeoutExpired:
        return {"exit_code": -1, "error": f"no answer in {timeout:g} s"}
    try:
        return {"exit_code": done.returncode, **json.loads(done.stdout.splitlines()[-1])}
    except (json.JSONDecodeError, IndexError):
        last = (done.stderr.strip().splitlines() or ["nothing said"])[-1]
        return {"exit_code": done.returncode, "error": last}


def write_robot(folder: Path, name: str) -> Path:
    """A robot.yaml of three lines, and what `ROBOTS` adds."""
    package, more = ROBOTS[name]
    folder.mkdir()
    lines = {"version": 1, "name": name, "urdf": {"package": "example-robot-data", "robot": package}, **more}
    path = folder / "robot.yaml"
    path.write_text("\n".join(f"{key}: {json.dumps(value)}" for key, value in lines.items()) + "\n")
    return path


def draws(joints: list[dict[str, Any]], seed: int) -> Any:
    """Endless pairs of start and goal, (2, n), within the limits that `robots show` tells."""
    lower = np.array([-np.pi if joint["lower"] is None else max(joint["lower"], -np.pi) for joint in joints])
    upper = np.array([np.pi if joint["upper"] is None else min(joint["upper"], np.pi) for joint in joints])
    rng = np.random.default_rng(seed)
    while True:
        yield rng.uniform(lower, upper, (2, len(joints)))


def measure(name: str, folder: Path, options: argparse.Namespace) -> dict[str, Any]:
    """One row of the table."""
    robot = write_robot(folder / name, name)
    shown = optiplan("robots", "show", str(robot))
    if "joints" not in shown:
        return {"robot": name, "error": shown.get("error", "no robot")}
    joints = [joint["name"] for joint in shown["joints"]]
    row = {"robot": name, "joints": joints, "tool_frame": shown["tool_frame"], "notes": shown["notes"]}
    row |= {"checked": len(shown["checked_pairs"]), "unchecked": len(shown["allowed_pairs"]), "refused": 0, "runs": []}
    for start, goal in draws(shown["joints"], options.seed):
        if len(row["runs"]) == options.count or row["refused"] == 20 * options.count:
            return row
        problem = folder / name / "problem.yaml"
        ends = {"start": {"joints": start.tolist()}, "goal": {"joints": goal.tolist()}}
        data = {"version": 1, "robot": str(robot), **ends, "seed": len(row["runs"])}
        problem.write_text("\n".join(f"{key}: {json.dumps(value)}" for key, value in data.items()) + "\n")
        flags = ("--planner", options.planner, "--budget", str(options.budget))
        found = optiplan("plan", str(problem), *flags)
        failure = (found.get("failure") or {}).get("kind")
        if found["exit_code"] == 2 or failure == "unsupported":
            row["refused"] += 1
            row["last_refusal"] = found.get("error") or found["failure"]["detail"]
            continue
        timings = found.get("timings") or {}
        row["runs"].append(
            {
                "exit_code": found["exit_code"],
                "verified": found.get("verified", False),
                "failure": failure or found.get("error"),
                "ratio": found.get("ratio"),
                "duration": found.get("duration"),
                "load": timings.get("load"),
                "plan": timings.get("plan"),
                "verify": timings.get("verify"),
            }
        )
    return row


HEADINGS = ("robot", "joints", "from … to", "tool", "pairs checked/not", "load s", "verified", "ratio", "plan s")


def lines(rows: list[dict[str, Any]]) -> list[list[str]]:
    """A line a robot, in the order of `HEADINGS`; median and largest where there are two figures."""
    return [_line(row) for row in rows]


def _line(row: dict[str, Any]) -> list[str]:
    if "error" in row:
        return [row["robot"], "", row["error"][:200], *[""] * (len(HEADINGS) - 3)]
    runs = row["runs"]
    verified = [run for run in runs if run["verified"]]
    cells = [f"{len(verified)} of {len(runs)} ({row['refused']} draws refused)"]
    cells += [_spread([run["ratio"] for run in verified]), _spread([run["plan"] for run in runs])]
    chain = f"{row['joints'][0]} … {row['joints'][-1]}"
    load = _spread([run["load"] for run in runs])
    pairs = f"{row['checked']}/{row['unchecked']}"
    return [row["robot"], str(len(row["joints"])), chain, row["tool_frame"], pairs, load, *cells]


def _spread(values: list[float | None]) -> str:
    """Median and largest."""
    known = [value for value in values if value is not None]
    return f"{statistics.median(known):.3g} / {max(known):.3g}" if known else "—"


def main() -> None:
    """Measure the robots that are named."""
    parser = table_parser(__doc__)
    parser.add_argument("--robots", nargs="+", choices=ROBOTS, default=list(ROBOTS))
    parser.add_argument("--count", type=int, default=5, help="problems of each robot")
    parser.add_argument("--seed", type=int, default=0, help="of the draws")
    parser.add_argument("--planner", default="trajopt")
    parser.add_argument("--budget", type=float, default=20.0)
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        try:
            for name in options.robots:
                Console(stderr=True).print(f"{name} …")
                rows.append(measure(name, Path(folder), options))
        except KeyboardInterrupt:
            pass
    table = lines(rows)
    print_table(HEADINGS, table)
    remarks = [f"Interrupted after {len(rows)} of {len(options.robots)} robots."] * (len(rows) < len(options.robots))
    write_markdown(options.markdown, HEADINGS, table, remarks)
    told = {"planner": options.planner, "budget": options.budget, "seed": options.seed, "commit": commit()}
    print_json({**told, "rows": rows})


if __name__ == "__main__":
    main()
