"""Objective metrics of a motion: lengths, peak jerk, torque, clearance, manipulability.

Lengths and torques are integrals over time, computed panel by panel by
Gauss-Legendre quadrature (five points); a panel is halved until halving it changes the integral by less than its
share of 1e-6 of the whole.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.kinematics.manipulability import ToolKinematics, measures, scaled
from optiplan.kinematics.mecanum import WHEELS, wheel_rates_along
from optiplan.problem.objectives.objective import UNITS
from optiplan.problem.problem import Problem
from optiplan.problem.task.timeline import mismatch, scene_parts
from optiplan.robot.robot import Robot
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import Report

_NODES, _WEIGHTS = np.array(  # of five points on [0, 1]
    [
        [0.04691007703066800, 0.23076534494715845, 0.5, 0.76923465505284155, 0.95308992296933200],
        [0.11846344252809454, 0.23931433524968324, 0.28444444444444444, 0.23931433524968324, 0.11846344252809454],
    ]
)
_ACCURACY = 1e-6  # of an integral, relative
_NOTHING = 1e-3  # m, rad, (N m)^2 s: integrals smaller than this need no more digits than this one
_PANELS = 64  # least number per motion: a kink between their points is negligible
_HALVINGS = 12  # at most, of a panel: speed has kinks where the tool stands still
_MOST_PANELS = 20_000  # panels at a time; beyond that the integral is not refined further
_JUMP = 1e-5  # share of a velocity or acceleration limit that counts as a jump; the verifier's own tolerance


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
        objective: parts of the problem's objective by name: value with its unit, weight, and cost, s.
        manipulability: smallest Yoshikawa measure of the tool's Jacobian (lengths in m): of all six rows, or with fewer
            than six joints of the three of the velocity. Sampled, then refined around the smallest sample.
        wheel_rates: largest |rate| of each mecanum wheel, rad/s, by name; None for a robot without. Sampled.
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
    objective: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    wheel_rates: Mapping[str, float] | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return JSON-ready data, but for values that are not finite."""
        return asdict(self)


def measure(problem: Problem, trajectory: Trajectory, report: Report) -> Metrics | None:
    """Measure a trajectory; None when it does not move the joints of the problem's robot, or not as its task says."""
    robot = problem.robot
    if trajectory.joint_names != robot.joint_names or (problem.task and mismatch(problem, trajectory)):
        return None
    parts = [(part.problem.robot, part.motion(trajectory)) for part in scene_parts(problem, trajectory)]
    integrals = np.sum([integral(_Instant(loaded, motion), motion) for loaded, motion in parts], axis=0)
    squared = integrals[3:] / trajectory.duration
    joint, jerk, share = peak_jerk(trajectory, problem)
    proved, lowest = _clearance(report)
    return Metrics(
        tool_path=float(integrals[0]),
        tool_rotation=float(integrals[1]),
        joint_path=float(integrals[2]),
        peak_jerk=jerk,
        peak_jerk_joint=robot.joint_names[joint],
        jerk_share=share,
        rms_torque=float(np.sqrt(squared.sum())),
        joint_torques=dict(zip(robot.joint_names, np.sqrt(squared).tolist(), strict=True)),
        clearance=proved,
        lowest_clearance=lowest,
        manipulability=least_manipulability(robot, trajectory),
        objective=objective_of(problem, trajectory),
        wheel_rates=peak_wheel_rates(robot, trajectory),
    )


def objective_of(problem: Problem, trajectory: Trajectory) -> dict[str, dict[str, Any]]:
    """Return what each part of the problem's objective comes to: value, unit, weight, cost."""
    weights = problem.objective.weights
    return {
        name: {"value": value, "unit": UNITS[name], "weight": weights[name], "cost": weights[name] * value}
        for name, value in problem.objective_parts().values(trajectory).items()
    }


class _Instant:
    """At times t (N,): |v_WT| (m/s), |w_WT| (rad/s), |dq/dt| and tau_j^2 of every joint, as an array (N, 3 + n)."""

    def __init__(self, robot: Robot, trajectory: Trajectory) -> None:
        self._model, self._data = robot.model, robot.model.createData()
        self._tool, self._trajectory = ToolKinematics(robot), trajectory

    def __call__(self, t: Array) -> Array:
        Q, V, A = (self._trajectory(t, order) for order in range(3))
        twist = np.einsum("kij,kj->ki", self._tool.evaluate(Q)[1], V)
        motion = zip(Q, V, A, strict=True)
        tau = np.array([pin.rnea(self._model, self._data, q, v, a).copy() for q, v, a in motion])
        speeds = [np.linalg.norm(part, axis=1) for part in (twist[:, :3], twist[:, 3:], V)]
        return np.column_stack([*speeds, tau**2])


