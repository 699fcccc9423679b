"""Pose goals: the end free in the goal against the nearest configuration that reaches it, fixed.

    python benchmarks/free_ends.py                    # 100 goals, about a quarter of an hour
    python benchmarks/free_ends.py --count 10 --position 0.02 --orientation 0.3

The Panda among a shelf and a post; poses are drawn at random in front of it, those that it cannot reach freely are
drawn again. *Fixed* is the free configuration nearest to the start in time, of up to 24 found by inverse kinematics;
*free* is the pose with its tolerances as goal. Printed: durations free / fixed, and the share of motions that the
attempt with a free end (`end`) improved at last.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
from pathlib import Path

import numpy as np
from published import percentiles, print_json, print_table, write_markdown
from rich.console import Console
from rich.progress import track

import optiplan as op
from optiplan.collision.native_model import planning_model
from optiplan.problem.goals import goal_configurations

SCENE = [
    op.Box("shelf", size=(0.4, 0.8, 0.02), position=(0.6, 0.0, 0.35)),
    op.Box("post", size=(0.05, 0.05, 0.8), position=(0.4, 0.3, 0.4)),
]
HEADINGS = ("goals", "verified both", "free / fixed 10 / 50 / 90", "end attempted")


def drawn(rng: np.random.Generator, tolerance: tuple[float, float]) -> tuple[op.Problem, np.ndarray]:
    """Return a problem with a random reachable pose, and the nearest configuration in it."""
    while True:
        position = rng.uniform(0.3, 0.6), rng.uniform(-0.5, 0.5), rng.uniform(0.45, 0.7)
        rpy = np.pi + rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), rng.uniform(-1.0, 1.0)
        goal = op.Pose(position, rpy=rpy, position_tolerance=tolerance[0], orientation_tolerance=tolerance[1])
        problem = op.Problem("panda", start="ready", goal=goal, scene=SCENE)
        model = planning_model(problem.robot, problem.scene)
        found = goal_configurations(problem, model, np.random.default_rng(0)).configurations
        if found:
            return problem, found[0]


def main() -> None:
    """Plan both of each and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100, help="goals")
    parser.add_argument("--budget", type=float, default=4.0, help="s, of each of the two")
    parser.add_argument("--position", type=float, default=1e-4, help="tolerance, m")
    parser.add_argument("--orientation", type=float, default=1e-3, help="tolerance, rad")
    parser.add_argument("--markdown", type=Path, help="file for the table")
    arguments = parser.parse_args()
    rng, found = np.random.default_rng(0), []  # type: tuple[np.random.Generator, list[dict[str, Any]]]
    for _ in track(range(arguments.count), console=Console(stderr=True)):
        problem, nearest = drawn(rng, (arguments.position, arguments.orientation))
        fixed, free = (op.plan(one, budget=arguments.budget) for one in (problem.with_goal(nearest), problem))
        both = fixed.verified and free.verified
        ratio = (free.duration or np.nan) / (fixed.duration or np.nan) if both else None
        ended = any(attempt["seed"] == "end" for attempt in free.info["attempts"])
        found.append({"both": both, "ratio": ratio, "ended": ended, "free": free.duration, "fixed": fixed.duration})
    ratios = " / ".join(f"{value:.3f}" for value in percentiles([one["ratio"] for one in found], 10, 50, 90))
    row = [str(len(found)), str(sum(one["both"] for one in found)), ratios, str(sum(one["ended"] for one in found))]
    print_table(HEADINGS, [row])
    write_markdown(arguments.markdown, HEADINGS, [row])
    print_json({"budget": arguments.budget, "runs": found})


if __name__ == "__main__":
    main()
