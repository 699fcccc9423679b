"""Polynomials in one variable, many at once: values, derivatives, roots in [0, 1] and exact extrema.

Coefficients ascend along the last axis: p(x) = sum_k c[..., k] x^k.
"""

from functools import cache
from math import comb
from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array

_NEWTON_STEPS = 100
_ROUNDING = 2.0**-51
"""Share of the sum of the sizes of a polynomial's terms below which its value is rounding."""


def evaluate(coefficients: Array, x: Array) -> Array:
    """p(x) by Horner's rule; `coefficients` (..., d + 1) and x (...) broadcast against each other."""
    degree = coefficients.shape[-1] - 1
    if degree == 0:
        return np.broadcast_to(coefficients[..., 0], np.broadcast_shapes(coefficients.shape[:-1], x.shape)).copy()
    value = coefficients[..., degree] * x
    value += coefficients[..., degree - 1]
    for k in range(degree - 2, -1, -1):
        value *= x
        value += coefficients[..., k]
    return np.asarray(value)


def derivative(coefficients: Array) -> Array:
    """Coefficients (..., d) of p'; those of the zero polynomial, (..., 1), when p is constant."""
    degree = coefficients.shape[-1] - 1
    if degree == 0:
        return np.zeros_like(coefficients)
    return coefficients[..., 1:] * np.arange(1.0, degree + 1.0)


def shifted(coefficients: Array, x: Array) -> Array:
    """Return the coefficients (m, d + 1, n) of p(x + tau) in powers of tau, from those of p; x (m,)."""
    return np.ascontiguousarray(taylor(coefficients, x[:, None]).swapaxes(0, 1))


def taylor(c: Array, x: Array) -> Array:
    """Taylor coefficients p^(k)(x) / k!, (degree + 1, K, n), of polynomials c (K, degree + 1, n).

    By Horner's rule, again and again (synthetic division).

    Args:
        c: ascending powers.
        x: (K, 1) where.
    """
    b = np.array(c.swapaxes(0, 1), order="C")
    degree = len(b) - 1
    term = np.empty_like(b[0])
    for k in range(degree):
        for i in range(degree - 1, k - 1, -1):
            b[i] += np.multiply(b[i + 1], x, out=term)
    return b


def unit_roots(coefficients: Array) -> Array:
    """Return points of [0, 1] that include all real roots of N polynomials there.

    Between neighbouring roots of p' lies at most one root of p. So, degree by degree, each monotone stretch with a
    change of sign is a bracket, inside which Newton's method solves for the root. No division by a leading coefficient,
    which may vanish. Where a stretch has no root, or an end is one up to rounding, that end is returned. This does no
    harm in a search for extrema, because both ends are candidates as well.

    Args:
        coefficients: (N, d + 1).

    Returns:
        (N, d) points; (N, 0) for constants.
    """
    degree = coefficients.shape[-1] - 1
    if degree == 0:
        return np.empty((len(coefficients), 0))
    if degree == 1:
        return _clip(_divide(-coefficients[:, :1], coefficients[:, 1:]))
    if degree == 2:
        return _quadratic(coefficients)
    inner = np.sort(unit_roots(derivative(coefficients)), axis=1)
    count = len(coefficients)
    edges = np.concatenate([np.zeros((count, 1)), inner, np.ones((count, 1))], axis=1)
    value = evaluate(coefficients[:, None, :], edges)
    nothing = np.abs(value) <= _ROUNDING * np.abs(coefficients).sum(axis=1, keepdims=True)
    roots = np.where(nothing[:, 1:] & ~nothing[:, :-1], edges[:, 1:], edges[:, :-1])
    # A motion from rest has a multiple root at its start, which Newton's method would only creep up to.
    change = ((value[:, :-1] < 0) != (value[:, 1:] < 0)) & ~(nothing[:, :-1] | nothing[:, 1:])
    if change.any():
        row, column = np.nonzero(change)
        rising = value[row, column] < 0
        roots[row, column] = _solve(coefficients[row], edges[row, column], edges[row, column + 1], rising)
    return roots


