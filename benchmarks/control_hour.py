"""Send random targets, in and out of reach, and count steps in which the controller leaves a limit or does not answer.

    python benchmarks/control_hour.py --minutes 60 [--robots panda,srra] [--fail 0.3] [--markdown hour.md]

Every robot gets its share of the simulated time. The plant follows the command exactly, so what is measured are the
commands: positions, velocities and accelerations of every step against the limits, and the distance of every pair of
bodies by a collision model of its own. `--fail` is the chance that the solver fails in a step: it raises, returns NaN,
nothing, or an answer that is wrong. `--until-violated` stops a robot at its first violation and prints where that was:
the same seed comes there again. The last line is one JSON object.
"""

import argparse
import math
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pinocchio as pin

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.control.controller import Controller
from optiplan.control.defaults import default_limits
from optiplan.control.limits.clearance import AT_LEAST, ClearanceLimit
from optiplan.control.qp.solvers import ProxQp, QpSolver
from optiplan.control.tasks.frame_tasks import PoseTask
from optiplan.control.tasks.joint_tasks import PostureTask
from optiplan.trajectory.state import State

SCENES = {
    "panda": [op.Box("post", size=(0.1, 0.1, 0.8), position=(0.45, 0.3, 0.4)), op.HalfSpace("floor", offset=-0.05)],
    "srra": [op.Box("post", size=(0.2, 0.2, 1.0), position=(1.2, -0.6, 0.3))],
    "baxter": [op.Box("table", size=(0.6, 1.2, 0.05), position=(0.9, 0.0, -0.1))],
    "delbot": [op.Box("shelf", size=(0.4, 1.0, 0.6), position=(1.4, 0.0, 0.4))],
}
START = {"panda": "ready", "srra": "home", "baxter": "ready", "delbot": "home"}
CLEARANCE = {"baxter": 0.001}
"""m, where not 5 mm: Baxter's `ready` has two of its links 1.9 mm apart."""
HOLD = 1.5
"""s of a target, on average."""
EVERY = 10
"""Steps between two measurements of all distances."""
MEASURED = "position", "velocity", "acceleration", "clearance"
TOLERANCE = 1e-6
"""rad, m and s: what counts as a violation."""


class Flaky(QpSolver):
    """A solver that fails at random, in every way that solvers do."""

    name = "flaky"

    def __init__(self, chance: float, seed: int) -> None:
        self._solver, self._chance, self._rng = ProxQp(), chance, np.random.default_rng(seed)

    def solve(self, program):
        """The answer, or none, or a wrong one."""
        if self._rng.random() >= self._chance:
            return self._solver.solve(program)
        kind = self._rng.integers(5)
        if kind == 0:
            raise RuntimeError("injected")
        n = len(program.g)
        return [None, np.full(n, np.nan), self._rng.normal(0.0, 5.0, n), np.full(n + 1, 0.1)][kind - 1]


@dataclass
class Worst:
    """The largest violations of a run, in the units of the limits, negative where room was left, and counts."""

    position: float = -math.inf
    velocity: float = -math.inf
    acceleration: float = -math.inf
    jerk: float = -math.inf
    clearance: float = -math.inf
    at: dict[str, str] = field(default_factory=dict)
    steps: int = 0
    braking: int = 0
    statuses: dict[str, int] = field(default_factory=dict)
    seconds: list[float] = field(default_factory=list)
    simulated: float = 0.0

    def raise_to(self, key: str, value: float, where: str) -> None:
        """Take a violation in; remember where the largest was."""
        if value > getattr(self, key):
            setattr(self, key, value)
            self.at[key] = where

    @property
    def violated(self) -> list[str]:
        """Limits that were left by more than what rounding may cost."""
        return [key for key in MEASURED if getattr(self, key) > TOLERANCE]


def random_target(rng: np.random.Generator, robot: op.Robot) -> pin.SE3:
    """A pose of the tool at random joints, a third of the time moved by up to 1.5 m, mostly out of reach."""
    limits = robot.limits
    low, high = np.maximum(limits.lower, -np.pi), np.minimum(limits.upper, np.pi)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, rng.uniform(low, high))
    X = pin.SE3(data.oMf[robot.frame_id(robot.tool_frame)])
    if rng.random() < 1.0 / 3.0:
        X.translation = X.translation + rng.uniform(-1.5, 1.5, 3)
    return X


