"""Every shipped problem, planned, then followed by computed torque: in our plant, in MuJoCo, and under disturbance.

    python benchmarks/executed.py --markdown executed.md --joints joints.md --clearances margins.md   # 10 minutes
    python benchmarks/executed.py --problems 02_shelf 16_delbot --budget 5

Each problem is planned by its own planner. Its motion is followed at full speed by computed torque (1 kHz, 10 Hz): in
our rigid-body plant (4 kHz) and in MuJoCo, both without anything else wrong; then with 10 % payload error (a mass of a
tenth of the robot's rated payload that the controller does not know of) and 2 ms from measurement to torque. How far
any body strays from where it was planned to be is the clearance that a plan needs under such conditions. Problems of
robots without inertias are listed and left out. The last line printed is one JSON object; exit code 1 if a verified
motion touched something in a nominal plant, or its tool error exceeded 1 mm RMS.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import sys
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from published import ROOT, commit, print_json, print_table, write_markdown
from rich.console import Console
from rich.progress import track

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.errors import InputError
from optiplan.planners.base import Budget
from optiplan.problem.load import load_problem
from optiplan.problem.problem import Problem
from optiplan.problem.task.timeline import ScenePart, scene_parts
from optiplan.robot.batched.kinematics import BatchKinematics
from optiplan.runs.pipeline import plan_and_verify_once
from optiplan.simulation.execution import ExecutionOptions, execute
from optiplan.simulation.log import Log
from optiplan.simulation.plants.base import Payload
from optiplan.simulation.plants.imperfections import Imperfections
from optiplan.trajectory.trajectory import Trajectory

RATED = {"panda": 3.0, "ur5": 5.0, "ur3": 3.0, "baxter": 2.2, "baxter_left": 2.2, "puma560": 2.5, "delbot": 3.0}
"""kg, the makers' data sheets (Delbot's arm: the UR3's); of others, 2.5 kg is taken."""
OTHER_RATED = 2.5
DELAY, SHARE = 0.002, 0.1

BAR = 1e-3  # m, tool error RMS

HEADINGS = (
    "problem",
    "motion s",
    "own: tool mm RMS / peak",
    "own: joints mrad RMS / peak",
    "MuJoCo: tool mm RMS / peak",
    "MuJoCo: joints mrad RMS / peak",
    "clearance mm planned / own / MuJoCo",
    "contact own / MuJoCo",
)
JOINTS = ("problem", "RMS of each joint, µrad (µm)", "peak of each joint, µrad (µm)")
SAME = "In our plant; the errors in MuJoCo differ from these by at most {} µrad (µm), PUMA 560 apart (its inertias)."
DISTURBED = ("problem", "payload kg", "payload alone", "delay alone", "both", "both, in MuJoCo")


