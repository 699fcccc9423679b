"""Make problems for Baxter's both arms among the scenes of MotionBenchMaker, since its own set is not published here.

    python benchmarks/both_arms.py problems/      # 7 sets of 10 problems; then, for instance:
    optiplan bench run problems/*/*.yaml

Each scene is one of Panda's sets, moved in front of Baxter. The start is `ready`. The goal is the first configuration,
of those drawn from one stream of numbers, in which both hands are among the obstacles, nothing touches and the motors
hold the arms. `first_answer.py` measures them as the robot `baxter`. With `--inside` the start is another such
configuration: on the way, gravity alone is often too much for the shoulders.
"""

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from published import import_sets

import optiplan as op
from optiplan.planners.common.gravity import Gravity
from optiplan.robot.frames import frame_poses

AHEAD = {"box": 0.6, "cage": 0.62}
"""m, by which scenes are moved ahead where it is not `USUAL`."""
USUAL = 0.4
AROUND = 0.15
"""m, about the places of obstacles, where hands are to be."""
DRAWN, TRIED = 6000, 12
"""Configurations drawn for each arm, and those of each that are combined."""
HELD = 0.9
"""Share of the torque limits that gravity may take at the goal."""


def main() -> int:
    """Write the problems into a folder; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--every", type=int, default=5, help="every k-th scene of each set")
    parser.add_argument("--inside", action="store_true", help="start among the obstacles, too")
    arguments = parser.parse_args()
    found = both_arms(arguments.folder, arguments.every, inside=arguments.inside)
    print(f"{sum(map(len, found.values()))} problems in {arguments.folder}", file=sys.stderr)
    return 0


def both_arms(folder: Path, every: int = 1, offset: int = 0, *, inside: bool = False) -> dict[str, list[Path]]:
    """Return files of problems by set, one for each scene in which a goal is found, and a start `inside`."""
    robot, rng = op.load_robot("baxter"), np.random.default_rng(0)
    found: dict[str, list[Path]] = {}
    with tempfile.TemporaryDirectory() as scenes:
        for name, files in import_sets("panda", Path(scenes), every, offset).items():
            (folder / name).mkdir(parents=True, exist_ok=True)
            found[name] = []
            for file in files:
                obstacles = yaml.safe_load(file.read_text())["scene"]["obstacles"]
                goal = free_goal(robot, moved(obstacles, AHEAD.get(name, USUAL)), rng)
                start = free_goal(robot, obstacles, rng) if inside else robot.configurations["ready"]
                if goal is not None and start is not None:
                    path = folder / name / file.name
                    path.write_text(yaml.safe_dump(statement(obstacles, start.round(5), goal.round(5))))
                    found[name].append(path)
    return found


def statement(obstacles: list[dict[str, Any]], start: np.ndarray, goal: np.ndarray) -> dict[str, Any]:
    """Return what a problem file says."""
    ends = {"start": {"joints": start.tolist()}, "goal": {"joints": goal.tolist()}}
    return {"version": 1, "robot": "baxter", **ends, "scene": {"obstacles": obstacles}}


def moved(obstacles: list[dict[str, Any]], ahead: float) -> list[dict[str, Any]]:
    """Move obstacles ahead, m, in place, with names that the robot does not use."""
    for obstacle in obstacles:
        obstacle["name"] = f"obstacle {obstacle['name']}"
        obstacle["pose"]["position"][0] += ahead
    return obstacles


def free_goal(robot: op.Robot, obstacles: list[dict[str, Any]], rng: np.random.Generator) -> np.ndarray | None:
    """Return a configuration (14,) with both hands among the obstacles; None where none of those drawn is free."""
    ready = robot.configurations["ready"]
    try:
        problem = op.load_problem(statement(obstacles, ready, ready + 0.01))
    except op.InputError:  # `ready` is in collision
        return None
    places = np.array([obstacle["pose"]["position"] for obstacle in obstacles])
    low, high, gravity = places.min(axis=0) - AROUND, places.max(axis=0) + AROUND, Gravity(robot, robot.limits.torque)
    arms = []
    for side, hand in enumerate(("left_gripper", "right_gripper")):
        own = slice(7 * side, 7 * side + 7)
        Q = np.repeat(ready[None], DRAWN, axis=0)
        Q[:, own] = rng.uniform(robot.limits.lower, robot.limits.upper, (DRAWN, robot.n))[:, own]
        p = frame_poses(robot, Q, hand)[:, :3, 3]
        Q = Q[((p > low) & (p < high)).all(axis=1)]
        Q = Q[problem.is_free(Q).free] if len(Q) else Q
        held = (np.abs([gravity.torque(q) for q in Q]) < HELD * robot.limits.torque).all(axis=1) if len(Q) else []
        arms.append(Q[np.asarray(held, dtype=bool)][:TRIED, own])
    both = np.array([np.concatenate(pair) for pair in ((a, b) for a in arms[0] for b in arms[1])]).reshape(-1, 14)
    free = both[problem.is_free(both).free] if len(both) else both
    return free[0] if len(free) else None


if __name__ == "__main__":
    sys.exit(main())
