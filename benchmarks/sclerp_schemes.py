"""Compare four ScLERP schemes on the report's own runs: as printed, corrected, damped, and by quadratic programs.

    python benchmarks/sclerp_schemes.py                        # about a minute on one core

The arm is `robots/baxter_report`; goals and the printed scheme are those of `tests/reference`. The first three schemes
stop at 0.003 as the report's program does. *End* is the remaining distance to the goal. *Off* is the largest distance
of the tool's path from the nearest of 2001 poses of the screw, at every step (for `qp` at 2001 samples). *Past* counts
steps that carried a joint to its limit or past it (for `qp`: the exact extrema of the path exceed one). `qp, led` is
`qp` with `redundancy: goal`. The last line printed is one JSON object.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from published import script_parser
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parent.parent))  # the reports' numbers lie with the tests

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.geometry.scene import Scene
from optiplan.planners.base import Budget, Failure
from optiplan.planners.common.goal_ranking import ranked_goals
from optiplan.planners.sclerp.options import SclerpOptions
from optiplan.planners.sclerp.qp_stepping import ScrewMotion
from optiplan.planners.sclerp.schemes import iterate_scheme
from optiplan.planners.sclerp.screw_kinematics import ScrewTool
from optiplan.planners.sclerp.screw_motion import ScrewTask, attempt
from optiplan.problem.problem import PoseGoal
from optiplan.robot.batched.kinematics import BatchKinematics
from optiplan.robot.robot import load_robot
from tests.reference.entries import entry
from tests.reference.sclerp_misprints import PRINTED, printed_scheme
from tests.unchecked_problem import unchecked_problem

SCHEMES = ("printed", "corrected", "damped", "qp", "qp, led")
ANGLE = 0.1  # m/rad: how much the angle counts where the nearest pose is looked for
FINE = np.linspace(0.0, 1.0, 2001)


def main() -> None:
    """Run, print."""
    script_parser(__doc__).parse_args()
    arm = load_robot("baxter_report")
    tool = ScrewTool(arm, arm.tool_frame)
    rows = {run["id"]: {scheme: measure(tool, run, scheme) for scheme in SCHEMES} for run in RUNS}
    show(rows)
    print(json.dumps({"threads": 1, "runs": rows}))


RUNS: list[dict[str, Any]] = entry("sclerp.runs").value


def measure(tool: ScrewTool, run: dict[str, Any], scheme: str) -> dict[str, Any]:
    """One scheme, one goal, from the stretched arm."""
    X_WG, start = pin.SE3(np.array(run["goal"])), np.zeros(tool.robot.n)
    if scheme.startswith("qp"):
        return by_programs(tool, start, X_WG, scheme)
    if scheme == "printed":
        found = printed_scheme(tool, start, X_WG, replace(PRINTED, iterations=run["max_iterations"]))
    else:
        found = iterate_scheme(tool, start, X_WG, SclerpOptions(scheme=scheme, iterations=run["max_iterations"]))
    result = {"converged": found.converged, "iterations": found.iterations}
    past = {"past": int(found.hits.any(axis=1).sum())}
    return result | (errors(tool, found.Q, X_WG) if found.converged else {}) | past


def by_programs(tool: ScrewTool, start: Array, X_WG: pin.SE3, scheme: str) -> dict[str, Any]:
    """The path of `qp`, or where it ends; led to the goal configurations in turn if the scheme's name says so."""
    robot = tool.robot
    problem = unchecked_problem(
        name="run", robot=robot, scene=Scene(()), start=start, goal=(PoseGoal(tool.frame, X_WG),), limits=robot.limits
    )
    model, budget = CollisionModel(robot, Scene(())), Budget(600.0)
    ends: list[Array | None] = [None]
    if scheme == "qp, led":
        goals = ranked_goals(problem, model, budget)
        ends = [] if isinstance(goals, Failure) else list(goals)
    result: dict[str, Any] = {"converged": False, "unreachable": not ends}
    for end in ends:
        task = ScrewTask(tool, start, X_WG, end, False, {})
        path = attempt(model, task, SclerpOptions(), budget)
        if not isinstance(path, Failure):
            low, high = path.extrema(0)
            past = bool((low < robot.limits.lower).any() or (high > robot.limits.upper).any())
            Q = path(FINE * path.duration)
            return {"converged": True, **task.info, **errors(tool, Q, X_WG), "past": int(past)}
        result |= {key: path.witness.get(key) for key in ("fraction", "joint")}
    return result


def errors(tool: ScrewTool, Q: Array, X_WG: pin.SE3) -> dict[str, float]:
    """The remaining distance to the goal at the end of Q (N, n), and the largest distance from the screw, m and rad."""
    X = BatchKinematics(tool.robot.model).poses(Q)[:, -1]  # the tool is where the last joint is
    left = pin.SE3(X[-1]).actInv(X_WG)
    screw = ScrewMotion(pin.SE3(X[0]), X_WG)
    on = np.array([screw.pose(s).homogeneous for s in FINE])
    worst = np.zeros(2)
    for pose in X:
        distance = np.linalg.norm(on[:, :3, 3] - pose[:3, 3], axis=1)
        angle = np.linalg.norm(on[:, :3, :3] - pose[:3, :3], axis=(1, 2)) / np.sqrt(2.0)  # 2 sin(angle / 2)
        k = int(np.argmin(distance + ANGLE * angle))
        near = nearest(screw, FINE[k], pin.SE3(pose)).actInv(pin.SE3(pose))
        worst = np.maximum(worst, [np.linalg.norm(near.translation), np.linalg.norm(pin.log3(near.rotation))])
    return {
        "end_m": float(np.linalg.norm(left.translation)),
        "end_rad": float(np.linalg.norm(pin.log3(left.rotation))),
        "off_m": float(worst[0]),
        "off_rad": float(worst[1]),
    }


def nearest(screw: ScrewMotion, s: float, X: pin.SE3) -> pin.SE3:
    """The pose of the screw nearest to X, from a guess s: the rest along the screw's twist is removed."""
    along = pin.log6(screw.X_W0.actInv(screw.X_W1)).vector
    weight = np.repeat([1.0, ANGLE], 3) ** 2
    for _ in range(3):
        left = pin.log6(screw.pose(s).actInv(X)).vector
        s = float(np.clip(s + (weight * along) @ left / ((weight * along) @ along), 0.0, 1.0))
    return screw.pose(s)


def show(rows: dict[str, dict[str, Any]]) -> None:
    """One line a run and scheme."""
    table = Table("run", "scheme", "steps", "end mm / mrad", "off mm / mrad", "past", "where it ends")
    for name, row in rows.items():
        for scheme, r in row.items():
            if r["converged"]:
                end, off = (f"{1e3 * r[k + '_m']:.2g} / {1e3 * r[k + '_rad']:.2g}" for k in ("end", "off"))
                table.add_row(name, scheme, str(r["iterations"]), end, off, str(r["past"]), "")
            else:
                table.add_row(name, scheme, "", "", "", str(r.get("past", "")), place(r))
    Console(width=130).print(table)


def place(r: dict[str, Any]) -> str:
    """In words: why there is no result."""
    if r.get("unreachable"):
        return "the goal is out of reach"
    if r.get("fraction") is None:
        return f"{r['iterations']} steps do not do"
    joint = f", {r['joint']} at its limit" if r.get("joint") else ""
    return f"{100.0 * r['fraction']:.1f} % of the way{joint}"


if __name__ == "__main__":
    main()
