"""A full cup across shelves and tables: `trajopt` and `rrtconnect` with a 10° cone beside OMPL, in one run.

    python benchmarks/full_cup.py                    # 35 problems of MotionBenchMaker's Panda, about twenty minutes
    python benchmarks/full_cup.py --count 2 --budget 5

Scene and goal are MotionBenchMaker's (shelves and tables; `$OPTIPLAN_SHARED/mbm/panda`). The cup's axis is the
direction of the hand that points up at the goal. The start is the first free configuration at least 0.3 m away that
holds the hand as at the goal, turned about the vertical by a random angle; it depends on the problem's number alone.
OMPL searches on ProjectedStateSpace with the constraint max(0, cos 9.5° - a · z) = 0, the same collision model, and
no joint limits but those of position; its path is simplified by OMPL and timed by `timed_path`. Both motions are
judged by the verifier, and the ratio is duration over the lower bound of the two ends.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from published import finish, import_sets, table_parser
from rich.console import Console
from rich.progress import track

import optiplan as op
from optiplan.collision.native_model import planning_model
from optiplan.planners.common.path_timing import timed_path
from optiplan.problem.goals import GoalOptions, goal_configurations
from optiplan.problem.problem import derived
from optiplan.trajectory.timing.lower_bound import lower_bound
from optiplan.trajectory.trajectory import Trajectory

SETS = ("bookshelf_small", "bookshelf_tall", "bookshelf_thin", "table_pick", "table_under_pick")
CONE, INNER = np.radians(10.0), np.radians(9.5)
APART = 0.3  # m, between the tool at the start and at the goal
IN_A_SET = 50  # problems
TRIES = 200
FEW = GoalOptions(count=1, solutions=2, attempts=5)
DELTA = 0.05  # rad, of OMPL's steps on the constraint
OURS = ("trajopt", "rrtconnect")
HEADINGS = ("planner", "n", "verified", "plan s 50 / 95", "ratio 50 / 90")


def carried(problem: op.Problem, seed: int) -> op.Problem | None:
    """Return the problem with a start that holds the cup, and the cone; None where no such start is found."""
    model = planning_model(problem.robot, problem.scene)
    rng = np.random.default_rng(seed)
    goals = goal_configurations(problem, model, rng).configurations
    if not goals:
        return None
    robot, goal = problem.robot, goals[0]
    data, frame = robot.model.createData(), robot.frame_id(robot.tool_frame)
    pin.framesForwardKinematics(robot.model, data, goal)
    X = data.oMf[frame].copy()
    cone = op.OrientationCone(robot.tool_frame, X.rotation.T @ [0.0, 0.0, 1.0], np.array([0.0, 0.0, 1.0]), CONE)
    for _ in range(TRIES):
        p = np.array([rng.uniform(0.2, 0.7), rng.uniform(-0.6, 0.6), rng.uniform(0.2, 0.9)])
        if np.linalg.norm(p - X.translation) < APART:
            continue
        pose = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, rng.uniform(-np.pi, np.pi)) @ X.rotation, p)
        there = derived(problem, goal=(op.PoseGoal(robot.tool_frame, pose),))
        starts = goal_configurations(there, model, rng, FEW).configurations
        if starts:
            return problem.with_goal(goal).with_start(starts[0]).with_constraints(cone)
    return None


def projected(problem: op.Problem, budget: float, seed: int) -> Trajectory | None:
    """Return the timed path of OMPL's RRT-Connect on the projected state space; None where it finds none."""
    from ompl import base, geometric, util

    util.setLogLevel(util.LOG_NONE)
    util.RNG.setSeed(seed + 1)
    robot, model, n = problem.robot, planning_model(problem.robot, problem.scene), problem.robot.n
    data, frame = robot.model.createData(), robot.frame_id(robot.tool_frame)
    (cone,) = problem.path_constraints
    axis = cone.axis  # type: ignore[attr-defined]

    class Cone(base.Constraint):  # type: ignore[misc]  # ompl has no types
        def __init__(self) -> None:
            super().__init__(n, 1)

        def function(self, q: Any, out: Any) -> None:
            pin.framesForwardKinematics(robot.model, data, np.array(q))
            out[0] = max(0.0, np.cos(INNER) - (data.oMf[frame].rotation @ axis)[2])

        def jacobian(self, q: Any, out: Any) -> None:
            J = pin.computeFrameJacobian(robot.model, data, np.array(q), frame, pin.LOCAL_WORLD_ALIGNED)
            up = data.oMf[frame].rotation @ axis
            out[0, :] = -np.cross(J[3:].T, up)[:, 2] if up[2] < np.cos(INNER) else 0.0

    ambient, bounds = base.RealVectorStateSpace(n), base.RealVectorBounds(n)
    for j in range(n):
        bounds.setLow(j, float(problem.limits.lower[j]))
        bounds.setHigh(j, float(problem.limits.upper[j]))
    ambient.setBounds(bounds)
    space = base.ProjectedStateSpace(ambient, Cone())
    information = base.ConstrainedSpaceInformation(space)
    space.setDelta(DELTA)
    information.setStateValidityChecker(lambda state: not model.collides(np.array([state[j] for j in range(n)])))
    information.setup()
    stated, ends = base.ProblemDefinition(information), []
    for q in (problem.start, problem.goal[0].q):  # type: ignore[union-attr]
        state = space.allocState()
        state.copy(np.array(q))
        ends.append(state)
    stated.setStartAndGoalStates(*ends, 1e-3)
    planner = geometric.RRTConnect(information)
    planner.setProblemDefinition(stated)
    planner.setup()
    if not planner.solve(base.timedPlannerTerminationCondition(budget)) or not stated.hasExactSolution():
        return None
    path = stated.getSolutionPath()
    geometric.PathSimplifier(information).simplifyMax(path)
    path.interpolate()
    way = np.array([[path.getState(i)[j] for j in range(n)] for i in range(path.getStateCount())])
    way[0], way[-1] = problem.start, problem.goal[0].q  # type: ignore[union-attr]
    return timed_path(model, way, problem.limits, op.Budget(budget))