def main() -> None:
    """Plan, execute, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--problems", nargs="+", help="only these, such as 02_shelf")
    parser.add_argument("--budget", type=float, default=20.0, help="seconds of planning for each")
    parser.add_argument("--markdown", type=Path, help="write the table of errors to this file")
    parser.add_argument("--joints", type=Path, help="write the errors of each joint to this file")
    parser.add_argument("--clearances", type=Path, help="write the table of clearances needed to this file")
    options = parser.parse_args()
    files = [f for f in sorted((ROOT / "problems").glob("*.yaml")) if f.stem in (options.problems or (f.stem,))]
    rows: list[dict[str, Any]] = []
    left: list[str] = []
    for file in track(files, "executing", console=Console(stderr=True), transient=True):
        row = run(file, options.budget)
        if isinstance(row, str):
            left.append(f"{file.stem}: {row}")
        else:
            rows.append(row)
    bad = [row["problem"] for row in rows if row["touched"] or row["own"]["tool_rms"] > BAR]
    remarks = [f"{len(rows) - len(bad)} of {len(rows)} without contact and with at most 1 mm RMS in our plant."]
    remarks += [f"Left out: {'; '.join(left)}."] if left else []
    table, disturbed = [nominal_cells(row) for row in rows], [disturbed_cells(row) for row in rows]
    print_table(HEADINGS, table)
    print_table(DISTURBED, disturbed)
    write_markdown(options.markdown, HEADINGS, table, remarks)
    write_markdown(options.joints, JOINTS, [joint_cells(row) for row in rows], [SAME.format(difference(rows))])
    write_markdown(options.clearances, DISTURBED, disturbed, [CLEARANCES])
    print_json({"commit": commit(), "bad": bad, "left_out": left, "problems": rows})
    sys.exit(int(bool(bad)))


CLEARANCES = (
    "Farthest that any corner of any body strays from where it was planned to be at that moment, mm: with this "
    "clearance nothing is touched. *contact* marks motions that touched something under these conditions: planned as "
    "near to obstacles as they are, they need a margin. *torque* marks those in which a drive reached its limit: "
    "planned to the limit of torque, they have none left for a load that nobody told of, and no clearance is enough."
)


def run(file: Path, budget: float) -> dict[str, Any] | str:
    """Errors and clearances of one problem; the reason in words where it cannot be executed."""
    problem = load_problem(file)
    done = plan_and_verify_once(problem, problem.planner, problem.options, Budget(budget), lambda stage, share: None)
    if not done.verified or done.trajectory is None:
        return "no verified motion"
    mass = SHARE * RATED.get(problem.robot.name, OTHER_RATED)
    payload, delay = Payload(mass, 0.0), Imperfections(delay=DELAY)
    parts = scene_parts(problem, done.trajectory)
    ways: dict[str, dict[str, Any]] = {
        "own": {},
        "mujoco": {"engine": "mujoco"},
        "payload": {"payload": payload},
        "delay": {"imperfections": delay},
        "both": {"payload": payload, "imperfections": delay},
        "mujoco, both": {"engine": "mujoco", "payload": payload, "imperfections": delay},
    }
    try:
        found = {name: executed(parts, done.trajectory, way) for name, way in ways.items()}
    except InputError as error:
        return error.issues[0].found
    own, mujoco = found.pop("own"), found.pop("mujoco")
    found["mujoco"] = found.pop("mujoco, both")
    return {
        "problem": file.stem,
        "robot": problem.robot.name,
        "duration": done.trajectory.duration,
        "planned": None if done.metrics is None else done.metrics.lowest_clearance,
        "own": own,
        "mujoco": mujoco,
        "touched": own["touched"] or mujoco["touched"],
        "payload": mass,
        "disturbed": {
            name: {"strays": log["strays"], "touched": log["touched"], "saturated": any(log["saturated"])}
            for name, log in found.items()
        },
    }


def executed(parts: list[ScenePart], trajectory: Trajectory, way: dict[str, Any]) -> dict[str, Any]:
    """Errors of one motion, JSON-ready: of a task part by part, each with the scene it has, begun as it was planned."""
    logs = []
    for part in parts:
        options = ExecutionOptions(**way, **({} if part is parts[-1] else {"settle": 0.0}))
        log = execute(part.problem, part.motion(trajectory), options)
        logs.append({**told(log), "strays": Strays(part.problem)(log), "steps": len(log.q)})
    steps = np.array([log["steps"] for log in logs])
    whole: dict[str, Any] = {"touched": any(log["touched"] for log in logs)}
    leasts = [log["least"] for log in logs if log["least"] is not None]
    whole |= {"least": min(leasts, default=None), "strays": max(log["strays"] for log in logs)}
    for key in ("rms", "tool_rms", "turn_rms"):
        whole[key] = np.sqrt(np.average([np.square(log[key]) for log in logs], axis=0, weights=steps)).tolist()
    for key in ("peak", "tool_peak", "turn_peak", "saturated"):
        whole[key] = np.max([log[key] for log in logs], axis=0).tolist()
    return whole


def told(log: Log) -> dict[str, Any]:
    """Errors of one execution, JSON-ready."""
    found = log.tracking.to_dict()
    return {**found, "least": log.contacts and log.contacts.least, "touched": log.touched}


class Strays:
    """How far any body of a robot strays from where it should be."""

    def __init__(self, problem: Problem) -> None:
        bodies = CollisionModel(problem.robot, problem.scene).geometry.geometryObjects
        self._kinematics = BatchKinematics(problem.robot.model)
        count = problem.robot.model.njoints  # behind these come the joints of obstacles that move
        self._corners = [(body.parentJoint, corners(body)) for body in bodies if 0 < body.parentJoint < count]

    def __call__(self, log: Log) -> float:
        """Largest distance, m, over time, of the corners of the bodies' bounding boxes and of the tool."""
        wanted, actual = self._kinematics.poses(log.wanted), self._kinematics.poses(log.q)
        worst = float(log.tool_error[:, 0].max())
        for joint, points in self._corners:
            apart = (wanted[:, joint] - actual[:, joint]) @ points
            worst = max(worst, float(np.linalg.norm(apart[:, :3], axis=1).max()))
        return worst


