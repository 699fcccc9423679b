"""Show that via poses are as quick as the same moves of a task, that a tour takes two seconds, that lines keep speed.

Six poses around a table, from `ready` and back, as `via` and as a task of moves: both verified; the vias take no longer
than the moves within 2 %, and no more than half as long again of the processor's time to plan. Then a tour of twelve
poses with a budget of two seconds (of a quiet machine): verified, and with more time no longer. Then lines of a
task with a `speed`: held where it can be, and where not the report names the limit that keeps the tool slower.
"""

import argparse
import sys
import time

import numpy as np
from asked import Figures

import optiplan as op
from optiplan.runs.run import Run

SCENE = op.Scene(
    [
        op.Box("table", size=(0.6, 1.2, 0.04), position=(0.55, 0.0, -0.02)),
        op.Box("left", size=(0.06, 0.06, 0.5), position=(0.72, 0.25, 0.25)),
        op.Box("right", size=(0.06, 0.06, 0.5), position=(0.72, -0.25, 0.25)),
        op.Box("crate", size=(0.2, 0.2, 0.15), position=(0.6, 0.0, 0.075)),
    ]
)

SLOWER, COSTLIER = 1.02, 1.5
"""Of the vias beside the moves, at most: the duration, and the processor time of planning."""


def poses(count: int) -> list[op.Pose]:
    """Return poses around the table, the hand down."""
    radii, heights = (0.5, 0.62, 0.45), (0.2, 0.45, 0.3, 0.5)
    return [
        op.Pose(
            position=(radii[k % 3] * np.cos(angle), radii[k % 3] * np.sin(angle), heights[k % 4]),
            rpy=(np.pi, 0.0, 0.4 * (-1) ** k),
        )
        for k, angle in enumerate(np.linspace(-1.0, 1.0, count))
    ]


def past(count: int) -> op.Problem:
    """Return the problem past as many poses."""
    return op.Problem("panda", "ready", "ready", scene=SCENE, vias=poses(count))


def moves(count: int) -> op.Problem:
    """Return the task of moves to the same poses."""
    task = op.Task()
    for pose in poses(count):
        task = task.move(pose)
    return op.Problem("panda", "ready", scene=SCENE, task=task.move("ready"))


def planned(problem: op.Problem, budget: float) -> tuple[Run, float]:
    """Plan; return the run and the processor time, s."""
    began = time.process_time()
    run = op.plan(problem, budget=budget)
    return run, time.process_time() - began


def speeds_of_lines(figures: Figures, budget: float) -> None:
    """Plan a line of glue at a speed that can be held, and one at a speed that cannot: (m/s, m)."""
    for speed, length, share in ((0.1, 0.4, 0.998), (2.0, 0.1, 0.0)):
        start = op.Pose(position=(0.45, -0.5 * length, 0.3), rpy=(np.pi, 0.0, 0.0))
        task = op.Task().move(start).dwell(0.1).line(by=[0.0, length, 0.0], speed=speed).dwell(0.1)
        run = op.plan(op.Problem("ur5", [0.0, -1.5, 1.5, -1.5, -1.5, 0.0], task=task), budget=budget)
        what = f"a line of {length:g} m at {speed:g} m/s"
        figures.tell(what, "verified", str(run), run.verified)
        checks = [] if run.report is None else [check for check in run.report.checks if check.name == "line speed"]
        for check in checks:
            (line,) = check.witness["lines"]
            held, why = line["held"], line["why"]
            if share > 0.0:
                seen = f"{held:.4f} m/s, {why or 'no reason needed'}"
                figures.tell(f"{what}, held", f">= {share * speed:.4f} m/s", seen, held >= share * speed and not why)
            else:
                good = held < speed and "limit" in why and why in check.detail
                figures.tell(f"{what}, held", "less, and the report says why", f"{held:.3f} m/s: {why}", good)
        figures.tell(f"{what}, checks of its speed", 1, len(checks))


def main() -> int:
    """Print each figure, required and measured; return 1 where one is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--budget", type=float, default=30.0, help="s, for the comparison (default: %(default)s)")
    parser.add_argument("--short", type=float, default=2.0, help="s, for the tour (default: %(default)s)")
    options = parser.parse_args()
    figures = Figures()
    op.plan(op.load_problem("01_reach"), budget=1.0)  # libraries are loaded
    planned(moves(1), 5.0)
    print("six poses as vias and as moves", file=sys.stderr)
    vias, own = planned(past(6), options.budget)
    task, other = planned(moves(6), options.budget)
    figures.tell("six vias", "verified", str(vias), vias.verified)
    figures.tell("the same as moves", "verified", str(task), task.verified)
    if vias.verified and task.verified:
        most = SLOWER * task.duration
        figures.tell("duration of the vias", f"<= {most:.3f} s", f"{vias.duration:.3f} s", vias.duration <= most)
    figures.tell("processor time of the vias", f"<= {COSTLIER * other:.2f} s", f"{own:.2f} s", own <= COSTLIER * other)
    print(f"a tour of twelve poses in {options.short:g} s, then in {options.budget:g} s", file=sys.stderr)
    short, _ = planned(past(12), options.short)
    figures.tell("tour in a short budget", "verified", str(short), short.verified)
    whole, _ = planned(past(12), options.budget)
    figures.tell("tour in a long budget", "verified", str(whole), whole.verified)
    if short.verified and whole.verified:
        good = whole.duration <= 1.001 * short.duration
        figures.tell("with more time", f"<= {short.duration:.3f} s", f"{whole.duration:.3f} s", good)
        answers = ", ".join(f"{duration:.3f} s after {seconds:.2f} s" for seconds, duration in whole.improvements)
        figures.tell("verified motions on the way", "more than one", answers, len(whole.improvements) > 1)
    print("lines with a speed", file=sys.stderr)
    speeds_of_lines(figures, options.budget)
    return figures.exit_code


if __name__ == "__main__":
    sys.exit(main())
