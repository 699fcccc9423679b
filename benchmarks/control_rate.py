"""Measure the time of a controller step on one core, and its error, beside pin-pink and mink.

    taskset -c 1 chrt -r 5 python benchmarks/control_rate.py [--steps 4000] [--families] [--tables folder]

First Panda with a pose task, a posture, all limits of the joints (position, velocity, acceleration, jerk), torque, tool
speed and ten clearance rows. Then the same tasks with limits of position and velocity alone, which pink and mink have
too, on the same moving target, with each of daqp, quadprog and proxqp that is installed, in one run. With `--families`
the six families of motions, peers with the first of these solvers. Peers that are not installed are left out. The last
line is one JSON object.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import gc
import logging
import re
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
from published import print_json, print_table, write_markdown
from qpsolvers import available_solvers

import optiplan as op
from optiplan.collision.model import CollisionModel

DT = 0.002
SOLVERS = [name for name in ("daqp", "quadprog", "proxqp") if name in available_solvers]
"""Of pink and mink, through qpsolvers."""

READY = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
Step = Callable[[pin.SE3, np.ndarray, pin.SE3], np.ndarray]
"""From a target X_WT now, its twist (6,), and where it is at the end of the step, to the configuration then.

Controllers with feed-forward take the first two, the others the last; all are held against the last."""


@dataclass
class Result:
    """Of one controller on one motion: seconds of each step by the wall's clock and by the processor's, errors, q."""

    seconds: np.ndarray
    cpu: np.ndarray
    error: np.ndarray
    q: np.ndarray

    @property
    def rates(self) -> np.ndarray:
        """Joint velocities."""
        return np.diff(self.q, axis=0) / DT

    @property
    def error_rms(self) -> float:
        """Of the last three quarters, m."""
        return float(np.sqrt(np.mean(self.error[len(self.error) // 4 :] ** 2)))

    @property
    def times(self) -> list[float]:
        """Median, 99 and 99.9 % by the wall's clock, and 99.9 % by the processor's, ms."""
        found = [float(np.quantile(self.seconds, p)) for p in (0.5, 0.99, 0.999)]
        return [1e3 * t for t in (*found, float(np.quantile(self.cpu, 0.999)))]

    def cells(self, robot: op.Robot, check: CollisionModel) -> list[str]:
        """A row of a table, as in HEADINGS."""
        jerk = float(np.abs(np.diff(self.rates, 2, axis=0)).max()) / DT**2
        least = min((found.distance for q in self.q[::20] if (found := check.clearance(q)) is not None), default=np.inf)
        return [
            *(f"{t:.3f}" for t in self.times),
            f"{1e3 * self.error_rms:.3f}",
            f"{jerk:.1e}",
            f"{100.0 * fast_power(self.rates):.1f}",
            f"{100.0 * frozen(self.rates, self.error):.1f}",
            " / ".join(str(count) for count in violations(robot, self)),
            f"{1e3 * least:.1f}",
        ]


HEADINGS = (
    "median ms", "99 %", "99.9 %", "99.9 % of processor time",
    "error mm RMS", "peak jerk", "power > 3 Hz %", "frozen %",
    "steps beyond position / velocity / acceleration", "least distance mm",
)  # fmt: skip


def fast_power(rates: np.ndarray) -> float:
    """Share of the power of joint velocities above 3 Hz, their mean left out."""
    spectrum = np.abs(np.fft.rfft(rates - rates.mean(axis=0), axis=0)) ** 2
    above = np.fft.rfftfreq(len(rates), DT) > 3.0
    return float(spectrum[above].sum() / max(spectrum.sum(), 1e-300))


def frozen(rates: np.ndarray, error: np.ndarray) -> float:
    """Share of steps in which nothing moves although the tool is more than 5 mm off."""
    return float(((np.abs(rates).max(axis=1) < 1e-4) & (error[1:] > 5e-3)).mean())


def run(step: Step, robot: op.Robot, targets: Iterator[tuple[pin.SE3, np.ndarray]]) -> Result:
    """Follow targets, and measure."""
    data, tool = robot.model.createData(), robot.frame_id(robot.tool_frame)
    seconds, cpu, errors, Q = [], [], [], []
    for k, ((X, twist), (X_next, _)) in enumerate(pairwise(targets)):
        if k % 100 == 0:
            gc.collect(1)
        processor, begin = time.thread_time(), time.perf_counter()  # this one inside: it takes no time itself
        q = step(X, twist, X_next)
        seconds.append(time.perf_counter() - begin)
        cpu.append(time.thread_time() - processor)
        pin.framesForwardKinematics(robot.model, data, q)
        errors.append(np.linalg.norm(data.oMf[tool].translation - X_next.translation))
        Q.append(q.copy())
    return Result(np.array(seconds), np.array(cpu), np.array(errors), np.array(Q))


def ours(
    robot: op.Robot,
    limits: list | None,
    scene: op.Scene | None = None,
    steps: list | None = None,
    gain: float | None = None,
    **options,
) -> Step:
    """Our controller; with a gain of 1 / dt and no response time the target is reached in one step, as pink's are."""
    tool, posture = op.PoseTask(robot.tool_frame, gain=gain), op.PostureTask(READY, cost=1e-2)
    controller = op.Controller(robot, [tool, posture], scene=scene, limits=limits, **options)
    state = op.State(READY)

    def step(X: pin.SE3, twist: np.ndarray, X_next: pin.SE3) -> np.ndarray:
        nonlocal state
        if gain is None:
            tool.set_target(X, twist)
        else:
            tool.set_target(X_next)
        found = controller.step(state, DT)
        state = found.state
        if steps is not None:
            steps.append(found)
        return state.q

    return step


