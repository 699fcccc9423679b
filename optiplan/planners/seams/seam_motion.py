"""The motion along a path: joints on a smooth curve over the path's length, at its speed, with a run-in and a run-out.

The joints are a spline of degree five through the configurations at the stations, s = speed t, so pieces are exact.
Before the first point every joint gains its speed along v(tau) = v (3 tau² - 2 tau³) + a T (tau³ - tau²), tau = t / T,
and loses it likewise after the last one. With ramps that law is s(t) itself, next to corners and ends.
"""

import itertools
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from optiplan.arrays import Array
from optiplan.libraries import loading
from optiplan.planners.common.limit_violations import Excess, excess
from optiplan.planners.common.path_timing import within_torque
from optiplan.planners.seams.seam_tool import SeamTool
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.trajectory.joining import join_trajectories
from optiplan.trajectory.paths.hermite import hermite_trajectory
from optiplan.trajectory.trajectory import Trajectory

_TIMES = np.geomspace(0.02, 4.0, 40)
"""s, of a run-in that are tried."""

_PIECES = 24
"""Pieces of a ramp."""

_SLOWER = 0.85
"""Factor from one speed to the next, where a run is too short to gain all of it."""


@dataclass(frozen=True, eq=False)
class SeamCurveOfJoints:
    """Joints over the length of a path between two corners: a motion of which a second is a metre; from `low`, m."""

    low: float
    curve: Trajectory

    def state(self, s: Array) -> Array:
        """Return q, dq/ds, d²q/ds² (N, 3, n) at lengths s (N,), m."""
        at = np.clip(s - self.low, 0.0, self.curve.duration)
        return np.stack([self.curve(at, order) for order in range(3)], axis=1)


def joint_curves(problem: Problem, tool: SeamTool, s: Array, Q: Array) -> list[SeamCurveOfJoints]:
    """Return the splines through configurations Q (N, n) at lengths s (N,), m, from corner to corner."""
    with loading():
        from scipy.interpolate import make_interp_spline

    found = []
    for low, high in tool.path.curve.runs():
        own = np.flatnonzero((s >= low - 1e-12) & (s <= high + 1e-12))
        degree = min(5, len(own) - 1)
        degree -= degree % 2 == 0
        spline = make_interp_spline(s[own] - low, Q[own], k=degree)
        curve = Trajectory.from_bspline(problem.robot.joint_names, spline.t, spline.c, degree)
        found.append(SeamCurveOfJoints(low, curve))
    return found


def steady(one: SeamCurveOfJoints, speed: float) -> Trajectory:
    """Return the joints at a constant speed of the tool, m/s."""
    return one.curve.scaled(one.curve.duration / speed)


def run_up(problem: Problem, state: Array, *, out: bool) -> Trajectory | Excess | None:
    """Return a motion from rest to a state (3, n) of joints, or `out` of it to rest, as short as limits let it be.

    What passes a limit in the gentlest one tried, otherwise; None where torques do.
    """
    q, v, a = state

    def lasting(T: float) -> Trajectory:
        rest = q - 0.5 * T * v + T * T / 12.0 * a if not out else q + 0.5 * T * v + T * T / 12.0 * a
        standing = np.stack([rest, 0.0 * q, 0.0 * q])
        ends = [state, standing] if out else [standing, state]
        return hermite_trajectory(problem.robot.joint_names, np.array([0.0, T]), np.array(ends))

    return first_within_limits(problem, map(lasting, _TIMES))


def ramped(problem: Problem, one: SeamCurveOfJoints, speed: float, ramp: float) -> Trajectory | Excess | None:
    """Return the joints from rest to rest between two corners, at the speed, m/s, but within `ramp`, m, of both ends.

    What passes a limit otherwise; None where torques do.
    """
    length = one.curve.duration
    longest = min(ramp, 0.5 * length)
    speeds = [speed]
    while 2.0 * ramp >= length and speeds[-1] > 1e-3 * speed:
        speeds.append(_SLOWER * speeds[-1])
    tried = itertools.product(speeds, (0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0))
    return first_within_limits(problem, (_with_ramps(problem, one, own, share * longest) for own, share in tried))


def _with_ramps(problem: Problem, one: SeamCurveOfJoints, speed: float, way: float) -> Trajectory:
    """Return the joints that gain the speed on the first `way`, m, hold it, and lose it on the last."""
    length, T = one.curve.duration, 2.0 * way / speed
    tau = np.linspace(0.0, 1.0, _PIECES + 1)
    gained = way * (2.0 * tau**3 - tau**4)
    rates = np.stack([speed * (3.0 * tau**2 - 2.0 * tau**3), speed / T * 6.0 * (tau - tau**2)])
    t, s, law = [T * tau], [gained], [rates]
    knots = one.curve.breakpoints
    inner = knots[(knots > way * 1.0001) & (knots < (length - way) * 0.9999)]
    t.append(T + (inner - way) / speed)
    s.append(inner)
    law.append(np.stack([np.full(len(inner), speed), np.zeros(len(inner))]))
    begin = T + (length - 2.0 * way) / speed
    skipped = 1 if length - 2.0 * way < 1e-9 else 0
    t.append((begin + T * tau)[skipped:])
    s.append((length - gained[::-1])[skipped:])
    law.append((rates[:, ::-1] * np.array([[1.0], [-1.0]]))[:, skipped:])
    times, places, both = np.concatenate(t), np.concatenate(s), np.concatenate(law, axis=1)
    X = one.state(one.low + places)
    v = X[:, 1] * both[0][:, None]
    a = X[:, 2] * both[0][:, None] ** 2 + X[:, 1] * both[1][:, None]
    return hermite_trajectory(problem.robot.joint_names, times, np.stack([X[:, 0], v, a], axis=1))


def _held(problem: Problem, motion: Trajectory) -> bool:
    """Whether a motion keeps torque limits as fast as it is."""
    slowed = within_torque(problem.robot, problem.limits, motion)
    return slowed is not None and slowed.duration <= motion.duration * (1.0 + 1e-9)


def first_within_limits(problem: Problem, motions: Iterable[Trajectory]) -> Trajectory | Excess | None:
    """Return the first motion that keeps all limits, else what passes one in the last; None where torques do."""
    worst: Excess | None = None
    for motion in motions:
        worst = excess(motion, problem.limits)
        if worst is None and _held(problem, motion):
            return motion
    return worst


def joined(parts: list[Trajectory]) -> Trajectory:
    """Return motions one after another."""
    return replace(join_trajectories(parts), segments=())
