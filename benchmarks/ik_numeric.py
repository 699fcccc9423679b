"""Numeric inverse kinematics of redundant arms: how often, how fast, and beside other libraries in the same run.

    python benchmarks/ik_numeric.py [--poses N]

Poses are those of random configurations within the limits (2,000 unless given), collisions ignored; solved means 1e-6 m
and rad within the limits, by the same forward kinematics for all. OptiPlan solves each pose in a call of its own, as
a pool of configurations gives it starts; `plain` is `solve_ik` from random starts; `prefer` resolves the redundancy
as well, on the first of the poses. Where pin-pink and roboticstoolbox (whose solver is in C) are installed they solve
the same first poses from up to 20 random starts, with the limits on. Ratios are of medians over the same poses. The
last line printed is one JSON object.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import importlib.util
import json
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
from published import script_parser
from rich.console import Console
from rich.table import Table

from optiplan.geometry.poses import pose_error
from optiplan.kinematics.ik.levenberg_marquardt import Descent
from optiplan.kinematics.ik.null_space import AIMS, Preference
from optiplan.kinematics.ik.numeric import IkOptions, random_seeds, solve_ik
from optiplan.robot.robot import Robot, load_robot

ROBOTS = ("panda", "baxter_left")
TOLERANCE = 1e-6
POOL_SIZE, STARTS, OTHERS_STARTS, FEW_POSES, STEPS = 5000, 50, 20, 200, 100
OPTIONS = IkOptions(TOLERANCE, TOLERANCE, count=1)
Solve = Callable[[pin.SE3], np.ndarray]


class SeedPool:
    """Configurations within the limits with the poses that they have, so that a descent can start near its target."""

    def __init__(self, robot: Robot, frame: str, rng: np.random.Generator) -> None:
        self._Q = np.array(random_seeds(robot, np.zeros(robot.n), rng, POOL_SIZE))
        self._features = np.empty((POOL_SIZE, 12))
        descent = Descent(robot, frame)
        for q, row in zip(self._Q, self._features, strict=True):
            row[:] = feature(descent.place(q))
        self._halves = 0.5 * (self._features**2).sum(axis=1)

    def near(self, X_WG: pin.SE3, count: int) -> np.ndarray:
        """The configurations (count, n) with the poses X nearest to X_WG, by |p - p_G|^2 + (0.35 m |R - R_G|)^2.

        The norm of matrices is that of Frobenius; the nearest comes first.
        """
        distances = self._halves - self._features @ feature(X_WG)
        first = np.argpartition(distances, count - 1)[:count]
        return np.asarray(self._Q[first[np.argsort(distances[first])]])


def feature(X: pin.SE3) -> np.ndarray:
    """Twelve numbers whose distance is that of poses: p, m, and 0.35 m R."""
    return np.concatenate([X.translation, 0.35 * X.rotation.ravel()])


def ours(robot: Robot, rng: np.random.Generator) -> dict[str, Solve]:
    """From a pool, from random starts, and with each preference among the solutions."""
    began = time.perf_counter()
    pool = SeedPool(robot, robot.tool_frame, rng)
    print(f"{robot.name}: pool of starts made in {time.perf_counter() - began:.2f} s", file=sys.stderr)

    def solver(options: IkOptions, pooled: bool) -> Solve:
        def solve(X_WG: pin.SE3) -> np.ndarray:
            if pooled:
                seeds = list(pool.near(X_WG, STARTS))
            else:
                seeds = random_seeds(robot, np.zeros(robot.n), rng, 2 * STARTS)
            found = solve_ik(robot, robot.tool_frame, X_WG, seeds, options)
            return found.solutions[0] if found.solutions else found.nearest

        return solve

    result = {"optiplan": solver(OPTIONS, True), "plain": solver(OPTIONS, False)}
    for aim in AIMS:
        reference = next(iter(robot.configurations.values())) if aim == "reference" else None
        options = IkOptions(TOLERANCE, TOLERANCE, count=1, prefer=Preference(aim, reference))
        result[f"prefer {aim}"] = solver(options, True)
    return result


def pink_solver(robot: Robot, rng: np.random.Generator) -> Solve:
    """Pink's differential inverse kinematics, steps of 1 within the joint limits, until the pose is reached."""
    import pink
    from pink.limits import ConfigurationLimit
    from pink.tasks import FrameTask

    task = FrameTask(robot.tool_frame, position_cost=1.0, orientation_cost=1.0, lm_damping=1e-3)
    descent = Descent(robot, robot.tool_frame)

    def solve(X_WG: pin.SE3) -> np.ndarray:
        task.set_target(X_WG)
        for seed in random_seeds(robot, np.zeros(robot.n), rng, OTHERS_STARTS):
            configuration = pink.Configuration(robot.model, robot.model.createData(), seed)
            limits = [ConfigurationLimit(robot.model)]
            for _ in range(STEPS):
                try:
                    velocity = pink.solve_ik(configuration, [task], 1.0, solver="daqp", limits=limits)
                except pink.PinkError:
                    break  # the program has no solution: the next start
                configuration.integrate_inplace(velocity, 1.0)
                if max(pose_error(descent.place(configuration.q), X_WG)) <= TOLERANCE:
                    break
            else:
                continue
            if max(pose_error(descent.place(configuration.q), X_WG)) <= TOLERANCE:
                break
        return np.array(configuration.q)

    return solve