def of_pink(robot: op.Robot, solver: str) -> Step:
    """pin-pink with the same tasks and limits, through qpsolvers."""
    import pink

    model = robot.model.copy()
    model.lowerPositionLimit, model.upperPositionLimit = robot.limits.lower, robot.limits.upper
    model.velocityLimit = robot.limits.velocity
    configuration = pink.Configuration(model, model.createData(), np.array(READY))
    tool = pink.tasks.FrameTask(robot.tool_frame, 1.0, 1.0)
    posture = pink.tasks.PostureTask(1e-2, gain=DT)
    posture.set_target(np.array(READY))

    def step(X: pin.SE3, twist: np.ndarray, X_next: pin.SE3) -> np.ndarray:
        tool.set_target(X_next)
        v = pink.solve_ik(configuration, [tool, posture], DT, solver, safety_break=False)
        configuration.integrate_inplace(v, DT)
        return configuration.q

    return step


def of_mink(robot: op.Robot, solver: str) -> Step:
    """Mink with the same tasks and limits, through qpsolvers; MuJoCo reads the same URDF."""
    import mink
    import mujoco

    text = (robot.source.parent / "panda.urdf").read_text()
    text = re.sub(r"<(visual|collision)\b.*?</\1>", "", text, flags=re.DOTALL)
    text = re.sub(r"<mimic[^>]*/>", "", text)
    spec = mujoco.MjSpec.from_string(
        text.replace("</robot>", '<mujoco><compiler fusestatic="false" balanceinertia="true"/></mujoco></robot>')
    )
    for joint in list(spec.joints):
        if joint.name not in robot.joint_names:
            spec.delete(joint)
    model = spec.compile()
    configuration = mink.Configuration(model, np.array(READY))
    tool = mink.FrameTask(robot.tool_frame, "body", 1.0, 1.0)
    posture = mink.PostureTask(model, 1e-2, gain=DT)
    posture.set_target(np.array(READY))
    velocities = dict(zip(robot.joint_names, robot.limits.velocity, strict=True))
    limits = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, velocities)]

    def step(X: pin.SE3, twist: np.ndarray, X_next: pin.SE3) -> np.ndarray:
        tool.set_target(mink.SE3.from_matrix(X_next.homogeneous))
        v = mink.solve_ik(configuration, [tool, posture], DT, solver, limits=limits)
        configuration.integrate_inplace(v, DT)
        return configuration.q

    return step


def figure_eight(robot: op.Robot, seconds: float, size: float = 0.15, period: float = 4.0):
    """The tool on a figure 8 around where it is at the start, in the plane x-y."""
    X0 = start_pose(robot)
    for k in range(round(seconds / DT)):
        t, w = k * DT, 2.0 * np.pi / period
        p = X0.translation + size * np.array([0.5 * np.sin(2 * w * t), np.sin(w * t), 0.0])
        v = size * w * np.array([np.cos(2 * w * t), np.cos(w * t), 0.0])
        yield pin.SE3(X0.rotation, p), np.array([*v, 0, 0, 0])