def corners(body: pin.GeometryObject) -> Array:
    """Corners of a body's bounding box, in the frame of its joint, homogeneous: (4, 8), m."""
    body.geometry.computeLocalAABB()
    low, high = np.array(body.geometry.aabb_local.min_), np.array(body.geometry.aabb_local.max_)
    ends = np.array([[*end, 1.0] for end in product(*zip(low, high, strict=True))])
    return np.asarray(body.placement.homogeneous @ ends.T)


def nominal_cells(row: dict[str, Any]) -> list[str]:
    """One line of the first table."""
    own, mujoco = row["own"], row["mujoco"]

    def tool(found: dict[str, Any]) -> str:
        return f"{1e3 * found['tool_rms']:.3f} / {1e3 * found['tool_peak']:.3f}"

    def joints(found: dict[str, Any]) -> str:
        return f"{1e3 * max(found['rms']):.3f} / {1e3 * max(found['peak']):.3f}"

    def gap(value: float | None) -> str:
        return "–" if value is None else "≥ 50" if value >= 0.05 else f"{1e3 * value:.2f}"

    return [
        row["problem"],
        f"{row['duration']:.3f}",
        tool(own),
        joints(own),
        tool(mujoco),
        joints(mujoco),
        f"{gap(row['planned'])} / {gap(own['least'])} / {gap(mujoco['least'])}",
        " / ".join("**yes**" if found["touched"] else "no" for found in (own, mujoco)),
    ]


def joint_cells(row: dict[str, Any]) -> list[str]:
    """One line of the table of joints."""
    return [row["problem"], *(" ".join(f"{1e6 * x:.0f}" for x in row["own"][key]) for key in ("rms", "peak"))]


def difference(rows: list[dict[str, Any]]) -> str:
    """Largest difference of the joints' errors in the two engines, µrad, in words; without those of the PUMA 560."""
    found = [
        np.abs(np.subtract(row["own"][key], row["mujoco"][key])).max()
        for row in rows
        for key in ("rms", "peak")
        if row["robot"] != "puma560"
    ]
    return f"{1e6 * max(found, default=0.0):.2g}"


def disturbed_cells(row: dict[str, Any]) -> list[str]:
    """One line of the second table."""
    cells = [row["problem"], f"{row['payload']:.2f}"]
    for name in ("payload", "delay", "both", "mujoco"):
        found = row["disturbed"][name]
        marks = [word for key, word in (("touched", "contact"), ("saturated", "torque")) if found[key]]
        cells.append(f"{1e3 * found['strays']:.2f}" + "".join(f" *{word}*" for word in marks))
    return cells


if __name__ == "__main__":
    main()
