"""B-splines to piecewise polynomials, exactly."""

from math import factorial

import numpy as np

from optiplan.arrays import Array


def pieces(knots: Array, control_points: Array, degree: int) -> tuple[Array, Array]:
    """Return breakpoints (m + 1,) and local ascending coefficients (m, degree + 1, n) of a B-spline.

    On the span [t_i, t_{i+1}) the coefficients are those of Taylor's series, c_k = q^(k)(t_i) / k!. The derivative of
    a spline is a spline with control points

        D c_i = d (c_{i+1} - c_i) / (t_{i+d+1} - t_{i+1}).

    Its value at t_i comes from de Boor's recursion. Source: de Boor, A Practical Guide to Splines, ch. X.

    Args:
        knots: (N + degree + 1,) not decreasing, s; the spline lives on [knots[degree], knots[N]].
        control_points: (N, n), rad or m.
        degree: 1 to 7.

    Raises:
        ValueError: if sizes do not fit, knots decrease or are not finite, or the domain is empty.
    """
    knots, control_points = np.asarray(knots, float), np.asarray(control_points, float)
    _check(knots, control_points, degree)
    spans = np.flatnonzero(np.diff(knots[: len(control_points) + 1]) > 0)
    spans = spans[spans >= degree]
    if len(spans) == 0:
        raise ValueError("knots: the domain [knots[degree], knots[N]] is empty")
    left = knots[spans]
    coefficients = np.empty((len(spans), degree + 1, control_points.shape[1]))
    points, t, first = control_points, knots, spans
    for k in range(degree + 1):
        d = degree - k
        coefficients[:, k] = _de_boor(t, points, d, first) / factorial(k)
        if d > 0:
            width = t[d + 1 : d + len(points)] - t[1 : len(points)]
            scale = np.divide(d, width, out=np.zeros_like(width), where=width > 0)
            points, t, first = scale[:, None] * np.diff(points, axis=0), t[1:-1], first - 1
    return np.append(left, knots[spans[-1] + 1]), coefficients


def basis_functions(x: Array, knots: Array, degree: int) -> Array:
    """Return the matrix B (k, N) with B @ control_points the values at x (k,) of the B-spline with these knots.

    B_i,d(x) = (x - t_i) / (t_{i+d} - t_i) B_i,d-1(x) + (t_{i+d+1} - x) / (t_{i+d+1} - t_{i+1}) B_{i+1},d-1(x), with
    0 / 0 = 0. Source: de Boor, A Practical Guide to Splines, ch. IX.

    Args:
        x: in [knots[degree], knots[N]]; at the end of the domain the values are from the left.
        knots: (N + degree + 1,) not decreasing.
        degree: 0 or more.
    """
    x, t = np.asarray(x, float)[:, None], np.asarray(knots, float)
    inner = np.flatnonzero(np.diff(t) > 0.0)
    span = inner[np.clip(np.searchsorted(t[inner], x[:, 0], side="right") - 1, 0, len(inner) - 1)]
    basis = (np.arange(len(t) - 1) == span[:, None]).astype(np.float64)
    for d in range(1, degree + 1):
        width = t[d:] - t[:-d]
        slope = np.divide(x - t[:-d], width, out=np.zeros((len(x), len(width))), where=width > 0.0)
        basis = slope[:, :-1] * basis[:, :-1] + (1.0 - slope[:, 1:]) * basis[:, 1:]
    return np.asarray(basis)


def _de_boor(t: Array, points: Array, degree: int, spans: np.ndarray[tuple[int], np.dtype[np.int64]]) -> Array:
    """Return the value (m, n) of the spline at the left end of each span t[spans], taken from the right."""
    x = t[spans]
    value = [points[spans - degree + j] for j in range(degree + 1)]
    for r in range(1, degree + 1):
        for j in range(degree, r - 1, -1):
            low, high = t[spans - degree + j], t[spans + j + 1 - r]
            a = ((x - low) / (high - low))[:, None]
            value[j] = (1.0 - a) * value[j - 1] + a * value[j]
    return value[degree]


def _check(knots: Array, control_points: Array, degree: int) -> None:
    if not 1 <= degree <= 7:
        raise ValueError(f"degree: found {degree}; expected 1 to 7")
    if control_points.ndim != 2 or len(control_points) <= degree:
        raise ValueError(f"control_points: found shape {control_points.shape}; expected (N > {degree}, n)")
    if knots.shape != (len(control_points) + degree + 1,):
        expected = (len(control_points) + degree + 1,)
        raise ValueError(f"knots: found shape {knots.shape}; expected {expected}")
    if not (np.isfinite(knots).all() and np.isfinite(control_points).all()):
        raise ValueError("knots and control_points must be finite")
    if (np.diff(knots) < 0).any():
        raise ValueError("knots: must not decrease")
