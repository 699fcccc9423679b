"""Cubic and quintic splines through points: with given velocities, or with derivatives as continuous as can be.

Source: Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and Robots, sections 4.4 and 4.5; Craig,
Introduction to Robotics, section 7.3.
"""

from typing import Literal

import numpy as np

from optiplan.arrays import Array, distinct
from optiplan.libraries import loading
from optiplan.robot.robot import Limits
from optiplan.trajectory.paths.hermite import hermite_trajectory
from optiplan.trajectory.timing.time_scaling import scale_to_limits
from optiplan.trajectory.trajectory import Trajectory

Degree = Literal[3, 5]

_SHORTEST = 1e-3  # s between two points
_ROUNDS = 12  # of evening out the segments
_SAMPLES = 17  # of a segment
_EVENING = 0.5  # power of a segment's excess by which it is stretched


def knot_times(points: Array, limits: Limits) -> Array:
    """Times (k,), s, from 0 on, for points (k, n): longer where the limits ask for more time.

    A segment takes max_j max(|d_j| / v_j, sqrt(|d_j| / a_j), cbrt(|d_j| / j_j)) for its step d: right in proportion,
    to be scaled as a whole.
    """
    step = np.abs(np.diff(points, axis=0))
    least = np.stack([step / limits.velocity, np.sqrt(step / limits.acceleration), np.cbrt(step / limits.jerk)])
    return np.concatenate([[0.0], np.cumsum(np.maximum(least.max(axis=(0, 2)), _SHORTEST))])


def heuristic_velocities(points: Array, times: Array) -> Array:
    """Velocities (k, n) at points (k, n): zero at the ends and where the mean slopes (q_i+1 - q_i) / h_i change sign.

    Elsewhere they are the mean of the two slopes. No joint with such velocities turns round but at a point.
    """
    slope = np.diff(points, axis=0) / np.diff(times)[:, None]
    inner = np.where(slope[:-1] * slope[1:] > 0.0, 0.5 * (slope[:-1] + slope[1:]), 0.0)
    return np.pad(inner, ((1, 1), (0, 0)))


def spline_of_velocities(
    points: Array, times: Array, velocities: Array, degree: Degree, joint_names: tuple[str, ...]
) -> Trajectory:
    """One polynomial between two points, with these velocities at the points.

    Cubic ones are then determined; their acceleration jumps. Quintic ones have the accelerations, zero at both ends, of
    `continuous_jerk`.

    Args:
        points: (k, n), rad or m.
        times: (k,) increasing from 0, s.
        velocities: (k, n), rad/s or m/s.
        degree: 3 or 5.
        joint_names: of the n joints.
    """
    state = np.stack([points, velocities], axis=1)  # (k, 2, n)
    if degree == 5:
        state = np.concatenate([state, continuous_jerk(points, times, velocities)[:, None]], axis=1)
    return hermite_trajectory(joint_names, times, state)


def continuous_jerk(points: Array, times: Array, velocities: Array) -> Array:
    """Accelerations (k, n), zero at both ends, with which a quintic spline of these velocities has no step of jerk.

    With h_i = t_i+1 - t_i and d_i = q_i+1 - q_i they solve, for every inner point i,

        3 a_i-1 / h_i-1 - 9 (1 / h_i-1 + 1 / h_i) a_i + 3 a_i+1 / h_i
            = 60 (d_i-1 / h_i-1^3 - d_i / h_i^3) - (24 v_i-1 + 36 v_i) / h_i-1^2 + (36 v_i + 24 v_i+1) / h_i^2.

    The matrix has three diagonals and a dominant one: there is one solution. Args as `spline_of_velocities`.
    """
    with loading():
        from scipy.linalg import solve_banded

    h = np.diff(times)[:, None]
    d, v, inverse = np.diff(points, axis=0) / h**3, velocities, 1.0 / h[:, 0]
    right = 60.0 * (d[:-1] - d[1:]) - (24.0 * v[:-2] + 36.0 * v[1:-1]) / h[:-1] ** 2
    right += (36.0 * v[1:-1] + 24.0 * v[2:]) / h[1:] ** 2
    accelerations = np.zeros_like(points)
    if len(right):
        beside = 3.0 * inverse[1:-1]
        middle = -9.0 * (inverse[:-1] + inverse[1:])
        bands = np.stack([np.append(0.0, beside), middle, np.append(beside, 0.0)])
        accelerations[1:-1] = solve_banded((1, 1), bands, right)
    return accelerations


