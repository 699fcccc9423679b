"""Corners of a path of straight segments, rounded within a stated deviation; vias that must be hit are hit.

The deviation is in the largest joint: every point of the rounded path has a point of the corners' path with
max_j |q_j - p_j| <= deviation, rad or m. Let a corner c have the unit legs u (in) and w (out). Between them both
curves are c - f(s) u + g(s) w with f falling and g rising, g mirroring f. The distance to the nearer leg is at most
min(f, g) |w - u|. It is largest in the middle, where f = g.
"""

import numpy as np

from optiplan.arrays import Array, Flags, distinct
from optiplan.robot.robot import Limits
from optiplan.trajectory.trajectory import Trajectory

BEZIER = 0.1875
"""f = g in the middle of the quintic Bézier blend of `blend_path`, over its size d."""

BSPLINE = 1.0 / 6.0
"""f = g in the middle of a cubic B-spline with control points at d before the corner, on it, and at d behind it."""

_BACK = np.cos(np.radians(170.0))

_INWARD = np.array([1.0, 0.6, 0.2])  # where the control points of a blend lie along its two legs


def bezier_corners(waypoints: Array, deviation: Array, limits: Limits, joint_names: tuple[str, ...]) -> Trajectory:
    """Straight lines and quintic Bézier blends; the parameter and the arguments are those of `bspline_corners`."""
    length, turn = _legs(waypoints, limits)
    half = 0.5 * np.minimum(length[:-1], length[1:])
    return blend_path(waypoints, _size(half, turn, deviation, BEZIER) / half, limits, joint_names)


def bspline_corners(waypoints: Array, deviation: Array, limits: Limits, joint_names: tuple[str, ...]) -> Trajectory:
    """The path as one cubic B-spline of s, twice continuously differentiable, with control points on the segments.

    Knots lie at both ends (four times), at each corner s_c and at s_c ± d. The control point of a knot t_i is the point
    of the corners' path at s = (t_i+1 + t_i+2 + t_i+3) / 3. Farther than d from a corner, neighbouring control points
    lie on one line, and the spline runs along it with its parameter.

    Args:
        waypoints: (k, n), rad or m, k >= 2, neighbours differ.
        deviation: (k - 2,) > 0, of each corner, rad or m: sizes d are as large as it allows, but at most half a leg.
        limits: their velocities make the parameter s, the 2-norm length of q / velocity limit, in s.
        joint_names: of the n joints.
    """
    length, turn = _legs(waypoints, limits)
    s = np.concatenate([[0.0], np.cumsum(length)])
    d = _size(0.5 * np.minimum(length[:-1], length[1:]), turn, deviation, BSPLINE)
    inner = distinct(np.concatenate([s[1:-1] - d, s[1:-1], s[1:-1] + d, s[[0, -1]]]))
    apart = np.diff(inner) > 1e-9 * s[-1]
    inner = np.concatenate([inner[:-1][apart], s[-1:]])  # two blends that meet share a knot
    knots = np.concatenate([np.zeros(3), inner, np.full(3, s[-1])])
    at = (knots[1:-3] + knots[2:-2] + knots[3:-1]) / 3.0
    control = np.stack([np.interp(at, s, column) for column in waypoints.T], axis=1)
    return Trajectory.from_bspline(joint_names, knots, control, 3)


def through_corners(waypoints: Array, hit: Flags, deviation: float, limits: Limits) -> tuple[Array, Array]:
    """Return waypoints with two corners for each one to be hit, and the deviation (k' - 2,) that each may add.

    A corner c to be hit becomes c - e t, c and c + e t, with t between its legs u and w. So the path runs straight
    through c. The two new corners are off the old path by e |t - u| and e |t - w|, at most half the deviation.

    Args:
        waypoints: (k, n), rad or m, neighbours differ.
        hit: (k,) whether; the ends are ignored.
        deviation: of all corners, rad or m.
        limits: their velocities measure the length of a leg, as in `bspline_corners`.
    """
    length, _ = _legs(waypoints, limits)
    leg = np.diff(waypoints, axis=0) / length[:, None]
    points, shares = [waypoints[0]], []
    for i in range(1, len(waypoints) - 1):
        half_turn = 0.5 * np.abs(leg[i] - leg[i - 1]).max()  # |t - u| = |t - w|
        if not hit[i] or half_turn < 1e-9:  # a straight line hits it anyway
            points.append(waypoints[i])
            shares.append(deviation)
            continue
        aside = min(0.5 * deviation / half_turn, 0.25 * length[i - 1], 0.25 * length[i])
        step = aside * 0.5 * (leg[i - 1] + leg[i])
        points += [waypoints[i] - step, waypoints[i] + step]
        shares += [0.5 * deviation] * 2
    return np.array([*points, waypoints[-1]]), np.array(shares)


