"""Path constraints as terms: CasADi expressions of the state, and clearances of named pairs."""

from collections.abc import Sequence

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.planners.path_constraints.inequality import KEPT, CompiledInequality, PairsApart
from optiplan.planners.path_constraints.motion_check import Broken, Kept, PathConstraints
from optiplan.planners.trajopt.terms.contacts import NamedClearanceTerm
from optiplan.planners.trajopt.terms.term import Curve, Expressed, Instants, SoftRows, Term, within

PRICE = 0.5
"""Price of a violation by one unit at one sample."""

_DEARER = 4.0
"""Factor on the price of a constraint that a finished descent has left violated."""


class ExpressionTerm(Term):
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

    def expressed(self) -> Expressed:
        """Return the inequality, at the samples in its part of the motion."""
        return Expressed(
            self._stated.build, self._inside, lambda curve: self._reserve(curve, curve.samples.u[self._inside])
        )

    def _reserve(self, curve: Curve, u: Array) -> Array:
        """Return the reserve at fractions u (N,) of the duration, no more than the ends have: (N, m)."""
        ends = curve.control[[0, -1]]
        still = np.zeros_like(ends)
        least, _ = self._inequality([ends, still, still])
        between = (1.0 - u)[:, None] * least[0] + u[:, None] * least[1]
        return np.asarray(np.clip(KEPT * between, 0.0, self._stated.reserve))


class ConstraintTerms:
    """The terms of each path constraint, and their prices."""

    def __init__(self, constraints: PathConstraints) -> None:
        self._terms: dict[Kept, tuple[Term, ...]] = {
            kept: tuple(
                NamedClearanceTerm(one) if isinstance(one, PairsApart) else ExpressionTerm(one)
                for one in kept.inequalities
            )
            for kept in constraints.all
        }

    def begin(self) -> tuple[Term, ...]:
        """Return the terms at their first prices."""
        terms = tuple(term for those in self._terms.values() for term in those)
        for term in terms:
            term.price = PRICE
        return terms

    def raise_prices(self, broken: Sequence[Broken]) -> None:
        """Raise the prices of the constraints that a finished descent has left violated."""
        for term in (term for one in broken for term in self._terms[one.kept]):
            term.price *= _DEARER