def smooth_spline(
    points: Array, times: Array, degree: Degree, joint_names: tuple[str, ...], still: bool = True
) -> Trajectory:
    """The spline through points whose derivatives up to the last but one are continuous, from rest to rest.

    The cubic one has continuous acceleration: its velocities at the points are determined by
    h_i v_i-1 + 2 (h_i-1 + h_i) v_i + h_i-1 v_i+1 = 3 (h_i d_i-1 / h_i-1 + h_i-1 d_i / h_i). If it is `still`, it begins
    and ends without acceleration, by one more knot in the middle of the first and of the last segment. A single segment
    gets two, at thirds. The quintic one has continuous jerk and snap, and no acceleration at the ends. Both are
    solved for as B-splines.

    Args:
        points: (k, n), rad or m.
        times: (k,) increasing from 0, s.
        degree: 3 or 5.
        joint_names: of the n joints.
        still: whether accelerations at both ends are zero; always so with degree 5.
    """
    with loading():
        from scipy.interpolate import make_interp_spline

    breaks, ends = times, [(1, 0.0), (2, 0.0)]
    if degree == 3 and still:
        part = 0.5 if len(times) > 2 else 1.0 / 3.0
        extra = [times[0] + part * (times[1] - times[0]), times[-1] - part * (times[-1] - times[-2])]
        breaks = distinct(np.append(times, extra))
    elif degree == 3:
        ends = ends[:1]
    knots = np.concatenate([np.full(degree, breaks[0]), breaks, np.full(degree, breaks[-1])])
    values = [[(order, np.zeros(points.shape[1])) for order, _ in ends]] * 2
    found = make_interp_spline(times, points, degree, t=knots, bc_type=tuple(values))
    return Trajectory.from_bspline(joint_names, found.t, found.c, degree)


def evened_times(points: Array, times: Array, limits: Limits, degree: Degree) -> Array:
    """Times (k,) in other proportions with which the smooth spline, scaled to the limits, is faster.

    Segments that come nearer to a limit than others, at samples, get more time, in a few rounds; the best is kept.
    """
    names = tuple(map(str, range(points.shape[1])))
    still = bool(np.isfinite(limits.jerk).any())
    found, h = [], np.diff(times)
    for _ in range(_ROUNDS):
        knots = np.concatenate([[0.0], np.cumsum(h)])
        ratios = _segment_ratios(smooth_spline(points, knots, degree, names, still), knots, limits)
        found.append((knots[-1] * ratios.max(), knots))
        h = h * np.maximum(ratios / ratios.max(), 0.1) ** _EVENING
    best = min(found, key=lambda one: one[0])[1]
    exact = [scale_to_limits(smooth_spline(points, t, degree, names, still), limits).duration for t in (times, best)]
    return best if exact[1] < exact[0] else times


def _segment_ratios(trajectory: Trajectory, times: Array, limits: Limits) -> Array:
    """Return the `speed_ratio` of each segment between times (k,), at samples: (k - 1,)."""
    t = times[:-1, None] + np.diff(times)[:, None] * np.linspace(0.0, 1.0, _SAMPLES)
    ratios = np.zeros(len(t))
    for order, limit in ((1, limits.velocity), (2, limits.acceleration), (3, limits.jerk)):
        share = np.abs(trajectory(t.ravel(), order)) / limit
        ratios = np.maximum(ratios, share.max(axis=1).reshape(t.shape).max(axis=1) ** (1.0 / order))
    return ratios
