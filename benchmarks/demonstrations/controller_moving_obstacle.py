"""The controller among obstacles that move, and on a robot with neighbouring links nearer than its clearance.

    python benchmarks/demonstrations/controller_moving_obstacle.py [--form velocity]

First a Panda that holds its posture while a ball comes, from which it gets away. Then the live loop of the problem
`38_falling_ball`. Then the UR5 of example-robot-data, whose shoulder and upper arm are 0.149 mm apart: its tool goes to
a pose with a required clearance of 5 mm. Distances are measured by the verifier's collision model. One line a figure,
required and measured; the exit code is 1 where a figure is missed.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from asked import Figures

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.service.execution.live import LiveLoop

DT = 0.002
BALLS = {"from the side, 0.3 m/s": ((0, 0.5, 0), (0, -0.3, 0)), "from the front, 0.7 m/s": ((0.8, 0, 0), (-0.7, 0, 0))}
"""Where a ball is at first, m from the hand, and its velocity, m/s."""


def evade(start: tuple[float, ...], velocity: tuple[float, ...], form: str) -> dict[str, float]:
    """A posture is held for 3 s while a ball comes: least distance, m, and how far a joint went, rad."""
    robot = op.load_robot("panda")
    ready = robot.configurations["ready"]
    hand = op.Controller(robot, []).configuration(op.State(ready)).pose(robot.frame_id("panda_hand")).translation
    ball = op.Sphere("ball", radius=0.05, position=tuple(hand + start)).moving([[0, v] for v in velocity], until=3.0)
    scene = op.Scene([ball])
    controller = op.Controller(robot, [op.PostureTask("ready", cost=1.0)], scene=scene, form=form)
    check, state, least, far = CollisionModel(robot, scene), op.State(ready), np.inf, 0.0
    for _ in range(round(3.0 / DT)):
        state = controller.step(state, DT).state
        nearest = check.clearance(check.at_times(state.q[None], np.array([controller.time]))[0])
        least = least if nearest is None else min(least, nearest.distance)
        far = max(far, float(np.abs(state.q - ready).max()))
    return {"least": least, "far": far}


def live_falling_ball() -> dict[str, float]:
    """Two seconds of the live loop of the problem: the least reported distance, m."""
    loop, least = LiveLoop(op.load_problem("38_falling_ball"), "ideal"), np.inf
    for _ in range(400):
        loop.advance()
        nearest = loop.state()["nearest"]
        least = least if nearest is None else min(least, nearest["distance"])
    return {"least": least}


def neighbours(urdf: Path) -> dict[str, float]:
    """The tool of a UR5 goes 0.2 m: error at the end, m; share of steps that recovered; least distance kept, m."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "optiplan", "robots", "init", str(urdf), "--out", folder, "--no-ask"]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        robot = op.load_robot(str(Path(folder) / "robot.yaml"))
    start = np.array([0.0, -1.2, 1.5, -1.8, -1.5, 0.0])
    tool, limit = op.PoseTask(robot.tool_frame), op.ClearanceLimit(op.Scene())
    kept = [*op.Controller(robot, []).limits, limit]
    controller, state = op.Controller(robot, [tool, op.PostureTask(start)], limits=kept), op.State(start)
    X = controller.configuration(state).pose(robot.frame_id(robot.tool_frame)).copy()
    X.translation = X.translation + np.array([0.05, 0.2, 0.1])
    tool.set_target(X)
    recovering, begin = 0, time.process_time()
    for _ in range(1500):
        step = controller.step(state, DT)
        recovering, state = recovering + (step.status == "recovering"), step.state
    seconds = (time.process_time() - begin) / 1500
    for pair, distance in limit.structure.items():
        print(f"  kept by structure: {pair}, {1e3 * distance:.3f} mm", file=sys.stderr)
    error = float(np.linalg.norm(tool.error(controller.configuration(state))[:3]))
    return {"error": error, "recovering": recovering / 1500, "seconds": seconds}


def main() -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--form", default="velocity", choices=("velocity", "acceleration"))
    options = parser.parse_args()
    figures = Figures()
    for name, (start, velocity) in BALLS.items():
        print(f"a ball {name}", file=sys.stderr)
        found = evade(start, velocity, options.form)
        seen = f"{1e3 * found['least']:.1f} mm, a joint went {found['far']:.2f} rad"
        figures.tell(f"ball {name}, distance", "> 0 mm", seen, found["least"] > 0.0)
    found = live_falling_ball()
    figures.tell(
        "live loop of 38_falling_ball, distance", ">= 5 mm", f"{1e3 * found['least']:.1f} mm", found["least"] >= 0.005
    )
    data = find_spec("cmeel")
    folder = Path(data.origin).parent.parent if data is not None and data.origin is not None else Path()
    urdf = folder / "cmeel.prefix/share/example-robot-data/robots/ur_description/urdf/ur5_robot.urdf"
    if not urdf.is_file():
        print("example-robot-data is not installed: the UR5 is left out", file=sys.stderr)
        return figures.exit_code
    print("robots init of the UR5 takes half a minute", file=sys.stderr)
    found = neighbours(urdf)
    figures.tell("UR5, tool at its target", "<= 1 mm", f"{1e3 * found['error']:.3f} mm", found["error"] <= 1e-3)
    share = f"{100 * found['recovering']:.1f} %"
    figures.tell("UR5, steps that recovered", "0 %", share, found["recovering"] == 0.0)
    figures.tell(
        "UR5, a step", "<= 2 ms of processor time", f"{1e3 * found['seconds']:.2f} ms", found["seconds"] <= 2e-3
    )
    return figures.exit_code


if __name__ == "__main__":
    sys.exit(main())