def toolbox_solver(robot: Robot, _rng: np.random.Generator) -> Solve:
    """Roboticstoolbox's Levenberg–Marquardt in C, on the same joints; it draws starts within the limits itself."""
    import roboticstoolbox as rtb

    def fixed(X: pin.SE3) -> Any:
        return rtb.ET.SE3(np.ascontiguousarray(X.homogeneous))  # it reads the memory row by row

    chain: list[Any] = []
    for number, joint in enumerate(robot.model.joints[1:], 1):
        turn = getattr(rtb.ET, f"R{joint.shortname()[-1].lower()}")
        limits = [robot.limits.lower[number - 1], robot.limits.upper[number - 1]]
        chain += [fixed(robot.model.jointPlacements[number]), turn(qlim=limits)]
    frame = robot.model.frames[robot.model.getFrameId(robot.tool_frame)]
    elements = rtb.ETS([*chain, fixed(frame.placement)])
    tolerance = 0.5 * TOLERANCE**2  # of half the squared error

    def solve(X_WG: pin.SE3) -> np.ndarray:
        solution: Any = elements.ik_LM(np.ascontiguousarray(X_WG.homogeneous), slimit=OTHERS_STARTS, tol=tolerance)
        return np.asarray(solution[0])

    return solve


def measure(robot: Robot, solve: Solve, targets: list[pin.SE3]) -> tuple[np.ndarray, float]:
    """Milliseconds for each pose, and the share solved within the limits."""
    descent, seconds, solved = Descent(robot, robot.tool_frame), [], 0
    for X_WG in targets:
        began = time.perf_counter()
        q = solve(X_WG)
        seconds.append(time.perf_counter() - began)
        inside = (robot.limits.lower <= q + 1e-9).all() and (q - 1e-9 <= robot.limits.upper).all()
        solved += bool(inside and max(pose_error(descent.place(q), X_WG)) <= TOLERANCE)
    return 1e3 * np.array(seconds), solved / len(targets)


def compare(robot: Robot, poses: int) -> dict[str, dict[str, float]]:
    """All solvers on the poses of one robot."""
    rng = np.random.default_rng(2026)
    descent = Descent(robot, robot.tool_frame)
    targets = [descent.place(q).copy() for q in random_seeds(robot, np.zeros(robot.n), rng, poses)]
    few = targets[:FEW_POSES]
    solvers = {name: (solve, few if name.startswith("prefer") else targets) for name, solve in ours(robot, rng).items()}
    for package, make in (("pink", pink_solver), ("roboticstoolbox", toolbox_solver)):
        if importlib.util.find_spec(package):
            solvers[package] = (make(robot, rng), few)
    figures: dict[str, dict[str, float]] = {}
    reference = np.empty(0)
    for name, (solve, mine) in solvers.items():
        times, share = measure(robot, solve, mine)
        reference = times if name == "optiplan" else reference
        ratio = float(np.median(times) / np.median(reference[: len(mine)]))
        median, slow = float(np.median(times)), float(np.percentile(times, 95))
        figures[name] = {"poses": len(mine), "solved": share, "median_ms": median, "p95_ms": slow, "ratio": ratio}
    return figures


def main() -> None:
    """Measure, print."""
    parser = script_parser(__doc__)
    parser.add_argument("--poses", type=int, default=2000, help="of each robot")
    poses = parser.parse_args().poses
    result = {}
    for name in ROBOTS:
        result[name] = compare(load_robot(name), poses)
        table = Table(name, "poses", "solved", "median ms", "95 % ms", "median / optiplan's")
        for solver, row in result[name].items():
            cells = [f"{row[key]:.2f}" for key in ("median_ms", "p95_ms", "ratio")]
            table.add_row(solver, str(row["poses"]), f"{100 * row['solved']:.2f} %", *cells)
        Console().print(table)
    print(json.dumps({"tolerance": TOLERANCE, "robots": result}))


if __name__ == "__main__":
    main()