class UnitExtrema(NamedTuple):
    """Minimum and maximum over [0, 1] of N polynomials, and where: (N,) each."""

    low: Array
    high: Array
    x_low: Array
    x_high: Array


def unit_extrema(coefficients: Array) -> UnitExtrema:
    """Return the exact minimum and maximum over [0, 1] of N polynomials, (N, d + 1)."""
    count = len(coefficients)
    inner = unit_roots(derivative(coefficients)) if coefficients.shape[-1] > 1 else np.empty((count, 0))
    x = np.concatenate([np.zeros((count, 1)), np.ones((count, 1)), inner], axis=1)
    value = evaluate(coefficients[:, None, :], x)
    rows = np.arange(count)
    low, high = value.argmin(axis=1), value.argmax(axis=1)
    return UnitExtrema(value[rows, low], value[rows, high], x[rows, low], x[rows, high])


def may_hold_extrema(coefficients: Array) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    """Return which of m x n polynomials (m, n, d + 1) can hold an extremum of their column on [0, 1]: (m, n).

    A polynomial stays between its smallest and largest Bernstein coefficient b_i = sum_k C(i, k) / C(d, k) c_k, and
    takes b_0 and b_d at the ends. If its coefficients lie within the values that others reach, it holds no extremum.
    """
    pieces, columns, size = coefficients.shape
    b = (bernstein_basis(size - 1) @ coefficients.reshape(-1, size).T).reshape(size, pieces, columns)
    ends = b[[0, -1]]
    lowest, highest = ends.min(axis=(0, 1)), ends.max(axis=(0, 1))
    return np.asarray((b.min(axis=0) <= lowest) | (b.max(axis=0) >= highest))


@cache
def bernstein_basis(degree: int) -> Array:
    """Matrix (d + 1, d + 1) that gives Bernstein coefficients b_i = sum_k C(i, k) / C(d, k) c_k of the c_k."""
    sizes = range(degree + 1)
    return np.array([[comb(i, k) / comb(degree, k) for k in sizes] for i in sizes])


def rising_root(coefficients: Array) -> Array:
    """Return the root in [0, 1] of each of N polynomials (N, d + 1) that rise from below 0 to above it: (N,)."""
    count = len(coefficients)
    return _solve(coefficients, np.zeros(count), np.ones(count), np.ones(count, bool)) if count else np.zeros(0)


def _clip(x: Array) -> Array:
    """Clip to [0, 1]; a value that is not finite (no root at all) becomes an end."""
    found = x if np.isfinite(x).all() else np.nan_to_num(x)
    return np.minimum(np.maximum(found, 0.0), 1.0)


def _divide(numerator: Array, denominator: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.asarray(numerator / denominator)


def _quadratic(c: Array) -> Array:
    """Both roots without cancellation: s = -(b + sign(b) sqrt(b^2 - 4 a c)) / 2, roots s / a and c / s."""
    scale = np.abs(c).max(axis=1)
    scale[scale == 0.0] = 1.0
    c = c / scale[:, None]
    root = np.sqrt(np.maximum(c[:, 1] ** 2 - 4.0 * c[:, 2] * c[:, 0], 0.0))
    s = -0.5 * (c[:, 1] + np.copysign(root, c[:, 1]))
    return _clip(np.stack([_divide(s, c[:, 2]), _divide(c[:, 0], s)], axis=1))


def _solve(c: Array, low: Array, high: Array, rising: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> Array:
    """The root of monotone polynomials c (N, d + 1) in their brackets, each (N,): Newton, else bisection."""
    slope = derivative(c)
    low, high = low.copy(), high.copy()
    x = 0.5 * (low + high)
    last = high - low
    for _ in range(_NEWTON_STEPS):
        value = evaluate(c, x)
        left = (value < 0) == rising
        low = np.where(left, x, low)
        high = np.where(left, high, x)
        step = _divide(-value, evaluate(slope, x))
        new = x + step
        bad = ~((new >= low) & (new <= high) & (np.abs(step) <= 0.5 * last))
        new = np.where(bad, 0.5 * (low + high), new)
        last = np.abs(new - x)
        x = new
        if last.max() <= 1e-15:
            break
    return x
