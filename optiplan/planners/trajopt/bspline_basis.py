"""The curve that is optimised: a clamped B-spline q(u), u in [0, 1], run through in T seconds (t = u T)."""

from functools import cached_property

import numpy as np

from optiplan.arrays import Array
from optiplan.trajectory.bspline import basis_functions

DEGREE = 4
"""Degree of the spline: its acceleration is smooth and its jerk continuous and linear in each span."""

FIXED = 3
"""Control points held at each end: equal ones make position, velocity (0) and acceleration (0) there."""


def bunched_breakpoints(spans: int, bunching: float) -> Array:
    """Breakpoints in [0, 1], (spans + 1,), closer together at both ends, where a fast motion changes its acceleration.

    u(x) = x - b sin(2 pi x) / (2 pi) at equal steps of x, with b = `bunching` in [0, 1); the first and last span are
    then cut once more, at 0.3 of their width, for the rise of the acceleration from zero. Against equal spans this
    takes the distance from the least time of one joint alone from 3 % to 0.7 % at 24 spans.
    """
    x = np.linspace(0.0, 1.0, spans - 1)
    u = x - bunching * np.sin(2.0 * np.pi * x) / (2.0 * np.pi)
    return np.concatenate([[0.0, 0.3 * u[1]], u[1:-1], [1.0 - 0.3 * u[1], 1.0]])


class SplineBasis:
    """Matrices that take control points C (K, n) to samples and to derivative control points.

    With knots w and degree p the derivative's control points are V_i = p (C_{i+1} - C_i) / (w_{i+p+1} - w_{i+1}), those
    of a clamped spline of degree p - 1 (de Boor, A Practical Guide to Splines, ch. X). A spline lies in the convex hull
    of its control points, so bounds on V / T, A / T^2 and J / T^3 hold at all times.

    Attributes:
        free: the control points that are not held by the ends; there are M = K - 6.
        knots: (K + DEGREE + 1,) in [0, 1].
        derivative: matrices D_0 (the identity) to D_3, D_r of shape (K - r, K): control points of the r-th derivative
            with respect to u.
    """

    def __init__(self, breakpoints: Array) -> None:
        self.breakpoints = breakpoints
        self.knots: Array = np.concatenate([np.zeros(DEGREE), breakpoints, np.ones(DEGREE)])
        self.size = len(self.knots) - DEGREE - 1
        self.free = slice(FIXED, self.size - FIXED)
        self.derivative: list[Array] = [np.eye(self.size)]
        for order in range(1, 4):
            degree, knots = DEGREE - order + 1, self.knots[order - 1 : len(self.knots) - order + 1]
            count = self.size - order + 1
            width = knots[degree + 1 : degree + count] - knots[1:count]
            self.derivative.append(degree * np.diff(self.derivative[-1], axis=0) / width[:, None])

    @cached_property
    def jerk_gram(self) -> Array:
        """H (K, K) with C' H C the integral over u of the squared third derivative, which is linear in each span."""
        widths, rows = np.diff(self.breakpoints), self.derivative[3]
        low, high = rows[:-1], rows[1:]
        sums = [low.T * widths @ low, high.T * widths @ high, low.T * widths @ high]
        return np.asarray((sums[0] + sums[1] + 0.5 * (sums[2] + sums[2].T)) / 3.0)

    def at(self, u: Array, order: int = 0) -> Array:
        """Matrix (N, K) that takes C to the derivative of an order (0 to 2) with respect to u, at u (N,)."""
        degree = DEGREE - order
        knots = self.knots[order : len(self.knots) - order]
        return np.asarray(basis_functions(np.clip(u, 0.0, 1.0), knots, degree) @ self.derivative[order])

    def fit(self, u: Array, points: Array) -> Array:
        """Fit control points (K, n) of the least-squares spline through points (N, n) at u (N,), at rest at both ends.

        A small weight on the third derivative determines control points that no sample does.
        """
        basis = self.at(u)
        control = np.empty((self.size, points.shape[1]))
        control[:FIXED], control[-FIXED:] = points[0], points[-1]
        smooth = 1e-4 * self.derivative[3] / np.abs(self.derivative[3]).max()
        rows = np.vstack([basis, smooth])
        right = np.vstack([points, np.zeros((len(smooth), points.shape[1]))])
        right = right - rows[:, :FIXED] @ control[:FIXED] - rows[:, -FIXED:] @ control[-FIXED:]
        control[self.free] = np.linalg.lstsq(rows[:, self.free], right, rcond=None)[0]
        return control

    def shortest_duration(self, control: Array, bounds: tuple[Array, Array, Array]) -> float:
        """Return the least T, s, at which velocity, acceleration and jerk control points respect the bounds (n,)."""
        ratios = [
            float((np.abs(self.derivative[order] @ control) / bounds[order - 1]).max()) ** (1.0 / order)
            for order in (1, 2, 3)
        ]
        return float(max(ratios))