def row(name: str, found: list[dict[str, Any]]) -> list[str]:
    """Return the table's row of one planner."""
    good = [one for one in found if one["verified"]]
    seconds, ratios = ([one[key] for one in good] or [np.nan] for key in ("seconds", "ratio"))
    times = " / ".join(f"{np.percentile(seconds, at):.2f}" for at in (50, 95))
    return [
        name,
        str(len(found)),
        str(len(good)),
        times,
        " / ".join(f"{np.percentile(ratios, k):.3f}" for k in (50, 90)),
    ]


def main() -> None:
    """Run the benchmark and print its table."""
    parser = table_parser(__doc__)
    parser.add_argument("--count", type=int, default=35, help="problems")
    parser.add_argument("--budget", type=float, default=10.0, help="s, of each planner on each problem")
    arguments = parser.parse_args()
    console, found = Console(stderr=True), {name: [] for name in (*OURS, "projected RRT-Connect (OMPL)")}  # type: dict[str, list[dict[str, Any]]]
    with tempfile.TemporaryDirectory() as folder:
        each = -(-arguments.count // len(SETS))
        sets = import_sets("panda", Path(folder), every=max(1, IN_A_SET // each))
        files = [file for name in SETS for file in sets[name][:each]]
        for number, file in enumerate(track(files[: arguments.count], console=console)):
            try:
                problem = carried(op.load_problem(file), number)
            except op.InputError:
                problem = None
            if problem is None:
                console.print(f"{file.parent.name}/{file.stem}: no start that holds the cup")
                continue
            bound = lower_bound(problem.start, problem.goal[0].q, problem.limits)  # type: ignore[union-attr]
            for name in OURS:
                run = op.plan(problem, name, budget=arguments.budget)
                why = [run.failure.kind] if run.failure else [check.name for check in run.report.failures if run.report]
                entry = {"name": file.stem, "verified": run.verified, "seconds": run.timings["plan"], "refused": why}
                found[name].append({**entry, "ratio": (run.duration or np.nan) / bound})
            began = time.perf_counter()
            motion = projected(problem, arguments.budget, number)
            entry = {"name": file.stem, "seconds": time.perf_counter() - began}
            report = None if motion is None else op.verify(problem, motion)
            entry["verified"] = report is not None and report.verified
            entry["refused"] = [] if report is None else [check.name for check in report.failures]
            entry["ratio"] = np.nan if motion is None else motion.duration / bound
            found["projected RRT-Connect (OMPL)"].append(entry)
            told = [
                f"{one[-1]['seconds']:.2f} s, {one[-1]['ratio']:.3f}, {one[-1]['verified'] or one[-1]['refused']}"
                for one in found.values()
            ]
            console.print(f"{file.parent.name}/{file.stem}: {' | '.join(told)}")
    rows = [row(name, entries) for name, entries in found.items()]
    finish(arguments.markdown, HEADINGS, rows, {"budget": arguments.budget, **found})


if __name__ == "__main__":
    main()
