"""The curve that is optimised: a clamped B-spline q(u), u in [0, 1], run through in T seconds (t = u T)."""

import math
from functools import cached_property, lru_cache

import numpy as np

from optiplan.arrays import Array, read_only
from optiplan.trajectory.bspline import basis_functions, pieces
from optiplan.trajectory.trajectory import Trajectory

DEGREE = 4
"""Degree of the spline: its acceleration is smooth and its jerk continuous and linear in each span."""

FIXED = 3
"""Control points held at each end: they are its position, velocity and acceleration; equal ones at rest."""

REACH = DEGREE + 1
"""Neighbouring control points that a point of the curve depends on."""


def bunched_breakpoints(spans: int, bunching: float) -> Array:
    """Breakpoints in [0, 1], (spans + 1,), closer together at both ends, where a fast motion changes its acceleration.

    u(x) = x - b sin(2 pi x) / (2 pi) at equal steps of x, with b = `bunching` in [0, 1). The first and last span are
    split at 0.3 of their width, for the rise of the acceleration from zero. With 24 spans, one joint alone takes 0.7 %
    more than its least time, instead of 3 % with equal spans.
    """
    x = np.linspace(0.0, 1.0, spans - 1)
    u = x - bunching * np.sin(2.0 * np.pi * x) / (2.0 * np.pi)
    return np.concatenate([[0.0, 0.3 * u[1]], u[1:-1], [1.0 - 0.3 * u[1], 1.0]])


def moving_breakpoints(spans: int, bunching: float, rests: tuple[bool, bool]) -> Array:
    """Breakpoints of a curve with motion at an end: closer together only at the ends at rest."""
    if all(rests):
        return bunched_breakpoints(spans, bunching)
    if not any(rests):
        return np.linspace(0.0, 1.0, spans + 1)
    from_rest = 2.0 * bunched_breakpoints(2 * spans, bunching)[: spans + 1]
    return from_rest if rests[0] else 1.0 - from_rest[::-1]


@lru_cache(maxsize=8)
def bunched_basis(spans: int, bunching: float, open_end: bool) -> "SplineBasis":
    """Return the basis with these spans, made once."""
    return SplineBasis(bunched_breakpoints(spans, bunching), open_end)


@lru_cache(maxsize=512)  # some 8 kB each: instants by their number come again in later plans, added ones do not
def _matrix(basis: "SplineBasis", order: int, instants: bytes) -> Array:
    """Return the matrix of `SplineBasis.at` at instants, as bytes of an array of float64."""
    knots = basis.knots[order : len(basis.knots) - order]
    u = np.clip(np.frombuffer(instants), 0.0, 1.0)
    return read_only(np.asarray(basis_functions(u, knots, DEGREE - order) @ basis.derivative[order]))


@lru_cache(maxsize=16)
def _least_squares(basis: "SplineBasis", instants: bytes) -> tuple[Array, Array]:
    """Return the rows (N + K - 3, K) of `SplineBasis.fit`, and the pseudo-inverse of their free columns."""
    smooth = 1e-4 * basis.derivative[3] / np.abs(basis.derivative[3]).max()
    rows = np.vstack([basis.at(np.frombuffer(instants)), smooth])
    return rows, np.linalg.pinv(rows[:, basis.free])


