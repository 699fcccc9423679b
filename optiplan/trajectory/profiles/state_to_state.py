"""The fastest motions between states of motion, and to rest, under limits of velocity, acceleration and jerk (Ruckig).

Each joint moves with constant jerk in phases (constant acceleration, where jerk is not limited). Position limits are
ignored. Source: Berscheid and Kröger, Jerk-limited real-time trajectory generation with arbitrary target states,
RSS 2021.
"""

from collections.abc import Sequence
from math import factorial
from typing import Any

import numpy as np

from optiplan.arrays import Array, distinct
from optiplan.records import dataclass
from optiplan.robot.limits import Limits
from optiplan.trajectory import polynomial
from optiplan.trajectory.paths.hermite import Hermite
from optiplan.trajectory.state import State
from optiplan.trajectory.trajectory import Trajectory

_SHORT = 1e-10
"""s: phases shorter than this are rounding."""


class NoProfile(ValueError):
    """Ruckig finds no motion between a state and rest."""


@dataclass(frozen=True, eq=False)
class BetweenStates:
    """Motion between two states in which all joints arrive together, as fast as can be or in a longer duration."""

    start: State
    end: State
    limits: Limits
    joint_names: tuple[str, ...]
    stretchable = False
    """Slowed down as a whole it would not have its end velocities."""

    @property
    def shortest(self) -> float:
        """Least duration, s."""
        return self.trajectory().duration

    def trajectory(self, duration: float | None = None) -> Trajectory:
        """The motion, in that duration (s) or as fast as can be; durations below the least give the fastest.

        It is the quintic polynomial where Ruckig finds none. So it is where an acceleration is stated for a joint
        without a jerk limit, since Ruckig would let that jump at once.
        """
        jumps = np.isinf(self.limits.jerk) & ((self.start.a != 0.0) | (self.end.a != 0.0))
        found = None if jumps.any() else fastest(self.start, self.end, self.limits, self.joint_names, duration)
        if found is not None:
            return found
        start, end = (np.array([state.q, state.v, state.a]) for state in (self.start, self.end))
        return Hermite(start, end, self.limits, self.joint_names).trajectory(duration)


def fastest(
    start: State, end: State, limits: Limits, joint_names: Sequence[str], least: float | None = None
) -> Trajectory | None:
    """Return the motion of least duration in which all joints arrive together; None where Ruckig finds none.

    With `least`, s, the duration is at least that.
    """
    answer = _solved(start, end, limits, together=True, least=least)
    return None if answer is None or answer.duration <= _SHORT else _trajectory(start, answer, limits, joint_names)


def fastest_stop(start: State, limits: Limits, joint_names: Sequence[str]) -> Trajectory | None:
    """Return the motion in which each joint stops as soon as it can, then waits for the others; None at rest already.

    Raises:
        NoProfile: Ruckig finds none.
    """
    answer = _solved(start, None, limits, together=False)
    if answer is None:
        raise NoProfile("no motion within the limits leads from this state to rest")
    return None if answer.duration <= _SHORT else _trajectory(start, answer, limits, joint_names)


def fastest_run_up(end: State, limits: Limits, joint_names: Sequence[str]) -> Trajectory | None:
    """Return the motion from rest into a state in the least time of each joint: `fastest_stop` backwards in time.

    Raises:
        NoProfile: Ruckig finds none.
    """
    stop = fastest_stop(State.of(end.q, -end.v, end.a), limits, joint_names)
    return None if stop is None else reversed_in_time(stop)


def reversed_in_time(motion: Trajectory) -> Trajectory:
    """Return q(T - t)."""
    rows = []
    for order in range(motion.coefficients.shape[1]):
        at_ends = polynomial.evaluate(np.swapaxes(motion.derivatives(order), 1, 2), motion.widths[:, None])
        rows.append((-1.0) ** order * at_ends[::-1] / factorial(order))
    edges = np.concatenate([[0.0], np.cumsum(motion.widths[::-1])])
    return Trajectory(motion.joint_names, edges, np.stack(rows, axis=1))


