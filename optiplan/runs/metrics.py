"""Objective metrics of a motion: lengths, peak jerk, torque, clearance, manipulability.

Lengths and torques are integrals over time, to 1e-6 of themselves (`trajectory/quadrature.py`).
"""

from collections.abc import Mapping
from dataclasses import asdict, field
from typing import Any, NamedTuple

import numpy as np

from optiplan.arrays import Array
from optiplan.kinematics.manipulability import ROWS, ToolKinematics, yoshikawa
from optiplan.problem.objectives.objective import part_unit
from optiplan.problem.problem import Problem
from optiplan.problem.task.scene_part import whole_motion
from optiplan.records import dataclass
from optiplan.robot.batched.dynamics import inverse_dynamics
from optiplan.robot.loaded_robots import once_for_each_robot
from optiplan.robot.robot import Robot
from optiplan.runs.base_load import BaseLoad, base_load
from optiplan.trajectory.quadrature import integral, panels
from optiplan.trajectory.trajectory import States, Trajectory
from optiplan.verify.report import Report, VerifyPolicy

_ACCURACY = 1e-6  # of the smallest manipulability, relative
_JUMP = VerifyPolicy.rest_tolerance  # share of a velocity or acceleration limit that counts as a jump
_CLOSER = 9  # samples between the neighbours of the smallest of a measure, in each round
_ROUNDS = 13  # at most, of looking closer


@dataclass(frozen=True)
class Metrics:
    """Metrics of a trajectory.

    Attributes:
        tool_path: length of the tool's path, integral of |v_WT|, m (to 1e-6 of itself).
        tool_rotation: angle that the tool turns through, integral of |w_WT|, rad (to 1e-6 of itself).
        joint_path: length of the path of the joints, integral of |dq/dt| (2-norm), rad, with sliding joints in m.
        peak_jerk: largest |jerk| of any joint at any time, exact, rad/s^3 or m/s^3; inf where velocity or acceleration
            jumps, be it from or to what the problem states at the ends, which is rest mostly.
        peak_jerk_joint: the joint that has it.
        jerk_share: the largest of peak jerk / limit over all joints, exact; None when no joint has a jerk limit.
        rms_torque: sqrt(mean over time of the sum over all joints of tau^2), N m (sliding joints: N).
        joint_torques: sqrt(mean over time of tau_j^2) by joint, N m or N.
        clearance: proved at all times by the verifier, m; None when it proved none, or no two bodies can meet.
        lowest_clearance: smallest distance of two bodies that the verifier measured, m; not below `clearance`.
        self_clearance: the same of the robot's own bodies and what it holds; `scene_clearance` of these from obstacles,
            m; None when none is proved, or there is no such pair.
        objective: parts of the problem's objective by name: value with its unit, weight, and cost, s.
        manipulability: smallest Yoshikawa measure of the tool's Jacobian (lengths in m): of all six rows, or with fewer
            than six joints of the three of the velocity. Sampled, then refined around the smallest sample.
        wheel_rates: largest |rate| of each mecanum wheel, rad/s, by name; None for a robot without. Sampled.
        base_load: what the ground carries: see `BaseLoad`; None for a robot without masses. Sampled.
    """

    tool_path: float
    tool_rotation: float
    joint_path: float
    peak_jerk: float
    peak_jerk_joint: str
    jerk_share: float | None
    rms_torque: float
    joint_torques: Mapping[str, float]
    clearance: float | None
    lowest_clearance: float | None
    manipulability: float
    self_clearance: float | None = None
    scene_clearance: float | None = None
    objective: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    wheel_rates: Mapping[str, float] | None = None
    base_load: BaseLoad | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return JSON-ready data, but for values that are not finite."""
        return asdict(self)


def measure(problem: Problem, trajectory: Trajectory, report: Report) -> Metrics | None:
    """Measure a trajectory; None when it does not move the joints of the problem's robot, or not as its task says."""
    robot = problem.robot
    if trajectory.joint_names != robot.joint_names:
        return None
    scenes = [whole_motion(problem, trajectory)]
    if problem.task:
        from optiplan.problem.task.timeline import mismatch, scene_parts

        if mismatch(problem, trajectory):
            return None
        scenes = scene_parts(problem, trajectory)
    motions = [(part.problem.robot, part.motion(trajectory)) for part in scenes]
    parts = [_Instant(loaded, motion) for loaded, motion in motions]
    integrals = sum((integral(part, motion) for part, (_, motion) in zip(parts, motions, strict=True)), np.zeros(1))
    squared = integrals[3:] / trajectory.duration
    worst = peak_jerk(trajectory, problem)
    found = _clearances(report)
    return Metrics(
        tool_path=float(integrals[0]),
        tool_rotation=float(integrals[1]),
        joint_path=float(integrals[2]),
        peak_jerk=worst.jerk,
        peak_jerk_joint=robot.joint_names[worst.joint],
        jerk_share=worst.share,
        rms_torque=float(np.sqrt(squared.sum())),
        joint_torques=dict(zip(robot.joint_names, np.sqrt(squared).tolist(), strict=True)),
        clearance=found.get("proved_clearance"),
        lowest_clearance=found.get("met_clearance"),
        self_clearance=found.get("self_clearance"),
        scene_clearance=found.get("scene_clearance"),
        manipulability=min(part.least_manipulability() for part in parts),
        objective=objective_of(problem, trajectory),
        wheel_rates=peak_wheel_rates(robot, trajectory),
        base_load=base_load(motions),
    )


