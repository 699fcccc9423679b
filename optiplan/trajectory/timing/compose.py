"""A path q(s) run by a time law s(t): their composition q(s(t)), in exact polynomial pieces."""

import numpy as np

from optiplan.arrays import Array, distinct
from optiplan.trajectory import polynomial
from optiplan.trajectory.tolerances import SAME_TIME
from optiplan.trajectory.trajectory import Trajectory

_OUTSIDE = 1e-9  # share of the path's length that rounding may cost
_BACKWARDS = 1e-7  # share of the law's largest speed; the rounded end of a phase of 1e-8 of the time costs up to 2e-8
_BISECTIONS = 60  # of the time at which a law passes a place


def compose(path: Trajectory, law: Trajectory) -> Trajectory:
    """The motion q(s(t)): the same curve as the path to rounding, at all times.

    Pieces end where the law's do and where s(t) passes a breakpoint of the path. On each, with tau from its start,
    Horner's rule for polynomials inserts s - s_a = sum_{k>=1} l_k tau^k into q = sum_k p_k (s - s_a)^k. The degree is
    the product of the two degrees.

    Args:
        path: q over a parameter s in [0, S].
        law: one "joint", s(t), never decreasing, within [0, S].

    Raises:
        ValueError: the law is not one, decreases or leaves [0, S]; the product of the degrees exceeds 31.
    """
    _check(path, law)
    t = distinct(np.append(law.breakpoints, _crossings(path, law)))
    t = t[np.concatenate([[True], np.diff(t) > SAME_TIME * law.duration])]
    t[-1] = law.duration
    middle = 0.5 * (t[:-1] + t[1:])
    own = np.searchsorted(law.breakpoints[1:-1], middle, side="right")
    inner = polynomial.shifted(_trimmed(law.coefficients)[own], t[:-1] - law.breakpoints[own])[:, :, 0]
    piece = np.searchsorted(path.breakpoints[1:-1], law(middle)[:, 0], side="right")
    outer = polynomial.shifted(_trimmed(path.coefficients)[piece], inner[:, 0] - path.breakpoints[piece])
    inner[:, 0] = 0.0
    result = outer[:, -1:]
    for k in range(outer.shape[1] - 2, -1, -1):
        result = _product(inner, result)
        result[:, 0] += outer[:, k]
    return Trajectory(path.joint_names, t, result)


def time_of(law: Trajectory, place: float) -> float:
    """Return when a law, which never decreases, passes a place of the path, s."""
    low, high = 0.0, law.duration
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        if float(law(middle)[0]) < place:
            low = middle
        else:
            high = middle
    return high


def _check(path: Trajectory, law: Trajectory) -> None:
    if law.n != 1:
        raise ValueError(f"law: found {law.n} columns; expected one, s(t)")
    low, high = (float(x[0]) for x in law.extrema(0))
    if low < -_OUTSIDE * path.duration or high > path.duration * (1.0 + _OUTSIDE):
        raise ValueError(f"law: found s in [{low}, {high}]; expected it within [0, {path.duration}]")
    slowest, fastest = (float(x[0]) for x in law.extrema(1))
    if slowest < -_BACKWARDS * fastest:
        raise ValueError(f"law: found a speed of {slowest}; expected s never to decrease")


def _crossings(path: Trajectory, law: Trajectory) -> Array:
    """Times at which s(t) passes the inner breakpoints of the path."""
    ends = np.append(law.coefficients[:, 0, 0], law.end[0])
    i, k = np.nonzero((ends[:-1, None] < path.breakpoints[1:-1]) & (path.breakpoints[1:-1] < ends[1:, None]))
    h = np.diff(law.breakpoints)[i]
    c = law.coefficients[i, :, 0] * h[:, None] ** np.arange(law.coefficients.shape[1])
    c[:, 0] -= path.breakpoints[k + 1]
    return np.asarray(law.breakpoints[i] + h * polynomial.rising_root(c))


def _trimmed(coefficients: Array) -> Array:
    """Without the highest powers that no piece has."""
    used = np.flatnonzero(coefficients.any(axis=(0, 2)))
    return coefficients[:, : used.max(initial=0) + 1]


def _product(a: Array, b: Array) -> Array:
    """Products of scalar polynomials a (m, d + 1) with b (m, e + 1, n): (m, d + e + 1, n)."""
    result = np.zeros((len(b), a.shape[1] + b.shape[1] - 1, b.shape[2]))
    for k in range(a.shape[1]):
        result[:, k : k + b.shape[1]] += a[:, k, None, None] * b
    return result
