"""A problem's path constraints as terms."""

from collections.abc import Sequence

from optiplan.planners.path_constraints.clearance import PairsApart
from optiplan.planners.path_constraints.motion_check import Broken, Kept, PathConstraints
from optiplan.planners.trajopt.terms.contacts import NamedClearanceTerm
from optiplan.planners.trajopt.terms.expression import PRICE, ExpressionTerm
from optiplan.planners.trajopt.terms.term import Term

_DEARER = 4.0
"""Factor on the price of a constraint that a finished descent has left violated."""


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
