"""Closed-form inverse kinematics: branches found, worst pose error, poses solved per minute.

    python benchmarks/ik_closed_form.py                        # 10,000 configurations a robot, some seconds on one core
    python benchmarks/ik_closed_form.py --count 1000 --robots srra ur5

For each robot, configurations are drawn uniformly from (-pi, pi]^6, in general and within DISTANCE of singularities;
the pose of each is solved and every branch is put through forward kinematics. *Found*: the configuration itself is
among the branches to 1e-6 rad (at singularities a joint may be free, and no configuration is the one). *Speed*: the
best of three batch calls, one thread. The last line printed is one JSON object.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import json
import time
from typing import Any

import numpy as np
import pinocchio as pin
from rich.console import Console
from rich.table import Table

from optiplan.arrays import Array
from optiplan.kinematics.ik.closed_form import ClosedForm, Solutions, closed_form
from optiplan.robot.robot import Robot, load_robot

GROUPS = {"srra": None, "puma560": None, "ur5": None, "ur3": None, "delbot": "arm"}
DISTANCE = 1e-6
NEAR = ("wrist", "elbow", "shoulder", "wrist+elbow")


def main() -> None:
    """Solve, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=10_000, help="configurations a robot and singularity")
    parser.add_argument("--robots", nargs="*", default=list(GROUPS), choices=list(GROUPS))
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    rows = {name: measure(name, arguments.count, arguments.seed) for name in arguments.robots}
    show(rows)
    print(json.dumps({"count": arguments.count, "distance": DISTANCE, "threads": 1, "robots": rows}))


def measure(name: str, count: int, seed: int) -> dict[str, Any]:
    """Everything about one robot."""
    robot = load_robot(name, group=GROUPS[name])
    solver, rng = closed_form(robot), np.random.default_rng(seed)
    assert solver is not None, f"{name} has no closed form"
    Q = rng.uniform(-np.pi, np.pi, (count, 6))
    result: dict[str, Any] = {"anywhere": judge(robot, solver, Q)}
    for kinds in NEAR:
        result[kinds] = judge(robot, solver, beside(solver, Q, kinds, rng))
    X = solver.forward(Q)
    best = min(timed(solver, X) for _ in range(3))
    return result | {"poses_per_minute": round(60.0 * count / best)}


def timed(solver: ClosedForm, X: Array) -> float:
    """Seconds of one batch call."""
    begin = time.perf_counter()
    solver.solve(X)
    return time.perf_counter() - begin


def beside(solver: ClosedForm, Q: Array, kinds: str, rng: np.random.Generator) -> Array:
    """Configurations Q (N, 6), rad, moved to within DISTANCE of singularities."""
    g, away, Q = solver.geometry, rng.uniform(-DISTANCE, DISTANCE, (3, len(Q))), Q.copy()
    if "wrist" in kinds:
        Q[:, 4] = np.pi * rng.integers(0, 2, len(Q)) - g.zero + away[0]
    if "elbow" in kinds:
        Q[:, 2] = g.signs[0] * (np.angle(g.upper) - np.angle(g.fore) + away[1])
    if "shoulder" in kinds:  # the wrist point comes over axis 1, as far as the arm's own offsets let it
        hand = 0.0 if g.spherical else np.exp(1j * g.signs[1] * Q[:, 3]) * g.hand
        Q[:, 1] = away[2] - np.angle(g.upper + np.exp(1j * g.signs[0] * Q[:, 2]) * (g.fore + hand))
    return Q


def judge(robot: Robot, solver: ClosedForm, Q: Array) -> dict[str, Any]:
    """Solve the poses of Q (N, 6) and look at every branch, poses and errors by pinocchio."""
    X = by_pinocchio(robot, Q)
    found = solver.solve(X)
    errors = check(robot, X, found)
    turns = np.abs((found.q - Q[:, None] + np.pi) % (2.0 * np.pi) - np.pi).max(-1)
    own = np.where(found.valid, turns, np.inf).min(1)
    counts = np.bincount(found.valid.sum(1), minlength=9)
    return {
        "solved": float(found.valid.any(1).mean()),
        "found": float((own < 1e-6).mean()),
        "branches": {str(k): int(n) for k, n in enumerate(counts) if n},
        "worst_position_m": float(errors[:, 0].max()),
        "worst_angle_rad": float(errors[:, 1].max()),
    }


def check(robot: Robot, X: Array, found: Solutions) -> Array:
    """Position (m) and angle (rad) errors of the valid branches: (M, 2)."""
    rows, columns = np.nonzero(found.valid)
    reached = by_pinocchio(robot, found.q[rows, columns])
    distance = np.linalg.norm(reached[:, :3, 3] - X[rows, :3, 3], axis=1)
    R = reached[:, :3, :3].transpose(0, 2, 1) @ X[rows, :3, :3]
    twice_sine = np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1)
    trace = np.trace(R, axis1=1, axis2=2)
    return np.stack([distance, np.arctan2(np.linalg.norm(twice_sine, axis=1), trace - 1.0)], axis=1)


def by_pinocchio(robot: Robot, Q: Array) -> Array:
    """X_WT of the tool frame at configurations Q (N, 6), one at a time."""
    data, frame = robot.model.createData(), robot.model.getFrameId(robot.tool_frame)
    poses = np.empty((len(Q), 4, 4))
    for k, q in enumerate(Q):
        pin.framesForwardKinematics(robot.model, data, q)
        poses[k] = data.oMf[frame].homogeneous
    return poses


def show(rows: dict[str, dict[str, Any]]) -> None:
    """One line a robot and region."""
    table = Table("robot", "where", "solved", "found", "branches", "worst m", "worst rad", "poses a minute")
    for name, row in rows.items():
        for where in ("anywhere", *NEAR):
            r = row[where]
            branches = ", ".join(f"{k}: {n}" for k, n in r["branches"].items())
            speed = f"{row['poses_per_minute']:,}" if where == "anywhere" else ""
            worst = (f"{r['worst_position_m']:.1e}", f"{r['worst_angle_rad']:.1e}")
            table.add_row(name, where, f"{r['solved']:.2%}", f"{r['found']:.2%}", branches, *worst, speed)
    Console(width=130).print(table)


if __name__ == "__main__":
    main()