def joint_times_between(start: State, end: State, limits: Limits) -> Array | None:
    """Return the least time, s, of each joint alone from state to state: (n,); None where Ruckig finds none."""
    answer = _solved(start, end, limits, together=False)
    return None if answer is None else np.array(answer.independent_min_durations)


def _solved(start: State, end: State | None, limits: Limits, *, together: bool, least: float | None = None) -> Any:
    """Ruckig's trajectory; to rest anywhere, where there is no end."""
    import ruckig

    n = start.n
    request, answer = ruckig.InputParameter(n), ruckig.Trajectory(n)
    request.current_position, request.current_velocity = start.q.tolist(), start.v.tolist()
    request.current_acceleration = start.a.tolist()
    request.max_velocity, request.max_acceleration = limits.velocity.tolist(), limits.acceleration.tolist()
    request.max_jerk = limits.jerk.tolist()
    request.synchronization = ruckig.Synchronization.Time if together else ruckig.Synchronization.No
    if least is not None:
        request.minimum_duration = least
    if end is None:
        request.control_interface = ruckig.ControlInterface.Velocity
    else:
        request.target_position, request.target_velocity = end.q.tolist(), end.v.tolist()
        request.target_acceleration = end.a.tolist()
    try:
        result = ruckig.Ruckig(n).calculate(request, answer)
    except ruckig.RuckigError:
        return None
    good = (ruckig.Result.Working, ruckig.Result.Finished)
    return answer if result in good and np.isfinite(answer.duration) else None


def _trajectory(start: State, answer: Any, limits: Limits, joint_names: Sequence[str]) -> Trajectory:
    """Pieces of Ruckig's phases, integrated anew from the start so that positions and velocities do not jump."""
    phases = [_phases(profile, np.isinf(limit)) for profile, limit in zip(answer.profiles[0], limits.jerk, strict=True)]
    edges = distinct(np.concatenate([[0.0], *(np.cumsum([h for h, _ in joint]) for joint in phases)]))
    edges = edges[np.concatenate([[True], np.diff(edges) > _SHORT])]
    h, n = np.diff(edges), start.n
    coefficients = np.zeros((len(h), 4, n))
    middles = 0.5 * (edges[1:] + edges[:-1])
    for j, joint in enumerate(phases):
        ends = np.cumsum([duration for duration, _ in joint])
        place = np.searchsorted(ends, middles)
        q, v, a = float(start.q[j]), float(start.v[j]), float(start.a[j])
        for i, k in enumerate(place):
            constant, jerk = (None, 0.0) if k >= len(joint) else joint[k][1]
            if np.isinf(limits.jerk[j]):
                a = constant or 0.0
            coefficients[i, :, j] = q, v, a / 2.0, jerk / 6.0
            q += h[i] * (v + h[i] * (a / 2.0 + h[i] * jerk / 6.0))
            v += h[i] * (a + h[i] * jerk / 2.0)
            a += h[i] * jerk
    return Trajectory(tuple(joint_names), edges, coefficients)


def _phases(profile: Any, jumps: bool) -> list[tuple[float, tuple[float | None, float]]]:
    """Durations of a joint's phases, s, with the acceleration, where that `jumps`, and the jerk of each."""
    parts = [(profile.brake.t, profile.brake.a, profile.brake.j), (profile.t, profile.a, profile.j)]
    parts += [(profile.accel.t, profile.accel.a, profile.accel.j)]
    found: list[tuple[float, tuple[float | None, float]]] = []
    for times, accelerations, jerks in parts:
        for h, a, jerk in zip(times, accelerations, jerks, strict=False):
            if h > 0.0:
                found.append((h, (a if jumps else None, 0.0 if jumps else jerk)))
    return found
