"""Find the worst limit violation of a motion, on exact extrema, and report it as a `limits` failure."""

from math import ceil, floor, log10

import numpy as np

from optiplan.planners.base import Failure
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.robot.batched.dynamics import inverse_dynamics
from optiplan.robot.limits import ORDERS
from optiplan.robot.robot import Limits, Robot
from optiplan.trajectory.trajectory import Trajectory

_ROUNDING = 5e-7  # share of a limit, and rad or m: rounding of short pieces late in a long motion
_ACCELERATION_STEP = 1e-6  # share of the acceleration limit: smaller steps are rounding
_SAMPLES = 1000


@dataclass(frozen=True)
class Excess:
    """Joint `joint` reaches `value` of `quantity` at time `t` (s), beyond its `limit`."""

    joint: int
    quantity: str
    value: float
    limit: float
    t: float


def excess(trajectory: Trajectory, limits: Limits) -> Excess | None:
    """Return the worst violation of the position, velocity, acceleration and jerk limits, or None; at all times.

    Violations are compared by the slowdown that they require, (value / limit)^(1 / order).
    """
    found: list[tuple[float, Excess]] = []
    e = trajectory.extrema_at(0)
    for value, limit, beyond, t in (
        (e.low, limits.lower, limits.lower - e.low, e.t_low),
        (e.high, limits.upper, e.high - limits.upper, e.t_high),
    ):
        j = int(np.argmax(beyond))
        found.append((float(beyond[j]), Excess(j, "position", float(value[j]), float(limit[j]), float(t[j]))))
    for order in (1, 2, 3):
        e, limit = trajectory.extrema_at(order), getattr(limits, ORDERS[order])
        value = np.maximum(e.high, -e.low)
        t = np.where(e.high >= -e.low, e.t_high, e.t_low)
        j = int(np.argmax(value / limit))
        share = float(value[j] / limit[j]) ** (1.0 / order) - 1.0
        found.append((share, Excess(j, ORDERS[order], float(value[j]), float(limit[j]), float(t[j]))))
    most, where = max(found, key=lambda entry: entry[0])
    return where if most > _ROUNDING else None


def acceleration_steps(trajectory: Trajectory, problem: Problem) -> bool:
    """Return whether the acceleration of a joint with a jerk limit jumps, also from and to that stated at the ends."""
    limits, end = problem.limits, problem.end_states(trajectory.end)[0]
    ends = trajectory(np.array([0.0, trajectory.duration]), 2) - [problem.start_acceleration, end.a]
    steps = np.abs(np.vstack([ends, trajectory.jumps(2)])).max(axis=0)
    return bool((np.isfinite(limits.jerk) & (steps > _ACCELERATION_STEP * limits.acceleration)).any())


def beyond_limits(robot: Robot, over: Excess, trajectory: Trajectory, shortest: float | None) -> Failure:
    """Return a `limits` failure: the limit exceeded, the motion, and the shortest duration (s) that keeps it."""
    joint = trajectory.joint_names[over.joint]
    unit = robot.unit(over.quantity, over.joint)
    reached = f"'{joint}' would reach {over.quantity} {over.value:.4g} {unit}, beyond its limit {over.limit:.4g}"
    detail = f"{reached}, in {trajectory.duration:.6g} s; {_other_duration(shortest)}"
    q = trajectory(np.array([over.t]))[0].tolist()
    place = {"joint": joint, "quantity": over.quantity, "value": over.value, "limit": over.limit, "t": over.t, "q": q}
    shown = {"motion": trajectory.to_dict()}
    return Failure("limits", detail, place | shown | ({} if shortest is None else {"shortest_duration": shortest}))


def beyond_torque(robot: Robot, limits: Limits, trajectory: Trajectory, shortest: float | None) -> Failure:
    """Report the worst torque violation of a motion that is known to have one."""
    t = np.union1d(np.linspace(0.0, trajectory.duration, _SAMPLES), trajectory.breakpoints)
    torque = np.abs(inverse_dynamics(robot, *(trajectory(t, order) for order in range(3))))
    k, j = np.unravel_index(int(np.argmax(torque / limits.torque)), torque.shape)
    over = Excess(int(j), "torque", float(torque[k, j]), float(limits.torque[j]), float(t[k]))
    return beyond_limits(robot, over, trajectory, shortest)


def _other_duration(shortest: float | None) -> str:
    if shortest is None:
        return "no other duration makes up for it"
    return f"the shortest duration is {rounded_up(shortest)} s"


def rounded_up(value: float) -> str:
    """Return a positive number in six digits, rounded up so that the value printed is feasible."""
    digit = 10.0 ** (floor(log10(value)) - 5)
    return f"{ceil(value / digit) * digit:.6g}"
