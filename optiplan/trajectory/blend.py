"""Rounded corners: a path of straight segments and smooth blends, timed along its whole length without stopping."""

import logging
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.model.robot import Limits, Robot
from optiplan.trajectory.timing import scale_to_limits
from optiplan.trajectory.trajectory import Trajectory

_GRID = 0.01  # s at full joint speed between the points where TOPP-RA looks at the path
_MOST_PARTS = 5000  # of that grid and of the spline, so that a motion of hours is timed in seconds as well
_FINEST = 4e-3  # s: shortest span of the spline
_TORQUE_SHARE = 0.98  # of the limits; the rest is for what the spline does between the points of the grid
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


def time_blended(path: Trajectory, robot: Robot, limits: Limits, gentleness: float = 1.0) -> Trajectory | None:
    """Run along a path from rest to rest nearly as fast as its limits allow.

    TOPP-RA gives the fastest motion p(t) under velocity, acceleration and torque limits. Its samples p(k h) are the
    control points of a uniform cubic B-spline, whose derivatives are bounded by divided differences of the samples: at
    most the velocity and acceleration of p and, with h = max_j 2 a_j / j_j, at most the jerk limits. The spline leaves
    the path by about h^2 |acceleration| / 6, in curves only. Exact extrema scale it to velocity, acceleration and jerk
    limits: these hold at all times. Torque limits hold nearly, at the points of the grid.

    Args:
        path: q over a parameter s, continuous up to its second derivative.
        robot: gives the torques.
        limits: of the n joints.
        gentleness: in (0, 1]: share of the acceleration to use; the distance to the path falls with its third power.

    Returns:
        None where TOPP-RA finds no solution: gravity needs more torque than allowed.
    """
    fast = _toppra(path, robot, limits, gentleness)
    if fast is None:
        return None
    h = max(gentleness * float((2.0 * limits.acceleration / limits.jerk).max()), _FINEST * gentleness)
    count = int(np.ceil(min(fast.duration / h, _MOST_PARTS)))
    h = fast.duration / count
    samples = np.asarray(fast(np.linspace(0.0, fast.duration, count + 1)))
    samples[[0, -1]] = path.start, path.end
    control = np.vstack([path.start, path.start, samples, path.end, path.end])
    knots = h * (np.arange(len(control) + 4) - 3.0)
    return scale_to_limits(Trajectory.from_bspline(path.joint_names, knots, control, 3), limits)


def _bezier_coefficients(control: Array, size: float) -> Array:
    """Ascending powers (6, n) of the quintic Bézier curve with control points (6, n) over a parameter [0, size]."""
    differences, result = control, []
    for k, binomial in enumerate((1, 5, 10, 10, 5, 1)):
        result.append(binomial * differences[0] / size**k)
        differences = np.diff(differences, axis=0)
    return np.array(result)


def _toppra(path: Trajectory, robot: Robot, limits: Limits, gentleness: float) -> Any:
    """Time-optimal parametrisation from rest to rest, a callable with `duration`; None when there is none.

    With the constant-acceleration parametrizer: the default one exceeds the acceleration limits by several per cent.
    """
    logging.getLogger("toppra").addHandler(logging.NullHandler())
    from toppra.algorithm import TOPPRA
    from toppra.interpolator import AbstractGeometricPath

    class Path(AbstractGeometricPath):  # type: ignore[misc]  # toppra has no types
        dof = path.n
        path_interval = np.array([0.0, path.duration])
        waypoints = None

        def __call__(self, s: Any, order: int = 0) -> Array:
            values = path(np.atleast_1d(s), order)
            return values if np.ndim(s) else values[0]

    step = max(_GRID, path.duration / _MOST_PARTS)
    parts = np.maximum(4, np.ceil(np.diff(path.breakpoints) / step)).astype(int)
    pairs = zip(path.breakpoints[:-1], path.breakpoints[1:], parts, strict=True)
    grid = np.concatenate([[0.0], *(np.linspace(a, b, k + 1)[1:] for a, b, k in pairs)])
    instance = TOPPRA(
        _constraints(robot, limits, gentleness), Path(), gridpoints=grid, parametrizer="ParametrizeConstAccel"
    )
    return instance.compute_trajectory(0.0, 0.0)


def _constraints(robot: Robot, limits: Limits, gentleness: float) -> list[Any]:
    """Velocity, acceleration and, of the joints that have a limit, torque: |rnea(q, v, a)| <= limit."""
    from toppra.constraint import (
        DiscretizationType,
        JointAccelerationConstraint,
        JointVelocityConstraint,
        SecondOrderConstraint,
    )

    acceleration = gentleness * limits.acceleration
    scheme = DiscretizationType.Interpolation  # holds at the grid's far end of each step too
    constraints = [
        JointVelocityConstraint(np.column_stack([-limits.velocity, limits.velocity])),
        JointAccelerationConstraint(np.column_stack([-acceleration, acceleration]), discretization_scheme=scheme),
    ]
    limited = np.isfinite(limits.torque)
    if limited.any():
        data = robot.model.createData()
        rows = np.vstack([np.eye(robot.n)[limited], -np.eye(robot.n)[limited]])
        bounds = np.tile(limits.torque[limited], 2) * _TORQUE_SHARE

        def torque(q: Array, v: Array, a: Array) -> Array:
            return np.array(pin.rnea(robot.model, data, q, v, a))

        constraints.append(
            SecondOrderConstraint(torque, lambda _: rows, lambda _: bounds, robot.n, discretization_scheme=scheme)
        )
    return constraints
