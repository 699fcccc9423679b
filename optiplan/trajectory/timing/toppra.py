"""The fastest time law along a path under velocity, acceleration, torque and tool limits: TOPP-RA.

Pham & Pham 2018, A new approach to time-optimal path parameterization based on reachability analysis.
"""

import logging
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.libraries import loading
from optiplan.trajectory.timing.path_constraints import Rows
from optiplan.trajectory.trajectory import Trajectory

_QUIET = logging.NullHandler()  # "no solution" is a value here, not a warning
_UNBOUNDED = 1e6  # stands for a speed without a limit


def fastest_law(rows: Rows) -> Trajectory | None:
    """The time law s(t) from rest at s[0] to rest at s[-1] that no other beats on this grid.

    Between neighbouring points of the grid sdd is constant: s(t) in exact quadratic pieces.

    Holds at: the points of the grid, from both sides; in between nearly, see `slowness`.

    Args:
        rows: the limits at the points of the grid.

    Returns:
        None where the solver finds none.
    """
    speeds = _speeds(rows)
    if speeds is None:
        return None
    ds, total = np.diff(rows.s), speeds[:-1] + speeds[1:]
    if not (total > 0.0).all():
        return None
    dt = 2.0 * ds / total
    coefficients = np.stack([rows.s[:-1] - rows.s[0], speeds[:-1], 0.5 * np.diff(speeds) / dt], axis=1)
    return Trajectory(("s",), np.concatenate([[0.0], np.cumsum(dt)]), coefficients[:, :, None])


def slowness(law: Trajectory, between: Rows) -> Array:
    """Return the ratio, (k,), by which the profile of `fastest_law` exceeds the limits at interval midpoints.

    Args:
        law: s(t), of constant sdd in each of its k pieces.
        between: the limits at the k middles in s.
    """
    squares = law(law.breakpoints, 1)[:, :1] ** 2
    squared, sdd = 0.5 * (squares[1:] + squares[:-1]), 2.0 * law.coefficients[:, 2]
    motion = between.A * sdd + between.B * squared
    available = np.maximum(between.bound - np.sign(motion) * between.G, 1e-3 * between.bound)
    worst: Array = np.maximum(np.sqrt(squared[:, 0]) / between.speed, np.sqrt((np.abs(motion) / available).max(axis=1)))
    return worst


def _speeds(rows: Rows) -> Array | None:
    """Largest sd at every point of the grid, (k,); None where there is no solution."""
    logging.getLogger("toppra").addHandler(_QUIET)
    with loading():
        from toppra.algorithm import TOPPRA
        from toppra.constraint import LinearConstraint
        from toppra.constraint.linear_constraint import canlinear_colloc_to_interpolate
        from toppra.interpolator import AbstractGeometricPath

    m = rows.A.shape[1]
    F, g = np.vstack([np.eye(m), -np.eye(m)]), np.tile(rows.bound, 2)
    squared = np.column_stack([np.zeros(len(rows.s)), np.minimum(rows.speed, _UNBOUNDED) ** 2])

    class Given(LinearConstraint):  # type: ignore[misc]  # toppra has no types
        dof = 1

        def __init__(self) -> None:
            super().__init__()
            self.identical = True

        def compute_constraint_params(self, path: Any, grid: Array) -> Any:
            both_ends = canlinear_colloc_to_interpolate(rows.A, rows.B, rows.G, F, g, None, None, grid, True)
            return *both_ends[:5], None, squared

    class ScalarPath(AbstractGeometricPath):  # type: ignore[misc]
        dof, path_interval, waypoints = 1, rows.s[[0, -1]], None

        def __call__(self, s: Any, order: int = 0) -> Array:
            return np.zeros((*np.shape(s), 1))

    instance = TOPPRA([Given()], ScalarPath(), gridpoints=rows.s, solver_wrapper="seidel")
    answer = instance.compute_parameterization(0.0, 0.0)[1]
    return None if answer is None or np.isnan(answer).any() else np.asarray(answer)