class SplineBasis:
    """Matrices that take control points C (K, n) to samples and to derivative control points.

    With knots w and degree p, the derivative is a clamped spline of degree p - 1. Its control points are
    V_i = p (C_{i+1} - C_i) / (w_{i+p+1} - w_{i+1}) (de Boor, A Practical Guide to Splines, ch. X). A spline lies in the
    convex hull of its control points, so bounds on V / T, A / T^2 and J / T^3 hold at all times.

    Attributes:
        open_end: whether the end is free: the last three control points, which are equal, move as one.
        free: the control points that are not held by the ends; there are M = K - 6.
        knots: (K + DEGREE + 1,) in [0, 1].
        derivative: matrices D_0 (the identity) to D_3, D_r of shape (K - r, K): control points of the r-th derivative
            with respect to u.
        bounded: the rows of D_1 to D_3 that some free control point enters; the others are the given motion at the ends
            (zeros at rest).
    """

    def __init__(self, breakpoints: Array, open_end: bool = False) -> None:
        self.breakpoints, self.open_end = breakpoints, open_end
        self.knots: Array = np.concatenate([np.zeros(DEGREE), breakpoints, np.ones(DEGREE)])
        self.size = len(self.knots) - DEGREE - 1
        self.free = slice(FIXED, self.size - FIXED)
        self.derivative: list[Array] = [np.eye(self.size)]
        for order in range(1, 4):
            degree, knots = DEGREE - order + 1, self.knots[order - 1 : len(self.knots) - order + 1]
            count = self.size - order + 1
            width = knots[degree + 1 : degree + count] - knots[1:count]
            self.derivative.append(degree * np.diff(self.derivative[-1], axis=0) / width[:, None])
        self.bounded = [rows[rows[:, self.free].any(axis=1)] for rows in self.derivative[1:]]

    @property
    def variables(self) -> int:
        """Number M of control points that are not held; those of an open end are one."""
        return self.size - 2 * FIXED + self.open_end

    def by_variables(self, matrix: Array) -> Array:
        """Return what a matrix (R, K) of the control points is for the variables: (R, M)."""
        if not self.open_end:
            return matrix[:, self.free]
        return np.column_stack([matrix[:, self.free], matrix[:, -FIXED:].sum(axis=1)])

    def moving(self, control: Array) -> Array:
        """Return the variables (M, n) of control points (K, n)."""
        return control[FIXED : FIXED + self.variables]

    def moved(self, control: Array, change: Array) -> Array:
        """Return control points (K, n) with their variables changed by `change` (M, n)."""
        result = control.copy()
        moving = self.size - 2 * FIXED
        result[self.free] += change[:moving]
        if self.open_end:
            result[-FIXED:] += change[moving]
        return result

    @cached_property
    def _taylor(self) -> Array:
        """Local coefficients by u of the unit control points, (m (DEGREE + 1), K); see `bspline.pieces`."""
        coefficients = pieces(self.knots, np.eye(self.size), DEGREE)[1]
        return np.ascontiguousarray(coefficients.reshape(-1, self.size))

    def trajectory(self, joint_names: tuple[str, ...], control: Array, duration: float) -> Trajectory:
        """Return the motion along the curve with control points (K, n) in a duration, s."""
        coefficients = (self._taylor @ control).reshape(-1, DEGREE + 1, control.shape[1])
        powers = duration ** -np.arange(DEGREE + 1.0)
        return Trajectory(joint_names, self.breakpoints * duration, coefficients * powers[:, None])

    @cached_property
    def jerk_gram(self) -> Array:
        """H (K, K) with C' H C the integral over u of the squared third derivative, which is linear in each span."""
        widths, rows = np.diff(self.breakpoints), self.derivative[3]
        low, high = rows[:-1], rows[1:]
        sums = [low.T * widths @ low, high.T * widths @ high, low.T * widths @ high]
        return np.asarray((sums[0] + sums[1] + 0.5 * (sums[2] + sums[2].T)) / 3.0)

    @cached_property
    def jerk_root(self) -> Array:
        """R (2 spans, K) with |R C|² = C' H C, H of `jerk_gram`: (l² + l h + h²) / 3 = (l + h / 2)² / 3 + h² / 4."""
        widths, rows = np.diff(self.breakpoints)[:, None], self.derivative[3]
        low, high = rows[:-1], rows[1:]
        return np.vstack([np.sqrt(widths / 3.0) * (low + 0.5 * high), 0.5 * np.sqrt(widths) * high])

    def at(self, u: Array, order: int = 0) -> Array:
        """Matrix (N, K), read-only, from C to the derivative of an order (0 to 2) by u, at u (N,); cached."""
        return _matrix(self, order, np.asarray(u, float).tobytes())

    def ends(self, start: Array, end: Array) -> Array:
        """Control points (6, n), three at each end, of q, dq/du and d²q/du² there: `start` and `end`, (3, n) each."""
        first = np.array([rows[0, :FIXED] for rows in self.derivative[:FIXED]])
        last = np.array([rows[-1, -FIXED:] for rows in self.derivative[:FIXED]])
        return np.vstack([np.linalg.solve(first, start), np.linalg.solve(last, end)])

    @cached_property
    def end_shapes(self) -> Array:
        """Control points (K, 6) of curves near six quintic polynomials: each has one end value 1, the others 0.

        The end values are q, dq/du and d²q/du² at u = 0, then at u = 1.
        """
        u = np.linspace(0.0, 1.0, 8 * self.size)
        values = np.array(
            [[math.perm(k, i) * at ** max(k - i, 0) for k in range(6)] for at in (0, 1) for i in range(3)]
        )
        shapes = np.linalg.inv(values)  # (6, 6): coefficients of each polynomial in a column
        return self.fit(u, u[:, None] ** np.arange(6) @ shapes, self.ends(np.eye(6)[:3], np.eye(6)[3:]))

    def moved_ends(self, control: Array, start: Array, end: Array) -> Array:
        """The control points (K, n) of the curve that is bent smoothly to new ends, (3, n) each; see `ends`."""
        rows = [self.derivative[order][at] for at in (0, -1) for order in range(FIXED)]
        moved = control + self.end_shapes @ (np.vstack([start, end]) - np.array(rows) @ control)
        ends = self.ends(start, end)
        moved[:FIXED], moved[-FIXED:] = ends[:FIXED], ends[FIXED:]
        return np.asarray(moved)

    def fit(self, u: Array, points: Array, ends: Array | None = None) -> Array:
        """Fit control points (K, n) of the least-squares spline through points (N, n) at u (N,).

        At rest at both ends, or with the control points `ends` (6, n) there. A small weight on the third derivative
        determines control points that no sample does.
        """
        control = np.empty((self.size, points.shape[1]))
        control[:FIXED], control[-FIXED:] = (points[0], points[-1]) if ends is None else (ends[:FIXED], ends[FIXED:])
        rows, inverse = _least_squares(self, np.asarray(u, float).tobytes())
        right = np.vstack([points, np.zeros((len(rows) - len(points), points.shape[1]))])
        right = right - rows[:, :FIXED] @ control[:FIXED] - rows[:, -FIXED:] @ control[-FIXED:]
        control[self.free] = inverse @ right
        return control

    def shortest_duration(self, control: Array, bounds: tuple[Array, Array, Array]) -> float:
        """Return the least T, s, at which velocity, acceleration and jerk control points respect the bounds (n,)."""
        ratios = [
            float((np.abs(rows @ control) / bounds[order]).max()) ** (1.0 / (order + 1))
            for order, rows in enumerate(self.bounded)
        ]
        return float(max(ratios))
