"""Building blocks of the inequalities of constraints."""

from collections.abc import Callable
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.kinematics.symbolic.state import SymbolicState
from optiplan.planners.path_constraints.inequality import Inequality

LENGTH, ANGLE = 0.01, 0.05
"""m and rad: violations that cost as much as a missing centimetre of clearance, where tolerances are wide."""

_FINE = 5.0
"""Times its tolerance that the unit of a constraint is at most, if that is less."""

RESERVE = 0.1
"""Share of a tolerance reserved for the motion between samples …"""

_MOST_RESERVE = 0.1
"""… but no more than this share of `LENGTH` and `ANGLE`."""

NARROW = 0.02
"""rad or m: within less than this, every coordinate gets rows of its own, so that a step cannot leave sideways."""

TINY = 1e-14
"""Added to squares, so that lengths have derivatives at zero."""


def held_to(name: str, build: Callable[[SymbolicState], Any], tolerance: float, unit: float) -> Inequality:
    """Return the inequality of a tolerance, in a unit of at most `unit`; both rad or m."""
    fine = min(unit, max(_FINE * tolerance, 0.1 * unit))
    return Inequality(name, build, fine, min(RESERVE * tolerance, _MOST_RESERVE * unit))


def turned_within(k: SymbolicState, R: Any, within: float) -> Any:
    """Return rows of: rotation R turns by less than an angle.

    (cos - cos w) / sin w, and the coordinates of sin times axis where w is small.
    """
    within = min(within, np.pi)
    cosine = 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    if within >= NARROW:
        return (cosine - k.constant(np.cos(within))) / k.constant(max(np.sin(within), 0.1))
    axis = 0.5 * stacked(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1])
    return stacked(within_box(k, axis, within), cosine)


def within_ball(k: SymbolicState, e: Any, radius: float) -> Any:
    """Return rows of: |e| <= radius, in each coordinate if that is small."""
    if radius < NARROW:
        return within_box(k, e, radius)
    return (k.constant(radius**2) - e.T @ e) / k.constant(2.0 * radius)


def within_box(k: SymbolicState, e: Any, radius: float) -> Any:
    """Return rows of: |e_i| <= radius / sqrt(number of coordinates)."""
    return both_sides(k, e, radius / np.sqrt(e.shape[0]))


def both_sides(k: SymbolicState, e: Any, within: float | Array) -> Any:
    """Return rows of: |e_i| <= within, one for all coordinates or one each."""
    limit = k.constant(within)
    return stacked(limit - e, limit + e)


def stacked(*parts: Any) -> Any:
    """Return the expressions below one another."""
    import casadi

    return casadi.vertcat(*parts)
