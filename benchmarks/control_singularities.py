"""Four ways to lead a tool through the wrist, elbow and shoulder singularities of SRRA, PUMA 560 and UR5.

    python benchmarks/control_singularities.py [--markdown singularities.md]                # about a minute on one core

Each singularity has a singular configuration and two on both sides of it, 0.5 rad away in its joint and less in
others. The tool follows a smooth path of poses through the three, as a cosine in 4 s. At half time it passes the
singular pose exactly. Every 2 ms each way takes the target a step ahead: the pseudo-inverse,
the damped one (λ = 0.05), the step of the ScLERP scheme, and `op.Controller` with its default limits. The last line
printed is one JSON object.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np
import pinocchio as pin
from published import finish, table_parser
from scipy.optimize import brentq

import optiplan as op
from optiplan.arrays import Array
from optiplan.geometry.dual_quaternion import DualQuaternion
from optiplan.kinematics.singularities import NAMES, SingularityModel, singularity_model
from optiplan.planners.sclerp.schemes import aim
from optiplan.planners.sclerp.screw_kinematics import ScrewTool

DT, SECONDS, GAIN, DAMPING, ASIDE = 0.002, 4.0, 20.0, 0.05, 0.5
JOINT = {"shoulder": 1, "elbow": 2, "wrist": 4}
"""That makes the singularity, from 0."""
Step = Callable[[Array, pin.SE3, Array], Array]
"""From configuration, target at the end of the step and its twist (6,) to the next configuration."""


@dataclass
class Passage:
    """Tool errors, mm; velocities and accelerations as multiples of the limits; the least singular value of J."""

    rms: float
    peak: float
    end: float
    velocity: float
    acceleration: float
    least: float


def singular_configuration(robot: op.Robot, model: SingularityModel, name: str) -> Array:
    """Where the factor of that name is zero: a joint is turned, from configurations that are not singular otherwise."""
    rng, joint, k = np.random.default_rng(0), JOINT[name], NAMES.index(name)
    low, high = np.maximum(robot.limits.lower, -2.0), np.minimum(robot.limits.upper, 2.0)
    while True:
        q = rng.uniform(0.6 * low, 0.6 * high)
        values = np.linspace(low[joint], high[joint], 60)
        Q = np.tile(q, (60, 1))
        Q[:, joint] = values

        def factor(value: float, q: Array = q) -> float:
            moved = q.copy()
            moved[joint] = value
            return float(model.factors(moved[None]).sines[0, k])

        found = model.factors(Q).sines[:, k]
        for i in np.flatnonzero(found[1:] * found[:-1] < 0.0).tolist():
            q[joint] = brentq(factor, values[i], values[i + 1])
            others = np.delete(np.abs(model.factors(q[None]).sines[0]), k)
            room = np.minimum(q - robot.limits.lower, robot.limits.upper - q)
            if others.min() > 0.3 and room.min() > 1.2 * ASIDE:
                return q


def path_through(robot: op.Robot, q: Array, joint: int) -> tuple[Array, Callable[[float], pin.SE3]]:
    """Start (n,), and poses over time that pass the pose at q at half time."""
    rng, tool = np.random.default_rng(1), ScrewTool(robot, robot.tool_frame)
    aside = rng.uniform(-0.15, 0.15, (2, robot.n))
    aside[:, joint] = ASIDE, -ASIDE
    X = tool.pose(q)
    before, after = (pin.log6(X.actInv(tool.pose(q + step))).vector for step in aside)
    straight, bent = 0.5 * (after - before), 0.5 * (after + before)

    def pose(t: float) -> pin.SE3:
        s = -np.cos(np.pi * min(max(t / SECONDS, 0.0), 1.0))
        return X * pin.exp6(s * straight + s * s * bent)

    return q + aside[0], pose


def follow(robot: op.Robot, start: Array, pose: Callable[[float], pin.SE3], step: Step) -> Passage:
    """Lead the tool, and measure."""
    tool, q, Q, errors, least = ScrewTool(robot, robot.tool_frame), start, [start], [], np.inf
    for k in range(round(SECONDS / DT)):
        t = k * DT
        X, X_next = pose(t), pose(t + DT)
        turn = pin.log3(X_next.rotation @ X.rotation.T) / DT
        q = step(q, X_next, np.concatenate([(X_next.translation - X.translation) / DT, turn]))
        Q.append(q)
        found, J = tool.at(q)
        errors.append(float(np.linalg.norm(found.translation - X_next.translation)))
        least = min(least, float(np.linalg.svd(J, compute_uv=False)[-1]))
    v = np.diff(Q, axis=0) / DT
    a, e = np.diff(v, axis=0) / DT, 1e3 * np.array(errors)
    velocity, acceleration = robot.limits.velocity, robot.limits.acceleration
    ratios = float((np.abs(v) / velocity).max()), float((np.abs(a[1:]) / acceleration).max())
    return Passage(float(np.sqrt(np.mean(e**2))), float(e.max()), float(e[-1]), *ratios, least)


def resolved_rate(robot: op.Robot, damping: float) -> Step:
    """Jᵀ (J Jᵀ + λ² I)⁻¹ of the target's twist and the remaining error."""
    data, frame = robot.model.createData(), robot.frame_id(robot.tool_frame)

    def step(q: Array, X_next: pin.SE3, twist: Array) -> Array:
        J = pin.computeFrameJacobian(robot.model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
        X = pin.updateFramePlacement(robot.model, data, frame)
        off = np.concatenate([X_next.translation - X.translation, pin.log3(X_next.rotation @ X.rotation.T)])
        wanted = twist + GAIN * (off - DT * twist)
        if damping == 0.0:
            return q + DT * (np.linalg.pinv(J) @ wanted)
        return q + DT * (J.T @ np.linalg.solve(J @ J.T + damping**2 * np.eye(6), wanted))

    return step


def sclerp_step(robot: op.Robot) -> Step:
    """The whole way along the screw to the target, by the scheme's least motion of the joints."""
    tool = ScrewTool(robot, robot.tool_frame)

    def step(q: Array, X_next: pin.SE3, twist: Array) -> Array:
        X, J = tool.at(q)
        return q + J.T @ np.linalg.solve(J @ J.T, aim(X, DualQuaternion.from_pose(X_next), 1.0))

    return step


def quadratic_program(robot: op.Robot) -> Step:
    """Our controller within position, velocity, acceleration and jerk limits, from its own commanded state."""
    task = op.PoseTask(robot.tool_frame, gain=GAIN)
    controller = op.Controller(robot, [task, op.PostureTask(cost=1e-4)])
    state: op.State | None = None

    def step(q: Array, X_next: pin.SE3, twist: Array) -> Array:
        nonlocal state
        X = pin.SE3(pin.exp3(-DT * twist[3:]) @ X_next.rotation, X_next.translation - DT * twist[:3])
        task.set_target(X, twist)
        state = controller.step(op.State(q) if state is None else state, DT).state
        return state.q

    return step


WAYS: dict[str, Callable[[op.Robot], Step]] = {
    "pseudo-inverse": lambda robot: resolved_rate(robot, 0.0),
    "damped": lambda robot: resolved_rate(robot, DAMPING),
    "ScLERP step": sclerp_step,
    "QP": quadratic_program,
}


def cell(found: Passage) -> str:
    """Error at most, and multiples of the limits."""
    return f"{found.peak:.3g} / {found.end:.2g} · {found.velocity:.2g} / {found.acceleration:.2g}"


def main() -> None:
    """Run and print."""
    parser = table_parser(__doc__)
    parser.add_argument("--robots", default="srra,puma560,ur5")
    options = parser.parse_args()
    rows, told = [], {}
    for name in options.robots.split(","):
        robot = op.load_robot(name)
        model = singularity_model(robot)
        assert model is not None
        for singularity in ("wrist", "elbow", "shoulder"):
            q = singular_configuration(robot, model, singularity)
            start, pose = path_through(robot, q, JOINT[singularity])
            found = {way: follow(robot, start, pose, make(robot)) for way, make in WAYS.items()}
            rows.append([name, singularity, *(cell(passage) for passage in found.values())])
            told[f"{name} {singularity}"] = {way: asdict(passage) for way, passage in found.items()}
    headings = ("robot", "singularity", *WAYS)
    remark = (
        "Tool error at most / at the end, mm · velocity / acceleration at most, in multiples of the robot's limits "
        f"(more than 1 is beyond them). {SECONDS:g} s, every {DT * 1e3:g} ms."
    )
    finish(options.markdown, headings, rows, told, [remark])


if __name__ == "__main__":
    main()