def objective_of(problem: Problem, trajectory: Trajectory) -> dict[str, dict[str, Any]]:
    """Return what each part of the problem's objective comes to: value, unit, weight, cost."""
    weights, revolute = problem.objective.weights, problem.robot.revolute
    return {
        name: {
            "value": value,
            "unit": part_unit(name, revolute),
            "weight": weights[name],
            "cost": weights[name] * value,
        }
        for name, value in problem.objective_parts().values(trajectory).items()
    }


_tool_of = once_for_each_robot(ToolKinematics)
"""Speeds and manipulability are the same wherever the robot stands."""


def _tool_on(robot: Robot) -> ToolKinematics:
    """Return the kinematics of the tool frame; of a tool that is mounted, which the robot alone does not have."""
    return _tool_of(robot) if robot.unmounted.model.existFrame(robot.tool_frame) else ToolKinematics(robot)


class _Instant:
    """At times t (m, k) in m panels: |v_WT| (m/s), |w_WT| (rad/s), |dq/dt| and tau_j^2 of every joint: (m, k, 3 + n).

    Keeps the manipulability of every instant that was asked for.
    """

    def __init__(self, robot: Robot, trajectory: Trajectory) -> None:
        self._robot, self._tool, self._trajectory = robot, _tool_on(robot), trajectory
        self._rows = ROWS["full" if robot.n >= 6 else "translation"]
        self._seen: list[tuple[Array, Array]] = []

    def __call__(self, t: Array) -> Array:
        Q, V, A = (x.reshape(-1, x.shape[2]) for x in self._states(t))
        J = self._tool.evaluate(Q)[1]
        self._seen.append((t.ravel(), by_determinant(J[:, self._rows])))
        twist = (J @ V[:, :, None])[:, :, 0]
        found = np.empty((len(Q), 3 + Q.shape[1]))
        for k, part in enumerate((twist[:, :3], twist[:, 3:], V)):
            np.sqrt(np.einsum("ki,ki->k", part, part), out=found[:, k])
        np.square(inverse_dynamics(self._robot, Q, V, A), out=found[:, 3:])
        return found.reshape(*t.shape, -1)

    def _states(self, t: Array) -> States:
        """Position, velocity and acceleration at times t (m, k), those of a row in one piece: (m, k, n) each."""
        breakpoints = self._trajectory.breakpoints
        piece = np.searchsorted(breakpoints[1:-1], t[:, 0], side="right")
        return self._trajectory.states_along(piece, t - breakpoints[piece, None])

    def least_manipulability(self) -> float:
        """Return the smallest Yoshikawa measure along the motion.

        Holds at: the instants kept, then 9 between the neighbours of the smallest, up to 13 times, until the parabola
        through the lowest three promises less than 1e-6 below.
        """
        times, values = (np.concatenate(column) for column in zip(*self._seen, strict=True))
        order = np.argsort(times)
        t = np.concatenate([[0.0], times[order], [self._trajectory.duration]])
        value = np.concatenate([[np.inf], values[order], [np.inf]])
        for _ in range(_ROUNDS):
            k = int(np.argmin(value))
            t = np.linspace(t[max(k - 1, 0)], t[min(k + 1, len(t) - 1)], _CLOSER)
            J = self._tool.evaluate(self._trajectory.states(t)[0])[1]
            value = yoshikawa(J[:, self._rows])
            if _fall(value) <= _ACCURACY * value.min():
                break
        return float(value.min())


