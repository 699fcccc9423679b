"""Pose goals: the end free in the goal against the nearest configuration that reaches the pose, fixed.

    python benchmarks/free_ends.py                    # 100 goals, about 20 minutes
    python benchmarks/free_ends.py --count 10

The Panda among a shelf and a post; poses are drawn at random in front of it, those that it cannot reach freely are
drawn again. *Fixed* is the free configuration nearest to the start in time, of up to 32 found by inverse kinematics for
the pose itself; *free* are goals about this pose, from the pose alone (what is free then is the arm's redundancy, one
degree of freedom) to any turn about the tool's axis. Printed of each: durations free / fixed, and what the free motion
takes over the least lower bound of any end that was found in the goal: near 1, no choice of the end would gain more.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

from typing import Any

import numpy as np
from published import finish, percentiles, table_parser
from rich.console import Console
from rich.progress import track

import optiplan as op
from optiplan.collision.native_model import planning_model
from optiplan.planners.common.goal_ranking import GoalSampler
from optiplan.problem.goals import goal_configurations

SCENE = [
    op.Box("shelf", size=(0.4, 0.8, 0.02), position=(0.6, 0.0, 0.35)),
    op.Box("post", size=(0.05, 0.05, 0.8), position=(0.4, 0.3, 0.4)),
]
GOALS = {
    "pose, 0.1 mm, 1 mrad": lambda p, rpy: op.Pose(p, rpy=rpy),
    "pose, 5 mm, 0.05 rad": lambda p, rpy: op.Pose(p, rpy=rpy, position_tolerance=0.005, orientation_tolerance=0.05),
    "pose, 2 cm, 0.2 rad": lambda p, rpy: op.Pose(p, rpy=rpy, position_tolerance=0.02, orientation_tolerance=0.2),
    "any turn about the tool's axis": lambda p, rpy: op.Region(p, rpy=rpy, about={"z": "free"}),
    "the same, axis within 0.1 rad, 5 mm": lambda p, rpy: op.Region(
        p, rpy=rpy, along=dict.fromkeys("xyz", 0.005), about={"x": 0.1, "y": 0.1, "z": "free"}
    ),
}
HEADINGS = ("goal", "goals", "verified both", "free / fixed 10 / 50 / 90", "free / least bound of an end, median")
MORE = 24
"""Further configurations of a goal, from each of which the end is moved towards the start."""


def drawn(rng: np.random.Generator) -> tuple[list[op.Problem], op.Problem]:
    """Return the problems with a random reachable pose as each kind of goal, and that of the nearest configuration."""
    while True:
        position = rng.uniform(0.3, 0.6), rng.uniform(-0.5, 0.5), rng.uniform(0.45, 0.7)
        rpy = np.pi + rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), rng.uniform(-1.0, 1.0)
        free = [op.Problem("panda", start="ready", goal=make(position, rpy), scene=SCENE) for make in GOALS.values()]
        model = planning_model(free[0].robot, free[0].scene)
        found = goal_configurations(free[0], model, np.random.default_rng(0)).configurations
        if found:
            return [one.with_parts(clearance=0) for one in free], free[0].with_parts(goal=found[0], clearance=0)


def least_bound(problem: op.Problem) -> float:
    """Return the least lower bound, s, of the ends found in the goal, each moved towards the start."""
    model = planning_model(problem.robot, problem.scene)
    ends = GoalSampler(problem, model, 0)
    ends.more(MORE)
    return float(min(problem.lower_bounds(ends.configurations)))


def main() -> None:
    """Plan all of each and print the table."""
    parser = table_parser(__doc__)
    parser.add_argument("--count", type=int, default=100, help="goals")
    parser.add_argument("--budget", type=float, default=3.0, help="s, of each plan")
    arguments = parser.parse_args()
    rng, found = np.random.default_rng(0), {name: [] for name in GOALS}  # type: tuple[Any, dict[str, list[Any]]]
    for _ in track(range(arguments.count), console=Console(stderr=True)):
        problems, nearest = drawn(rng)
        fixed = op.plan(nearest, budget=arguments.budget)
        for name, problem in zip(GOALS, problems, strict=True):
            free = op.plan(problem, budget=arguments.budget)
            both = fixed.verified and free.verified
            row = {"both": both, "free": free.duration, "fixed": fixed.duration, "bound": least_bound(problem)}
            found[name].append(row)
    rows = [[name, *summary(ones)] for name, ones in found.items()]
    finish(arguments.markdown, HEADINGS, rows, {"budget": arguments.budget, "runs": found})


def summary(ones: list[dict[str, Any]]) -> list[str]:
    """Return the cells of one kind of goal."""
    both = [one for one in ones if one["both"]]
    ratios = percentiles([one["free"] / one["fixed"] for one in both], 10, 50, 90)
    (left,) = percentiles([one["free"] / one["bound"] for one in both], 50)
    return [str(len(ones)), str(len(both)), " / ".join(f"{value:.3f}" for value in ratios), f"{left:.3f}"]


if __name__ == "__main__":
    main()
