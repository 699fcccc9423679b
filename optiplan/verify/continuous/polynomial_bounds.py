"""Polynomials stay between bounds on [0, 1]: proved by Bernstein coefficients, with the rounding counted."""

from functools import cache
from math import comb
from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array, Flags, Index
from optiplan.trajectory.polynomial import bernstein_basis

_UNIT = 2.0**-53  # rounding of one operation
_MOST_HALVINGS = 40
_MOST_OPEN = 100_000  # parts of polynomials looked at together, to bound memory


class Bounded(NamedTuple):
    """Bounds of N polynomials, (N,) each.

    Attributes:
        within: whether each stays between its bounds, rounding included.
        beyond: by how much a value passes a bound at least, rounding taken off; 0 where none is known to.
        rounding: what each sum of its coefficients may be off by, in its own unit.
    """

    within: Flags
    beyond: Array
    rounding: Array


def prove_bounds(coefficients: Array, low: Array, high: Array) -> Bounded:
    """Prove low <= p(x) <= high for all x in [0, 1], for N polynomials p(x) = sum_k c_k x^k.

    A polynomial of degree d lies between the smallest and the largest of b_i = sum_k C(i, k) / C(d, k) c_k, and takes
    b_0 and b_d at the ends. Where that is not enough it is halved by de Casteljau's algorithm; the coefficients of the
    halves approach the polynomial with the square of the length. All weights are in [0, 1] and sums of d + 1 terms are
    off by (d + 2) 2^-53 times the sum of their sizes at most, so that after r halvings every coefficient is off by
    (r + 4) (d + 2) 2^-53 sum_k |c_k| at most, three of these for the c_k given and their conversion. That is
    taken off the bounds: a polynomial whose terms cancel beyond it is not proved, whatever values are computed.

    Holds at: all x in [0, 1].

    Args:
        coefficients: (N, d + 1), in units of the bounds.
        low: (N,) lower bounds, -inf where there is none.
        high: (N,) upper bounds, inf where there is none.
    """
    count, size = coefficients.shape
    halves = _halving(size)
    rounding = (size + 1) * _UNIT * np.abs(coefficients.T).sum(axis=0)
    owner: Index = np.arange(count)
    b = bernstein_basis(size - 1) @ coefficients.T  # (d + 1, N): sums and extrema along a short last axis are slow
    within, beyond = np.ones(count, dtype=bool), np.zeros(count)
    for r in range(_MOST_HALVINGS):
        doubt = (r + 4) * rounding[owner]
        held = (b.max(axis=0) + doubt <= high[owner]) & (b.min(axis=0) - doubt >= low[owner])  # NaN never is
        if held.all():
            return Bounded(within & (beyond <= 0.0), beyond, rounding)
        b, owner, doubt = b[:, ~held], owner[~held], doubt[~held]  # what holds is not beyond
        ends = b[[0, -1]]
        passed = np.maximum(ends.max(axis=0) - high[owner], low[owner] - ends.min(axis=0)) - doubt
        np.maximum.at(beyond, owner, passed)
        still = beyond[owner] <= 0.0
        b, owner = b[:, still], owner[still]
        if not len(owner) or len(owner) > _MOST_OPEN:
            break
        b, owner = np.hstack([half @ b for half in halves]), np.tile(owner, 2)
    within[owner] = False
    return Bounded(within & (beyond <= 0.0), beyond, rounding)


@cache
def _halving(size: int) -> tuple[Array, Array]:
    """Matrices that take Bernstein coefficients on [0, 1] to those on [0, 1/2] and on [1/2, 1]."""
    left = np.array([[comb(i, k) / 2.0**i for k in range(size)] for i in range(size)])
    return left, left[::-1, ::-1]