def jitter(robot: op.Robot, seconds: float):
    """A target that stands, seen with noise of 2 mm and 10 mrad."""
    X0, rng = start_pose(robot), np.random.default_rng(0)
    for _ in range(round(seconds / DT)):
        noise = pin.SE3(pin.exp3(rng.normal(0.0, 0.01, 3)), rng.normal(0.0, 0.002, 3))
        yield pin.SE3(X0.rotation @ noise.rotation, X0.translation + noise.translation), np.zeros(6)


def along(robot: op.Robot, seconds: float, way: np.ndarray):
    """Straight by `way` (3,), m, and back, as a cosine."""
    X0 = start_pose(robot)
    for k in range(round(seconds / DT)):
        w, t = 2.0 * np.pi / seconds, k * DT
        yield (
            pin.SE3(X0.rotation, X0.translation + 0.5 * (1.0 - np.cos(w * t)) * way),
            np.array([*(0.5 * w * np.sin(w * t) * way), 0, 0, 0]),
        )


def elbow(robot: op.Robot, seconds: float):
    """The tool turns in place by ±1.2 rad about the vertical: the elbow has to swing."""
    X0 = start_pose(robot)
    for k in range(round(seconds / DT)):
        w, t = 2.0 * np.pi / seconds, k * DT
        turn = pin.exp3(np.array([0.0, 0.0, 1.2 * np.sin(w * t)]))
        yield pin.SE3(turn @ X0.rotation, X0.translation), np.array([0, 0, 0, 0, 0, 1.2 * w * np.cos(w * t)])


def start_pose(robot: op.Robot) -> pin.SE3:
    """Of the tool."""
    return pin.SE3(op.Controller(robot, []).configuration(op.State(READY)).pose(robot.frame_id(robot.tool_frame)))


FAMILIES = {
    "figure-8": lambda robot: figure_eight(robot, 8.0),
    "jitter": lambda robot: jitter(robot, 4.0),
    "extension singularity": lambda robot: along(robot, 8.0, np.array([0.5, 0.0, 0.1])),
    "out of bounds": lambda robot: along(robot, 8.0, np.array([0.9, 0.0, 0.0])),
    "elbow": lambda robot: elbow(robot, 6.0),
    "torso graze": lambda robot: along(robot, 8.0, np.array([-0.25, 0.0, -0.35])),
}


def ten_rows(robot: op.Robot) -> op.Scene:
    """Obstacles around the tool's figure 8 that give about ten rows of clearance."""
    x, y, z = start_pose(robot).translation
    walls = [("left", (0.3, 0.02, 0.3), (0.0, 0.33, 0.0)), ("right", (0.3, 0.02, 0.3), (0.0, -0.33, 0.0))]
    walls += [("board", (0.5, 0.7, 0.02), (0.0, 0.0, -0.045)), ("front", (0.02, 0.5, 0.2), (0.16, 0.0, 0.0))]
    return op.Scene([op.Box(name, size, position=(x + a, y + b, z + c)) for name, size, (a, b, c) in walls])


def rows_in_view(robot: op.Robot, limit: op.ClearanceLimit, result: Result) -> list[int]:
    """How many pairs were near enough to be rows, at every hundredth step."""
    controller, before, found = op.Controller(robot, []), None, []
    for q in result.q[::100]:
        before = limit.view(controller.configuration(op.State(q)), before, 0.0)
        found.append(len(before.near))
    return found


def violations(robot: op.Robot, result: Result) -> list[int]:
    """Steps outside the limits of position, velocity, acceleration."""
    limits, v = robot.limits, result.rates
    a = np.diff(v, axis=0) / DT
    outside = (result.q < limits.lower - 1e-6) | (result.q > limits.upper + 1e-6)
    fast = np.abs(v) > limits.velocity * (1 + 1e-6) + 1e-6
    hard = np.abs(a) > limits.acceleration * (1 + 1e-6) + 1e-6
    return [int(found.any(axis=1).sum()) for found in (outside, fast, hard)]