def integral(f: Callable[[Array], Array], trajectory: Trajectory) -> Array:
    """Integral over the whole motion of f, which maps times (N,) to values (N, k) >= 0: array (k,).

    Panels begin and end at breakpoints, where f may jump.
    """
    a, b = _panels(trajectory)
    coarse, total = _gauss(f, a, b), np.zeros(1)
    for _ in range(_HALVINGS):
        middle = 0.5 * (a + b)
        left, right = _gauss(f, a, middle), _gauss(f, middle, b)
        fine = left + right
        allowed = _ACCURACY * np.maximum(total + fine.sum(axis=0), _NOTHING) * ((b - a) / trajectory.duration)[:, None]
        rough = (np.abs(fine - coarse) > allowed).any(axis=1)
        total = total + fine[~rough].sum(axis=0)
        a, b = np.concatenate([a[rough], middle[rough]]), np.concatenate([middle[rough], b[rough]])
        coarse = np.concatenate([left[rough], right[rough]])
        if not rough.any() or len(a) > _MOST_PANELS:
            break
    return np.asarray(total + coarse.sum(axis=0))


def _panels(trajectory: Trajectory) -> tuple[Array, Array]:
    """Beginnings and ends of the first panels: the pieces, cut into parts of at most a 64th of the motion."""
    edges = np.union1d(trajectory.breakpoints, np.linspace(0.0, trajectory.duration, _PANELS + 1))
    return edges[:-1], edges[1:]


def _gauss(f: Callable[[Array], Array], a: Array, b: Array) -> Array:
    """Five-point quadrature of f over panels from a (m,) to b (m,): array (m, k)."""
    t = a[:, None] + (b - a)[:, None] * _NODES
    values = f(t.ravel()).reshape(len(a), len(_NODES), -1)
    return np.asarray((b - a)[:, None] * np.einsum("mik,i->mk", values, _WEIGHTS))


def peak_jerk(trajectory: Trajectory, problem: Problem) -> tuple[int, float, float | None]:
    """Joint with the largest jerk, that jerk, and the largest share of a limit (n,), over all time, exactly.

    A joint whose velocity or acceleration jumps has an infinite jerk, and an infinite share of a finite limit; also
    where it jumps from or to what the problem states at the ends (rest, where it states nothing).
    """
    limits, start, end = problem.limits, problem.start_state, problem.end_states(trajectory.end)[0]
    low, high = trajectory.extrema(3)
    jerk = np.maximum(np.abs(low), np.abs(high))
    ends = np.array([0.0, trajectory.duration])
    stated = {1: (limits.velocity, [start.v, end.v]), 2: (limits.acceleration, [start.a, end.a])}
    for order, (limit, rates) in stated.items():
        steps = np.abs(np.vstack([trajectory.jumps(order), trajectory(ends, order) - rates])).max(axis=0)
        jerk = np.where(steps > _JUMP * limit, np.inf, jerk)
    joint, limited = int(np.argmax(jerk)), np.isfinite(limits.jerk)
    share = float((jerk[limited] / limits.jerk[limited]).max()) if limited.any() else None
    return joint, float(jerk[joint]), share


def peak_wheel_rates(robot: Robot, trajectory: Trajectory) -> dict[str, float] | None:
    """Return the largest |rate| of each wheel, rad/s; None for a robot without wheels.

    Holds at: 8 samples a panel, at whose ends the pieces begin and end.
    """
    a, b = _panels(trajectory)
    t = np.append((a[:, None] + (b - a)[:, None] * np.linspace(0.0, 0.875, 8)).ravel(), b[-1])
    rates = wheel_rates_along(robot, trajectory(t), trajectory(t, 1))
    return None if rates is None else dict(zip(WHEELS, np.abs(rates).max(axis=0).tolist(), strict=True))


def least_manipulability(robot: Robot, trajectory: Trajectory) -> float:
    """Return the smallest Yoshikawa measure along the motion.

    Holds at: 4 samples a panel, then eight times 17 samples between the neighbours of the smallest.
    """
    tool = ToolKinematics(robot)

    def measured(t: Array) -> Array:
        J = scaled(tool.evaluate(trajectory(t))[1], "full" if robot.n >= 6 else "translation")
        return measures(J).yoshikawa

    a, b = _panels(trajectory)
    t = np.append((a[:, None] + (b - a)[:, None] * np.linspace(0.0, 0.75, 4)).ravel(), b[-1])
    least = np.inf
    for _ in range(9):
        value = measured(t)
        k = int(np.argmin(value))
        least = min(least, float(value[k]))
        t = np.linspace(t[max(k - 1, 0)], t[min(k + 1, len(t) - 1)], 17)
    return least


def _clearance(report: Report) -> tuple[float | None, float | None]:
    """Proved and lowest clearance, m, as the report has them."""
    for check in report.checks:
        if check.name == "collision":
            return check.witness.get("proved_clearance"), check.witness.get("met_clearance")
    return None, None
