"""Ways to time one and the same path: duration over the fastest without jerk limits, and time to compute, in one run.

    python benchmarks/timing.py                    # 28 paths of rrtconnect on MotionBenchMaker, rounded corners
    python benchmarks/timing.py --jerk 0.1         # the same with a tenth of the robot's jerk limits

`fit` is another kind of method, for comparison: a cubic B-spline through samples of TOPP-RA's motion as control points,
slowed down to hold. It leaves the path, so that its collisions would have to be checked again; the others do not.
The last line printed is one JSON object.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import json
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from optiplan.importers.motion_bench_maker import import_mbm
from optiplan.planners.base import Budget
from optiplan.problem.load import load_problem
from optiplan.robot.robot import Limits, Robot
from optiplan.runs.pipeline import run
from optiplan.trajectory.paths.corners import blend_path
from optiplan.trajectory.timing.time_path import TimingOptions, time_path
from optiplan.trajectory.timing.time_scaling import scale_to_limits
from optiplan.trajectory.trajectory import Trajectory

SHARED = Path(os.environ.get("OPTIPLAN_SHARED", Path(__file__).parents[2] / "shared"))
Timer = Callable[[Trajectory, Robot, Limits], Trajectory | None]


def fit(path: Trajectory, robot: Robot, limits: Limits) -> Trajectory:
    """A uniform cubic B-spline whose control points are samples of TOPP-RA's motion, h = max 2 a / j apart."""
    fast = time_path(path, robot, limits, TimingOptions("toppra"))
    assert fast is not None
    h = max(float((2.0 * limits.acceleration / limits.jerk).max()), 4e-3)
    count = int(np.ceil(fast.duration / h))
    samples = fast(np.linspace(0.0, fast.duration, count + 1))
    control = np.vstack([path.start, path.start, samples, path.end, path.end])
    knots = fast.duration / count * (np.arange(len(control) + 4) - 3.0)
    return scale_to_limits(Trajectory.from_bspline(path.joint_names, knots, control, 3), limits)


METHODS: dict[str, Timer] = {
    "toppra": lambda path, robot, limits: time_path(path, robot, limits, TimingOptions("toppra")),
    "jerk": lambda path, robot, limits: time_path(path, robot, limits, TimingOptions("jerk")),
    "uniform": lambda path, robot, limits: time_path(path, robot, limits, TimingOptions("uniform")),
    "fit": fit,
}


def paths(count: int, jerk: float) -> list[tuple[Trajectory, Robot, Limits]]:
    """Rounded paths of rrtconnect on the first `count` problems of each set, with the limits to keep."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        source = str(SHARED / "robots" / "mbm_panda" / "robot.yaml")
        written = sorted(import_mbm(SHARED / "mbm" / "panda", folder, source).written)
        for parent in sorted({file.parent for file in written}):
            for file in [file for file in written if file.parent == parent][:count]:
                problem = load_problem(file)
                motion = run(problem, "rrtconnect", {}, Budget(20.0), lambda stage, share: None).trajectory
                if motion is None:
                    continue
                limits = replace(problem.limits, jerk=problem.limits.jerk * jerk)
                # The corners of the answer, as far as a straight line between samples shows them.
                corners = corners_of(motion(np.linspace(0.0, motion.duration, 400)))
                path = blend_path(corners, np.ones(len(corners) - 2), limits, motion.joint_names)
                found.append((path, problem.robot, limits))
    return found


def corners_of(points: np.ndarray, tolerance: float = 0.02) -> np.ndarray:
    """Fewest of the points (k, n) whose polyline stays within the tolerance, rad, by halving (Douglas & Peucker)."""
    a, d = points[0], points[-1] - points[0]
    along = np.clip((points - a) @ d / max(float(d @ d), 1e-12), 0.0, 1.0)
    off = np.linalg.norm(points - a - along[:, None] * d, axis=1)
    worst = int(off.argmax())
    if off[worst] < tolerance:
        return points[[0, -1]]
    return np.vstack([corners_of(points[: worst + 1], tolerance)[:-1], corners_of(points[worst:], tolerance)])


def main() -> None:
    """Time, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=4, help="problems of each set")
    parser.add_argument("--jerk", type=float, default=1.0, help="share of the robot's jerk limits")
    arguments = parser.parse_args()
    rows = []
    for path, robot, limits in paths(arguments.count, arguments.jerk):
        row: dict[str, dict[str, float]] = {}
        for name, method in METHODS.items():
            began = time.process_time()
            motion = method(path, robot, limits)
            assert motion is not None
            seconds = time.process_time() - began
            row[name] = {"duration": motion.duration, "s": seconds}
        rows.append(row)
    summary = {name: summarise([row[name] for row in rows], [row["toppra"] for row in rows]) for name in METHODS}
    for name, figures in summary.items():
        print(name.ljust(8), "  ".join(f"{key} {value:.4g}" for key, value in figures.items()))
    print(json.dumps({"jerk": arguments.jerk, "paths": len(rows), "methods": summary, "runs": rows}))


def summarise(own: list[dict[str, float]], fastest: list[dict[str, float]]) -> dict[str, float]:
    """Duration over that of TOPP-RA, and time to compute it."""
    ratio = [a["duration"] / b["duration"] for a, b in zip(own, fastest, strict=True)]
    return {
        "ratio_median": float(np.median(ratio)),
        "ratio_worst": float(np.max(ratio)),
        "ms_median": 1e3 * float(np.median([row["s"] for row in own])),
    }


if __name__ == "__main__":
    main()
