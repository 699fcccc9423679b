"""Integrals over the time of a motion: to an accuracy, or at points that depend on its breakpoints only."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array, distinct
from optiplan.trajectory.trajectory import Trajectory

_NODES, _WEIGHTS = np.array(  # of nine points on [0, 1] (Kronrod); every second node is one of the four of Gauss
    [
        [0.011719874631213444, 0.031488686832736507],
        [0.069431844202973712, 0.085026802667861363],
        [0.179856891251845009, 0.133399170226142224],
        [0.330009478207571868, 0.163474594800725815],
        [0.500000000000000000, 0.173221490945068181],
        [0.669990521792428132, 0.163474594800725815],
        [0.820143108748154991, 0.133399170226142224],
        [0.930568155797026288, 0.085026802667861363],
        [0.988280125368786556, 0.031488686832736507],
    ]
).T
_GAUSS = np.array([0.173927422568726929, 0.326072577431273071, 0.326072577431273071, 0.173927422568726929])
_BOTH = np.zeros((2, len(_NODES)))  # the two rules' weights
_BOTH[0, 1::2], _BOTH[1] = _GAUSS, _WEIGHTS
_ACCURACY = 1e-6  # of an integral, relative
_NOTHING = 1e-3  # m, rad, (N m)^2 s: integrals smaller than this need no more digits than this one
_PANELS = 22  # least number per motion: a kink between their points is negligible
_HALVINGS = 14  # at most, of a panel: speed has kinks where the tool stands still
_MOST_PANELS = 20_000  # panels at a time; beyond that the integral is not refined further

_OUTER, _INNER = 0.906179845938664, 0.5384693101056831  # what `leggauss(5)` of NumPy returns, on [-1, 1]
_OUTER_WEIGHT, _INNER_WEIGHT, _MIDDLE_WEIGHT = 0.23692688505618928, 0.4786286704993663, 0.5688888888888887
_FIVE = 0.5 * (np.array([-_OUTER, -_INNER, 0.0, _INNER, _OUTER]) + 1.0)  # on [0, 1]
_FIVE_WEIGHTS = 0.5 * np.array([_OUTER_WEIGHT, _INNER_WEIGHT, _MIDDLE_WEIGHT, _INNER_WEIGHT, _OUTER_WEIGHT])
_FIXED_PANELS = 64  # least number per motion, of five points each


class Points(NamedTuple):
    """Times (k,), s, and their weights (k,), s, in a sum that approximates an integral."""

    times: Array
    weights: Array


def gauss_points(trajectory: Trajectory) -> Points:
    """Return five points of Gauss and Legendre in each of at least 64 panels, which end at breakpoints."""
    edges = distinct(np.append(trajectory.breakpoints, np.linspace(0.0, trajectory.duration, _FIXED_PANELS + 1)))
    width = np.diff(edges)
    return Points((edges[:-1, None] + width[:, None] * _FIVE).ravel(), (width[:, None] * _FIVE_WEIGHTS).ravel())


def integral(f: Callable[[Array], Array], trajectory: Trajectory) -> Array:
    """Return the integral over the whole motion of f, which maps times (m, s) to values (m, s, k) >= 0: array (k,).

    Times of a row are of one panel. Panels begin and end at breakpoints, where f may jump. By Gauss-Kronrod: a panel
    is halved until the rules of four and of nine points differ by less than its share of 1e-6 of the whole.
    """
    a, b = panels(trajectory)
    total: Array = np.zeros(1)
    for halving in range(_HALVINGS + 1):
        rough_value, fine = _gauss_kronrod(f, a, b)
        share = (b - a)[:, None] / trajectory.duration
        allowed = _ACCURACY * np.maximum(total + fine.sum(axis=0), _NOTHING) * share
        rough = (np.abs(fine - rough_value) > allowed).any(axis=1)
        if not rough.any() or len(a) > _MOST_PANELS or halving == _HALVINGS:
            break
        total = total + fine[~rough].sum(axis=0)
        a, b = a[rough], b[rough]
        middle = 0.5 * (a + b)
        a, b = np.concatenate([a, middle]), np.concatenate([middle, b])
    return np.asarray(total + fine.sum(axis=0))


def panels(trajectory: Trajectory) -> tuple[Array, Array]:
    """Beginnings and ends, (m,) s, of the first panels of `integral`: pieces in parts of at most a 22nd of all."""
    h, breakpoints = trajectory.widths, trajectory.breakpoints
    if h.max() * _PANELS <= trajectory.duration:
        return breakpoints[:-1], breakpoints[1:]
    parts = np.maximum(np.ceil(h * (_PANELS / trajectory.duration) - 1e-9), 1.0).astype(np.intp)
    piece = np.repeat(np.arange(len(h)), parts)
    within = np.arange(len(piece)) - (np.cumsum(parts) - parts)[piece]
    a = breakpoints[piece] + within * (h / parts)[piece]
    return a, np.append(a[1:], trajectory.duration)


def _gauss_kronrod(f: Callable[[Array], Array], a: Array, b: Array) -> tuple[Array, Array]:
    """Integrals of f over panels from a (m,) to b (m,), by four points and by nine: two arrays (m, k)."""
    width = (b - a)[:, None]
    both = _BOTH @ f(a[:, None] + width * _NODES) * width[:, None]
    return both[:, 0], both[:, 1]
