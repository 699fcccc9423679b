"""The inequalities that hold a path constraint."""

from collections.abc import Callable
from typing import Any

import numpy as np

from optiplan.kinematics.symbolic.state import SymbolicState
from optiplan.planners.path_constraints import motions, poses
from optiplan.planners.path_constraints.inequality import Inequality
from optiplan.planners.path_constraints.parts import RESERVE, stacked
from optiplan.problem.constraints.expression import Expression
from optiplan.problem.constraints.statements import PathConstraint

_OWN_UNIT, _OWN_RESERVE = 0.05, 1e-3
"""Unit and reserve of a user's own expression, as shares of a change of it that matters."""


def inequalities(one: PathConstraint) -> list[Inequality]:
    """Return the inequalities of a path constraint; none for clearance, which is no expression."""
    make = _KINDS.get(type(one))
    return [] if make is None else [found._replace(during=one.during) for found in make(one)]


def _expression(one: Expression) -> list[Inequality]:
    """A user's own: f - lower and upper - f, of the bounds that there are."""

    def build(k: SymbolicState) -> Any:
        value = stacked(one.build(k))
        sides = [value - k.constant(one.lower)] if np.isfinite(one.lower) else []
        sides += [k.constant(one.upper) - value] if np.isfinite(one.upper) else []
        return stacked(*sides)

    reserve = min(_OWN_RESERVE * one.size, RESERVE * (one.upper - one.lower))
    return [Inequality(one.name, build, _OWN_UNIT * one.size, reserve, finite=one.finite)]


_KINDS: dict[type[Any], Callable[[Any], list[Inequality]]] = {**poses.KINDS, **motions.KINDS, Expression: _expression}