def rate(robot: op.Robot, seconds: float) -> tuple[list[list[str]], str, dict[str, float]]:
    """Everything at once, then the same tasks and limits as the peers: rows, a remark and figures."""
    joints = [op.PositionLimit(), op.VelocityLimit(), op.AccelerationLimit(), op.JerkLimit()]
    scene = ten_rows(robot)
    everything = [*joints, op.TorqueLimit(), op.ToolSpeedLimit(linear=1.7, angular=2.5), op.ClearanceLimit(scene)]
    steps: list = []
    found = run(ours(robot, everything, steps=steps), robot, figure_eight(robot, seconds))
    rows = [["optiplan: all limits, ten clearance rows", *found.cells(robot, CollisionModel(robot, scene))]]
    hows = ", ".join(f"{sum(step.solver == how for step in steps)} {how}" for how in sorted({s.solver for s in steps}))
    view = np.mean(rows_in_view(robot, everything[-1], found))
    remark = f"Clearance rows: {view:.1f} a step on average. Steps by what found their answer: {hows}."
    told = {"median_ms": found.times[0], "p999_ms": found.times[2], "p999_processor_ms": found.times[3]}
    alone = CollisionModel(robot, op.Scene())
    for name, make in contestants(robot).items():
        found = run(make(), robot, figure_eight(robot, seconds))
        rows.append([f"{name}: position and velocity limits", *found.cells(robot, alone)])
        key = KEYS.get(name, name.replace(", ", "_"))
        told |= {f"{key}_median_ms": found.times[0], f"{key}_error_mm": 1e3 * found.error_rms}
    return rows, remark, told


KEYS = {"optiplan": "same_tasks", "optiplan, proxqp in every step": "proxqp_always"}
PEERS: dict[str, Callable[[op.Robot, str], Step]] = {"pink": of_pink, "mink": of_mink}


def contestants(robot: op.Robot) -> dict[str, Callable[[], Step]]:
    """Controllers with the same tasks and limits, peers with each solver; what is not installed is left out."""
    simple = [op.PositionLimit(), op.VelocityLimit()]
    at_once = {"gain": 1.0 / DT, "response": 0.0}
    found: dict[str, Callable[[], Step]] = {
        "optiplan": lambda: ours(robot, list(simple), **at_once),
        "optiplan, proxqp in every step": lambda: ours(robot, list(simple), solver="proxqp", **at_once),
    }
    for name, make in PEERS.items():
        if find_spec(name) is not None:
            found |= {f"{name}, {solver}": partial(make, robot, solver) for solver in SOLVERS}
    return found


def families(robot: op.Robot) -> list[list[str]]:
    """The six families of motions, by our controller with its default limits and by the peers with theirs."""
    first = [f"{name}, {SOLVERS[0]}" for name in PEERS]
    peers = {name: make for name, make in contestants(robot).items() if name in first}
    makers = {"optiplan, default limits": lambda: ours(robot, None, scene=op.Scene()), **peers}
    check, rows = CollisionModel(robot, op.Scene()), []
    for family, targets in FAMILIES.items():
        for name, make in makers.items():
            try:
                found = run(make(), robot, targets(robot))
            except Exception as error:  # what peers do where their program has no solution
                rows.append([family, name, f"gave up: {type(error).__name__}", *["–"] * (len(HEADINGS) - 1)])
                continue
            rows.append([family, name, *found.cells(robot, check)])
    return rows


def main() -> None:
    """Run, print, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=4000)
    parser.add_argument("--families", action="store_true")
    parser.add_argument("--tables", type=Path, help="folder for the tables")
    options = parser.parse_args()
    robot = op.load_robot("panda")
    gc.freeze()
    gc.disable()  # as a control loop should: collected in the pauses between steps
    logging.disable()  # pink warns in each step outside its limits
    rows, remark, told = rate(robot, options.steps * DT)
    made = {"control-rate": (("controller", *HEADINGS), rows, [remark])}
    if options.families:
        made["control-families"] = (("motion", "controller", *HEADINGS), families(robot), [])
    for name, table in made.items():
        print_table(*table[:2])
        if options.tables is not None:
            options.tables.mkdir(parents=True, exist_ok=True)
            write_markdown(options.tables / f"{name}.md", *table)
    print_json(told)


if __name__ == "__main__":
    main()
