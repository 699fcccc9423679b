"""Rounded corners: a path of straight segments and smooth blends."""

import numpy as np

from optiplan.arrays import Array
from optiplan.robot.robot import Limits
from optiplan.trajectory.trajectory import Trajectory

_INWARD = np.array([1.0, 0.6, 0.2])  # where the control points of a blend lie along its two legs


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