def simulate(
    name: str, seconds: float, dt: float, fail: float, seed: int, form: str = "velocity", until_violated: bool = False
) -> Worst:
    """A robot and its random targets for so many seconds of simulated time."""
    rng = np.random.default_rng(seed)
    robot, scene = op.load_robot(name), op.Scene(SCENES[name])
    tool = PoseTask(robot.tool_frame)
    solver = Flaky(fail, seed) if fail > 0.0 else "native"
    at_least = CLEARANCE.get(name, AT_LEAST)
    limits = [*default_limits(), ClearanceLimit(scene, at_least)]
    controller = Controller(robot, [tool, PostureTask(START[name])], limits=limits, solver=solver, form=form)
    check = CollisionModel(robot, scene)
    state, worst, left = State(robot.configurations[START[name]]), Worst(), 0.0
    for k in range(round(seconds / dt)):
        if left <= 0.0:
            tool.set_target(random_target(rng, robot))
            left = rng.exponential(HOLD)
        left -= dt
        step = controller.step(state, dt)
        measure(worst, robot, state, step, dt)
        if k % EVERY == 0 or step.solver == "braking":
            nearest = check.clearance(step.q)
            if nearest is not None:
                pair, apart = (
                    f"{nearest.pair.name_a} and {nearest.pair.name_b}",
                    f"{1e3 * nearest.distance:.3f} mm apart",
                )
                where = f"step {worst.steps}: {pair} {apart}, {step.status}"
                worst.raise_to("clearance", at_least - nearest.distance, where)
        if until_violated and worst.violated:
            given = ", ".join(f"{key}={getattr(state, key).tolist()}" for key in "qva")
            print(f"{name}: {worst.at[worst.violated[0]]}; {step!r}; from {given}", flush=True)
            break
        state = step.state
    return worst


def measure(worst: Worst, robot: op.Robot, state: State, step: op.ControlStep, dt: float) -> None:
    """Hold one step against the robot's limits."""
    limits = robot.limits
    acceleration = (step.v - state.v) / dt
    worst.steps += 1
    worst.simulated += dt
    worst.braking += step.solver == "braking"
    worst.statuses[step.status] = worst.statuses.get(step.status, 0) + 1
    worst.seconds.append(step.seconds)
    assert np.isfinite(step.q).all(), "a step without an answer"
    assert np.isfinite(step.v).all(), "a step without an answer"
    found = {
        "position": np.maximum(limits.lower - step.q, step.q - limits.upper),
        "velocity": np.abs(step.v) - limits.velocity,
        "acceleration": np.abs(acceleration) - limits.acceleration,
        "jerk": np.abs(acceleration - state.a) / dt - limits.jerk,
    }
    for key, values in found.items():
        j = int(values.argmax())
        worst.raise_to(key, float(values[j]), f"step {worst.steps}: {robot.joint_names[j]}, {step.status}")


HEADINGS = (
    "robot", "minutes", "steps", "without answer", "position", "velocity", "acceleration", "jerk", "clearance m",
    "braked", "tracking / limited / nearest / recovering %", "step ms 50 / 99.9 %",
)  # fmt: skip


def table_row(name: str, worst: Worst) -> list[str]:
    """Largest violations in rad, m and s; negative values are room that was left."""
    shares = [100.0 * worst.statuses.get(k, 0) / worst.steps for k in ("tracking", "limited", "nearest", "recovering")]
    times = [float(np.quantile(worst.seconds, p)) * 1e3 for p in (0.5, 0.999)]
    found = [getattr(worst, key) for key in ("position", "velocity", "acceleration", "jerk", "clearance")]
    return [
        name,
        f"{worst.simulated / 60.0:.1f}",
        str(worst.steps),
        "0",
        *(f"{value:.1e}" for value in found),
        str(worst.braking),
        " / ".join(f"{share:.0f}" for share in shares),
        " / ".join(f"{ms:.2f}" for ms in times),
    ]


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60.0, help="of simulated time, shared by the robots")
    parser.add_argument("--robots", default="panda,srra,baxter,delbot")
    parser.add_argument("--dt", type=float, default=0.002)
    parser.add_argument("--fail", type=float, default=0.0, help="chance that the solver fails in a step")
    parser.add_argument("--form", default="velocity")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--until-violated", action="store_true", help="stop a robot where it first leaves a limit")
    parser.add_argument("--markdown", type=Path, help="write the table to this file")
    options = parser.parse_args()
    names = options.robots.split(",")
    from published import print_json, write_markdown  # here, for tests import this file as a module

    result, rows = {}, []
    print(
        f"{'robot':8} {'steps':>8} {'position':>9} {'velocity':>9} {'accel.':>9} {'jerk':>9} {'clearance':>10} "
        f"{'braking':>8}"
    )
    for name in names:
        begin = time.perf_counter()
        share = 60.0 * options.minutes / len(names)
        worst = simulate(name, share, options.dt, options.fail, options.seed, options.form, options.until_violated)
        print(
            f"{name:8} {worst.steps:8d} {worst.position:9.1e} {worst.velocity:9.1e} {worst.acceleration:9.1e} "
            f"{worst.jerk:9.1e} {worst.clearance:10.1e} {worst.braking:8d}  {worst.statuses} "
            f"median {np.median(worst.seconds) * 1e3:.2f} ms, 99.9 % {np.quantile(worst.seconds, 0.999) * 1e3:.2f} ms, "
            f"{time.perf_counter() - begin:.0f} s",
            flush=True,
        )
        for key in worst.violated:
            print(f"    {key}: {getattr(worst, key):.1e} at {worst.at[key]} (seed {options.seed})", flush=True)
        rows.append(table_row(name, worst))
        write_markdown(options.markdown, HEADINGS, rows)
        result[name] = {key: getattr(worst, key) for key in (*MEASURED, "jerk", "steps", "braking", "at")}
    violated = [name for name, found in result.items() if max(found[key] for key in MEASURED) > TOLERANCE]
    print_json({"minutes": options.minutes, "fail": options.fail, "violated": violated, "robots": result})


if __name__ == "__main__":
    main()
