"""Terms whose rows are CasADi expressions of the state."""

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.planners.path_constraints.inequality import KEPT, CompiledInequality
from optiplan.planners.trajopt.terms.term import Curve, Instants, SoftRows, within

PRICE = 0.5
"""Price of a violation by one unit at one sample."""


class ExpressionTerm:
    """The rows of one inequality, of all samples in one call. Holds at: samples."""

    decides = False

    def __init__(self, inequality: CompiledInequality) -> None:
        self._inequality, self._stated = inequality, inequality.stated
        self.name, self.unit, self.price = self._stated.name, self._stated.unit, PRICE
        self.negligible = max(self._stated.reserve, 1e-6 * self._stated.unit)
        self._inside: Index = np.zeros(0, dtype=np.intp)

    def begin(self, samples: Instants) -> None:
        """Take the samples in the constraint's part of the motion."""
        self._inside = np.flatnonzero(within(samples.u, self._stated.during))

    def rows(self, curve: Curve) -> SoftRows:
        """Return the rows g - reserve >= 0 of all samples."""
        u = curve.samples.u[self._inside]
        motion = [part[self._inside] for part in curve.motion]
        value, slopes = self._inequality.checked(motion)
        value = value - self._reserve(curve, u)
        sample = np.repeat(self._inside, self._inequality.size)
        by_q, by_v, by_a = (slope.reshape(len(sample), -1) for slope in slopes)
        return curve.rows(sample, value.ravel(), (by_q, by_v, by_a))

    def _reserve(self, curve: Curve, u: Array) -> Array:
        """Return the reserve at fractions u (N,) of the duration, no more than the ends have: (N, m)."""
        ends = curve.control[[0, -1]]
        still = np.zeros_like(ends)
        least, _ = self._inequality([ends, still, still])
        between = (1.0 - u)[:, None] * least[0] + u[:, None] * least[1]
        return np.asarray(np.clip(KEPT * between, 0.0, self._stated.reserve))

    def watch(self, rows: SoftRows) -> bool:
        """Return False: all samples have rows."""
        return False