def reversals(waypoints: Array, limits: Limits) -> Flags:
    """Return whether the path turns back, (k - 2,), by more than 170°, so that no corner can be rounded."""
    step = np.diff(waypoints, axis=0) / limits.velocity
    unit = step / np.linalg.norm(step, axis=1)[:, None]
    return np.asarray((unit[:-1] * unit[1:]).sum(axis=1) < _BACK)


def _legs(waypoints: Array, limits: Limits) -> tuple[Array, Array]:
    """Lengths (k - 1,), s at full speed, and |w - u| (k - 2,) in the largest joint, (rad or m) / s."""
    step = np.diff(waypoints, axis=0)
    length = np.linalg.norm(step / limits.velocity, axis=1)
    return length, np.abs(np.diff(step / length[:, None], axis=0)).max(axis=1, initial=0.0)


def _size(most: Array, turn: Array, deviation: Array, factor: float) -> Array:
    """Sizes d (k - 2,): factor d |w - u| = deviation, at most `most`."""
    with np.errstate(divide="ignore"):
        return np.asarray(np.minimum(most, deviation / (factor * turn)))


def blend_path(waypoints: Array, fractions: Array, limits: Limits, joint_names: tuple[str, ...]) -> Trajectory:
    """Straight segments between waypoints (k, n) whose inner corners are rounded; twice continuously differentiable.

    The "time" of the result is the path's parameter, the 2-norm length of q / velocity limit, in s. The blend at corner
    c with unit legs u (in) and w (out) is the quintic Bézier curve with control points c - d (1, 0.6, 0.2) u and
    c + d (0.2, 0.6, 1) w. It leaves the corner by 0.1875 d |w - u|.

    Args:
        waypoints: (k, n), rad or m, k >= 2, neighbours differ.
        fractions: (k - 2,) in (0, 1]: d as a share of half the shorter segment at the corner.
        limits: of the n joints.
        joint_names: of the n joints.
    """
    length = np.linalg.norm(np.diff(waypoints, axis=0) / limits.velocity, axis=1)
    leg = np.diff(waypoints, axis=0) / length[:, None]
    d = np.concatenate([[0.0], fractions * 0.5 * np.minimum(length[:-1], length[1:]), [0.0]])
    sizes, pieces = [], []
    for i in range(len(leg)):
        straight = length[i] - d[i] - d[i + 1]
        if straight > 1e-9 * length[i]:
            pieces.append(np.vstack([waypoints[i] + d[i] * leg[i], leg[i], np.zeros((4, len(leg[i])))]))
            sizes.append(straight)
        if i + 1 < len(leg):
            c = waypoints[i + 1]
            control = np.vstack(
                [c - d[i + 1] * np.outer(_INWARD, leg[i]), c + d[i + 1] * np.outer(_INWARD[::-1], leg[i + 1])]
            )
            pieces.append(_bezier_coefficients(control, 2.0 * d[i + 1]))
            sizes.append(2.0 * d[i + 1])
    return Trajectory(joint_names, np.concatenate([[0.0], np.cumsum(sizes)]), np.array(pieces))


def _bezier_coefficients(control: Array, size: float) -> Array:
    """Ascending powers (6, n) of the quintic Bézier curve with control points (6, n) over a parameter [0, size]."""
    differences, result = control, []
    for k, binomial in enumerate((1, 5, 10, 10, 5, 1)):
        result.append(binomial * differences[0] / size**k)
        differences = np.diff(differences, axis=0)
    return np.array(result)
