"""How long a motion takes: the physical lower bound, slowing down to the limits, and straight lines with stops.

Everything here rests on one curve: the fastest motion of one coordinate from rest to rest over a distance D under
symmetric bounds V, A, J on velocity, acceleration and jerk. Its acceleration rises for t_j, stays for t_a, falls for
t_j; then the velocity stays for t_v; then all of it backwards:

    t_j = min(A / J, sqrt(V / J), cbrt(D / 2J)),   a = J t_j,
    t_a = max(0, min(V / a - t_j, (sqrt(t_j^2 + 4 D / a) - 3 t_j) / 2)),   v = a (t_j + t_a),
    t_v = max(0, D / v - 2 t_j - t_a),   T = 4 t_j + 2 t_a + t_v.

Without a bound on jerk (J infinite) t_j = 0 and a = A: the acceleration jumps.
"""

from collections.abc import Sequence

import numpy as np

from optiplan.arrays import Array
from optiplan.robot.robot import Limits
from optiplan.trajectory.trajectory import Trajectory

_ZERO_DISTANCE = 1e-60  # m or rad: stands for "no distance", so that the formulas above need no branch
_REST = 1e-3  # s: a trajectory needs some duration, even one that goes nowhere
_ACCELERATION = np.array([0.0, 1.0, 1.0, 0.0, 0.0, -1.0, -1.0, 0.0])  # around the seven phases, over its peak


def _phases(distance: Array, velocity: Array, acceleration: Array, jerk: Array) -> tuple[Array, Array, Array]:
    """The times t_j, t_a, t_v (s) of the module's curve, element by element; all arrays of one shape."""
    D = np.maximum(distance, _ZERO_DISTANCE)
    t_j = np.minimum(np.minimum(acceleration / jerk, np.sqrt(velocity / jerk)), np.cbrt(D / (2.0 * jerk)))
    with np.errstate(invalid="ignore"):
        a = np.where(np.isinf(jerk), acceleration, jerk * t_j)
    t_a = np.maximum(0.0, np.minimum(velocity / a - t_j, (np.sqrt(t_j**2 + 4.0 * D / a) - 3.0 * t_j) / 2.0))
    t_v = np.maximum(0.0, D / (a * (t_j + t_a)) - 2.0 * t_j - t_a)
    return t_j, t_a, t_v


def lower_bounds(start: Array, goals: Array, limits: Limits) -> Array:
    """Shortest duration conceivable from `start` to each goal, obstacles and position limits ignored.

    The slowest joint's own minimum time from rest to rest; no trajectory of the robot is shorter.

    Args:
        start: (n,) rad or m.
        goals: (k, n) rad or m.
        limits: of the n joints.

    Returns:
        (k,) in s.
    """
    times: Array = joint_times(np.abs(goals - start), limits).max(axis=1)
    return times


def joint_times(distances: Array, limits: Limits) -> Array:
    """Shortest time from rest to rest, s, of each joint over distances (k, n) >= 0, rad or m: (k, n)."""
    t_j, t_a, t_v = _phases(distances, limits.velocity, limits.acceleration, limits.jerk)
    return np.where(distances == 0.0, 0.0, 4.0 * t_j + 2.0 * t_a + t_v)


def lower_bound(start: Array, goal: Array, limits: Limits) -> float:
    """Return the bound of one goal of shape (n,): a duration in s, the denominator of `duration / lower_bound`."""
    return float(lower_bounds(start, goal[None], limits)[0])


def speed_ratio(trajectory: Trajectory, limits: Limits) -> float:
    """Factor by which a trajectory must be slowed down (> 1) or may be sped up (< 1) to touch its limits.

    max over joints of v / v_max, sqrt(a / a_max), cbrt(j / j_max), with the exact extrema v, a, j over all time:
    stretching time by s divides them by s, s^2 and s^3.
    """
    bounds = (limits.velocity, limits.acceleration, limits.jerk)
    peaks = [np.abs(trajectory.extrema(order)).max(axis=0) / bounds[order - 1] for order in (1, 2, 3)]
    return float(max(peaks[0].max(), np.sqrt(peaks[1].max()), np.cbrt(peaks[2].max())))


def scale_to_limits(trajectory: Trajectory, limits: Limits, least: float = 0.0) -> Trajectory:
    """Scale a curve uniformly in time until its tightest limit is just met (all time).

    `least` is a factor on the duration that something else asks for.
    """
    ratio = max(speed_ratio(trajectory, limits), least)
    return trajectory if ratio == 0.0 else trajectory.scaled(trajectory.duration * ratio * (1.0 + 1e-12))


def stop_at_corners(waypoints: Array, limits: Limits, joint_names: Sequence[str]) -> Trajectory:
    """Straight joint-space segments, each from rest to rest in the shortest time, in exact cubic pieces.

    Along a segment of direction d = q_b - q_a the one coordinate s from 0 to 1 has the bounds
    min_j limit_j / |d_j| of velocity, acceleration and jerk.

    Args:
        waypoints: (k, n), rad or m; equal neighbours are passed over. When none differ, the robot rests for 1 ms.
        limits: of the n joints.
        joint_names: of the n joints.
    """
    steps = np.diff(waypoints, axis=0)
    durations, coefficients = [], []
    for q, d in zip(waypoints[:-1], steps, strict=True):
        if np.any(d != 0.0):
            times, pieces = _segment(q, d, limits)
            durations.append(times)
            coefficients.append(pieces)
    if not durations:
        return Trajectory(tuple(joint_names), np.array([0.0, _REST]), waypoints[:1, None])
    breakpoints = np.concatenate([[0.0], np.cumsum(np.concatenate(durations))])
    return Trajectory(tuple(joint_names), breakpoints, np.concatenate(coefficients))


def s_curve(distance: float, velocity: float, acceleration: float, jerk: float) -> tuple[Array, Array]:
    """The module's curve in pieces: durations (m,) in s and ascending coefficients (m, 4) of s(t) from 0 to distance.

    All four are positive; the jerk may be infinite.
    """
    t_j, t_a, t_v = _phases(np.array(distance), np.array(velocity), np.array(acceleration), np.array(jerk))
    times = np.array([t_j, t_a, t_j, t_v, t_j, t_a, t_j])
    peak = acceleration if np.isinf(jerk) else jerk * t_j
    pieces = np.zeros((7, 4))
    s = v = 0.0
    for i, (h, a, b) in enumerate(zip(times, peak * _ACCELERATION[:-1], peak * _ACCELERATION[1:], strict=True)):
        j = (b - a) / h if h > 0.0 else 0.0
        pieces[i] = s, v, a / 2.0, j / 6.0
        s, v = s + h * (v + h * (a / 2.0 + h * j / 6.0)), v + h * (a + h * j / 2.0)
    kept = times > 1e-12 * times.sum()
    return times[kept], pieces[kept]


def _segment(q: Array, d: Array, limits: Limits) -> tuple[Array, Array]:
    """Durations (m,) and cubic coefficients (m, 4, n) of the fastest rest-to-rest motion from q to q + d."""
    moving = d != 0.0
    size = np.abs(d[moving])
    velocity, acceleration, jerk = (
        float(np.min(bound[moving] / size)) for bound in (limits.velocity, limits.acceleration, limits.jerk)
    )
    times, scalar = s_curve(1.0, velocity, acceleration, jerk)
    pieces = scalar[:, :, None] * d
    pieces[:, 0] += q
    return times, pieces
