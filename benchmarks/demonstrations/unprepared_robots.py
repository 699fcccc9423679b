"""Robots that nobody prepared: `robots init`, then six pose goals each between obstacles, planned and proved.

    python benchmarks/demonstrations/unprepared_robots.py                  # six arms; minutes, most of them init
    python benchmarks/demonstrations/unprepared_robots.py --robots xarm7 --count 2

The arms are those of example-robot-data (extra `robots`). Each is made by `optiplan robots init` from its URDF. Starts
and goals are free configurations drawn with a seed; a goal is the tool's pose at one. Balls stand where no drawn end
of the robot touches them. Every problem is planned by the planner of the problem file, with the default seed.

Required of each arm: every goal verified, the median of plan and proof at most 0.3 s, of the proof alone 50 ms; the
report separates the clearance from the scene from that of the robot from itself. Times are wall times: meant for a
quiet core. The first problem of each arm is planned once more before: code and hulls are loaded then, as in a program
that stays.
"""

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import yaml

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.geometry.scene import Obstacle, Scene
from optiplan.geometry.shapes import Sphere
from optiplan.robot.description_files import package_robots

ARMS = ("xarm7", "ur10", "kinova", "ur5", "z1", "panda")
"""In example-robot-data; there is no iiwa in it, `panda` is the arm of seven joints that is nearest to one."""

PLAN_AND_PROOF, PROOF = 0.3, 0.05
"""s, required of the medians."""

RADIUS, BALLS = 0.08, 4
"""m; of how many balls, at 0.35 to 0.8 m from the base."""

RUN = "import sys; from optiplan.cli.main import run; sys.exit(run(sys.argv[1:]))"


def made(name: str, folder: Path) -> tuple[Path, float, int]:
    """The robot.yaml that `robots init` writes, the seconds that it took, and the lines that it printed."""
    began = time.perf_counter()
    flags = ["--out", str(folder), "--name", name, "--no-ask", "--force", "--allow-pairs", "touching"]
    command = [sys.executable, "-c", RUN, "robots", "init", str(package_robots()[name]), *flags]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)  # progress goes to our stderr
    return folder / "robot.yaml", time.perf_counter() - began, len(done.stdout.splitlines())


def free(robot: Any, scene: Scene, rng: np.random.Generator) -> Iterator[Any]:
    """Configurations without contact, within the limits and a turn."""
    model = CollisionModel(robot, scene)
    lower, upper = np.maximum(robot.limits.lower, -np.pi), np.minimum(robot.limits.upper, np.pi)
    while True:
        q = rng.uniform(lower, upper)
        if not model.collides(q) and model.contained(q) is None:
            yield q


def balls(rng: np.random.Generator) -> tuple[Obstacle, ...]:
    """Balls around the base."""
    found = []
    for k in range(BALLS):
        angle, far, height = rng.uniform(-np.pi, np.pi), rng.uniform(0.35, 0.8), rng.uniform(0.1, 0.8)
        place = np.array([far * np.cos(angle), far * np.sin(angle), height])
        found.append(Obstacle(f"ball {k}", Sphere(RADIUS), pin.SE3(np.eye(3), place)))
    return tuple(found)


def problems(robot_file: Path, count: int, seed: int) -> Iterator[Any]:
    """Problems from a free configuration to the pose that the tool has at another one."""
    robot, rng = op.load_robot(str(robot_file)), np.random.default_rng(seed)
    for number in range(count):
        scene = Scene(balls(rng))
        found = free(robot, scene, rng)
        start, goal = next(found), next(found)
        data = robot.model.createData()
        pin.framesForwardKinematics(robot.model, data, goal)
        X_WT = data.oMf[robot.frame_id(robot.tool_frame)]
        pose = {"position": X_WT.translation.tolist(), "rpy": pin.rpy.matrixToRpy(X_WT.rotation).tolist()}
        ball = {"sphere": RADIUS}
        places = {one.name: {"position": one.X_WO.translation.tolist()} for one in scene.obstacles}
        obstacles = [{"name": key, "shape": ball, "pose": place} for key, place in places.items()]
        document = {
            "version": 1,
            "name": f"{robot.name} {number}",
            "robot": str(robot_file),
            "start": {"joints": start.tolist()},
            "goal": {"pose": pose},
            "scene": {"obstacles": obstacles},
        }
        path = robot_file.parent / f"problem_{number}.yaml"
        path.write_text(yaml.safe_dump(document))
        yield op.load_problem(path)


def row(name: str, folder: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Figures of one arm."""
    robot_file, took, lines = made(name, folder)
    found: dict[str, Any] = {"robot": name, "init": took, "lines": lines, "runs": []}
    for number, problem in enumerate(problems(robot_file, options.count, options.seed)):
        if number == 0:
            op.plan(problem, budget=options.budget)
        run = op.plan(problem, budget=options.budget)
        timings, witness = run.timings, {}
        if run.report is not None:
            witness = next((check.witness for check in run.report.checks if check.name == "collision"), {})
        proofs = timings.get("verify", 0.0)
        found["runs"].append(
            {
                "verified": run.verified,
                "words": repr(run),
                "proof": proofs,
                "both": sum(timings.get(key, 0.0) for key in ("plan", "verify", "other proofs")),
                "scene": witness.get("scene_clearance"),
                "self": witness.get("self_clearance"),
                "kept": witness.get("proved_by_robot", 0),
            }
        )
        print(f"  {run!r}: proof {1e3 * proofs:.0f} ms", file=sys.stderr)
    return found


def millimetres(runs: list[dict[str, Any]], key: str) -> str:
    """The least of a clearance over the runs."""
    known = [run[key] for run in runs if run[key] is not None]
    return f"{1e3 * min(known):.3g}" if known else "–"


def main() -> int:
    """Measure the requested arms; return 1 where a figure is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", nargs="+", default=list(ARMS), help="names in example-robot-data")
    parser.add_argument("--count", type=int, default=6, help="pose goals of each")
    parser.add_argument("--seed", type=int, default=0, help="of the draws")
    parser.add_argument("--budget", type=float, default=1.0, help="s, of planning and proof")
    parser.add_argument("--most-lines", type=int, default=60, help="asked of the output of `robots init`")
    options = parser.parse_args()
    missed = False
    print("robot    init s  lines  verified  plan+proof s  proof ms  scene mm  itself mm  pairs kept")
    with tempfile.TemporaryDirectory() as folder:
        for name in options.robots:
            print(f"{name} …", file=sys.stderr)
            found = row(name, Path(folder) / name, options)
            runs = found["runs"]
            verified = sum(run["verified"] for run in runs)
            both, proof = (statistics.median(run[key] for run in runs) for key in ("both", "proof"))
            good = verified == len(runs) and both <= PLAN_AND_PROOF and proof <= PROOF
            good = good and found["lines"] <= options.most_lines
            missed |= not good
            print(
                f"{name:8} {found['init']:6.1f}  {found['lines']:5d}  {verified} of {len(runs)}    {both:9.3f}"
                f"  {1e3 * proof:11.1f}  {millimetres(runs, 'scene'):>8}  {millimetres(runs, 'self'):>9}"
                f"  {max(run['kept'] for run in runs):7d}{'' if good else '   missed'}",
                flush=True,
            )
    asked = f"median of plan and proof {PLAN_AND_PROOF} s, of proof {1e3 * PROOF:.0f} ms, all verified"
    print(f"asked: {asked}, at most {options.most_lines} lines: {'missed' if missed else 'seen'}")
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
