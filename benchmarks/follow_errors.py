"""How far a robot is from a run that it follows, when the payload is not what the controller takes it for.

    python benchmarks/follow_errors.py                           # five runs, about a minute
    python benchmarks/follow_errors.py --markdown follow.md

Our rigid-body plant carries 1 kg at the tool; the model of the controller knows it exactly, 10 % too light, or not at
all. Torques follow set-points by computed torque (critically damped, 10 Hz) at 1 kHz; set-points come from
`op.Executor`, from `op.Controller.follow` which goes on from what it commanded, or are held without feed-forward of
velocity and acceleration, as a drive does that is given positions alone. The last line printed is JSON.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

from collections.abc import Callable

import numpy as np
from published import finish, table_parser

import optiplan as op
from optiplan.simulation.controllers.base import JointTarget
from optiplan.simulation.controllers.joints import ComputedTorque
from optiplan.simulation.plants.base import Payload, PlantOptions
from optiplan.simulation.plants.dynamics import RigidBodyDynamics
from optiplan.simulation.plants.rigid_body import RigidBodyPlant

RUNS = ("01_reach", "09_ur5", "15_srra", "16_delbot", "02_shelf")
DT, STEP, FREQUENCY = 1e-3, 2.5e-4, 10.0
MASS = 1.0  # kg
ASSUMED = {"exact": 1.0, "10 % light": 0.9, "unknown": 0.0}
HEADINGS = ("run", "payload in the model", "set-points", "tool RMS, mm", "tool most, mm", "joint most, mrad")

Next = Callable[[], op.State | None]
"""The set-point at the end of the next tick; None when the motion is over."""


def main() -> None:
    """Execute, compare, print."""
    parser = table_parser(__doc__)
    parser.add_argument("--runs", nargs="+", default=list(RUNS), help="names of shipped problems")
    options = parser.parse_args()
    rows, data = [], {}
    for name in options.runs:
        run = op.plan(op.load_problem(name), budget=5.0)
        for model, share in ASSUMED.items():
            for source, feed_forward in (("executor", True), ("follow", True), ("positions alone", False)):
                q, wanted = followed(run, executor(run) if source != "follow" else follow(run), share, feed_forward)
                tool, joint = errors(run, q, wanted)
                found = [1e3 * np.sqrt(np.mean(tool**2)), 1e3 * tool.max(), 1e3 * np.abs(joint).max()]
                rows.append([name, model, source, *(f"{value:.3g}" for value in found)])
                data[f"{name}, {model}, {source}"] = found
        print(name, flush=True)
    finish(options.markdown, HEADINGS, rows, data)


def executor(run: op.Run) -> Next:
    """Return set-points of `op.Executor`."""
    made = op.Executor(run)

    def after() -> op.State | None:
        tick = made.tick(DT)
        return None if tick.status.phase == "done" else op.State(tick.q, tick.v, tick.a)

    return after


def follow(run: op.Run) -> Next:
    """Return set-points of `op.Controller.follow`."""
    controller = op.Controller(run.problem.robot, [], scene=run.problem.scene)
    motion, state = controller.follow(run), run.trajectory.state(0.0)

    def after() -> op.State | None:
        nonlocal state
        state = controller.step(state, DT).state
        return None if motion.done else state

    return after


def followed(run: op.Run, after: Next, share: float, feed_forward: bool) -> tuple[np.ndarray, np.ndarray]:
    """Positions (N, n) of the plant and of the set-points, rad or m, at every tick."""
    robot = run.problem.robot
    plant = RigidBodyPlant(robot, run.trajectory.start, STEP, PlantOptions(payload=Payload(MASS, MASS * share)))
    law = ComputedTorque(RigidBodyDynamics(robot, MASS * share, np.zeros(3)), FREQUENCY)
    before, still = run.trajectory.state(0.0), np.zeros(robot.n)
    q, wanted = [], []
    while (state := after()) is not None:
        ahead = (0.5 * (before.v + state.v), state.a) if feed_forward else (still, still)
        target = JointTarget(before.q, before.v if feed_forward else still, *ahead)
        plant.advance(law.torque(plant.q, plant.v, target), round(DT / STEP))
        q.append(plant.q.copy())
        wanted.append(state.q)
        before = state
    return np.array(q), np.array(wanted)


def errors(run: op.Run, q: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances (N,), m, of the tool from where it should be, and (N, n), rad or m, of the joints."""
    robot = run.problem.robot
    tools = [np.array([robot.fk(row).matrix[:3, 3] for row in rows]) for rows in (q, wanted)]
    return np.linalg.norm(tools[0] - tools[1], axis=1), q - wanted


if __name__ == "__main__":
    main()
