"""Limits of the joints as rows of one part of a stretch."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array, Index


class RateRows(NamedTuple):
    """Rows |x| <= T^r: derivatives of order r by the share w of a part's duration T, over their limits.

    Attributes:
        order: (R,) r.
        value: (R,) x.
        gradient: (R, M) of x by the variables.
    """

    order: Index
    value: Array
    gradient: Array

    @classmethod
    def of(cls, order: int, value: Array, gradient: Array) -> "RateRows":
        """Return the rows of one order from values (N, n) and gradients (N, n, M)."""
        return cls(np.full(value.size, order), value.ravel(), gradient.reshape(value.size, -1))

    @classmethod
    def joined(cls, rates: Sequence["RateRows"]) -> "RateRows":
        """Return the rows of several."""
        return cls(*(np.concatenate(parts) for parts in zip(*rates, strict=True)))

    @property
    def shortest(self) -> float:
        """The least duration that they allow, s."""
        return float((np.abs(self.value) ** (1.0 / self.order)).max(initial=0.0))