def _fall(value: Array) -> float:
    """How far the parabola through the smallest of values (N,) at equal steps and its neighbours falls below it."""
    k = int(np.argmin(value))
    if not 0 < k < len(value) - 1:
        return 0.0
    before, least, after = value[k - 1 : k + 2].tolist()
    bend = before - 2.0 * least + after
    return float((after - before) ** 2 / (8.0 * bend)) if bend > 0.0 else 0.0


def by_determinant(J: Array) -> Array:
    """sqrt(det(J J^T)) of J (N, m, n), for n < m sqrt(det(J^T J)): (N,).

    Quicker than `yoshikawa`, and off by 1e-8 of the largest possible near a singularity.
    """
    square = J @ J.swapaxes(1, 2) if J.shape[1] <= J.shape[2] else J.swapaxes(1, 2) @ J
    return np.asarray(np.sqrt(np.maximum(np.linalg.det(square), 0.0)))


class PeakJerk(NamedTuple):
    """The joint with the largest jerk, that jerk, rad/s³ or m/s³, and the largest share of a limit that a joint has."""

    joint: int
    jerk: float
    share: float | None


def peak_jerk(trajectory: Trajectory, problem: Problem) -> PeakJerk:
    """The largest jerk over all time, exactly.

    A joint whose velocity or acceleration jumps has an infinite jerk, and an infinite share of a finite limit; also
    where it jumps from or to what the problem states at the ends (rest, where it states nothing).
    """
    limits, start, end = problem.limits, problem.start_state, problem.end_states(trajectory.end)[0]
    low, high = trajectory.extrema(3)
    jerk = np.maximum(np.abs(low), np.abs(high))
    _, v, a = trajectory.states(np.array([0.0, trajectory.duration]))
    for order, limit, off in (1, limits.velocity, v - [start.v, end.v]), (2, limits.acceleration, a - [start.a, end.a]):
        steps = np.abs(np.concatenate([trajectory.jumps(order), off])).max(axis=0)
        jerk[steps > _JUMP * limit] = np.inf
    joint, limited = int(np.argmax(jerk)), np.isfinite(limits.jerk)
    share = float((jerk[limited] / limits.jerk[limited]).max()) if limited.any() else None
    return PeakJerk(joint, float(jerk[joint]), share)


def peak_wheel_rates(robot: Robot, trajectory: Trajectory) -> dict[str, float] | None:
    """Return the largest |rate| of each wheel, rad/s; None for a robot without wheels.

    Holds at: 8 samples a panel, at whose ends the pieces begin and end.
    """
    from optiplan.kinematics.mecanum import WHEELS, wheel_rates_along

    if robot.mecanum is None:
        return None
    a, b = panels(trajectory)
    t = np.append((a[:, None] + (b - a)[:, None] * np.linspace(0.0, 0.875, 8)).ravel(), b[-1])
    rates = wheel_rates_along(robot, trajectory(t), trajectory(t, 1))
    assert rates is not None
    return dict(zip(WHEELS, np.abs(rates).max(axis=0).tolist(), strict=True))


def _clearances(report: Report) -> Mapping[str, Any]:
    """Clearances, m, as the report has them, by their names in the witness of the check."""
    return next((check.witness for check in report.checks if check.name == "collision"), {})
