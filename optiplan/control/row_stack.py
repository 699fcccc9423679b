"""`RowStack`: the rows of all limits of a step."""

from collections.abc import Sequence

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.control.configuration import Configuration
from optiplan.control.limits.row_limit import LimitRows, RowLimit
from optiplan.control.qp.qp_sequence import RowGroup
from optiplan.trajectory.state import State

AT_ROW = 1e-7
"""rad/s or m/s, of rows of unit size: velocities nearer than this to a row's end are held back by it."""
_HELD = 1e-9


def stack_in_python(parts: Sequence[LimitRows], n: int) -> tuple[Array, Array, Array]:
    """C (m, n), low and high (m,) of rows of all limits, one below the other."""
    low, high = (np.concatenate([getattr(rows, name) for rows in parts]) for name in ("low", "high"))
    return np.concatenate([rows.G for rows in parts]), low, high


stack_rows = stack_in_python if core is None else core.stack_rows


class RowStack:
    """Rows low <= C x <= high.

    Args:
        limits: whose rows do not depend on what is near.
        order: names of limits, the least important first.
        n: number of joints.
    """

    def __init__(self, limits: Sequence[RowLimit], order: Sequence[str], n: int) -> None:
        self._limits = tuple(limits)
        self._rank = {name: rank for rank, name in enumerate(order)}
        self._parts: list[tuple[RowGroup, LimitRows]] = []
        self._own = 0
        self._none = np.zeros((0, n)), np.zeros(0), np.zeros(0)
        self.C, self.low, self.high = self._none

    def collect(self, c: Configuration, state: State, dt: float, others: Sequence[tuple[str, LimitRows]]) -> None:
        """Take the rows of a step; `others` are those of limits on stopping, by name."""
        named = [(limit.name, limit.rows(c, state, dt)) for limit in self._limits]
        self._own = sum(len(rows) for _, rows in named)
        named += [(name, rows) for name, rows in others if len(rows)]
        self._parts, first = [], 0
        for name, rows in named:
            last = first + len(rows)
            self._parts.append((RowGroup(name, first, last), rows))
            first = last
        self.C, self.low, self.high = stack_rows([rows for _, rows in named], state.n) if named else self._none

    @property
    def names(self) -> tuple[str, ...]:
        """Return the limit of each row and what the row is about, (m,)."""
        return tuple(f"{group.name}: {label}" for group, rows in self._parts for label in rows.labels)

    @property
    def any(self) -> bool:
        """Whether there are rows in this step."""
        return bool(self._parts)

    def holds(self, x: Array, own: bool = False) -> bool:
        """Whether velocities x (n,) keep all rows; `own`: those of `limits` alone, which come first."""
        C, low, high = self.C, self.low, self.high
        if own:
            C, low, high = C[: self._own], low[: self._own], high[: self._own]
        if core is not None:
            return core.rows_hold(C, low, high, x, _HELD)
        y = C @ x
        return bool((y >= low - _HELD).all() and (y <= high + _HELD).all())

    def by_importance(self) -> list[RowGroup]:
        """The groups, the most important first."""
        groups = [group for group, _ in self._parts]
        return sorted(groups, key=lambda group: -self._rank.get(group.name, -1))

    def at(self, x: Array) -> list[tuple[str, str]]:
        """Rows that hold velocities x (n,) back: limit, and what the row is about."""
        y = (self.C @ x).tolist()
        ends = enumerate(zip(y, self.low.tolist(), self.high.tolist(), strict=True))
        touched = [k for k, (y_k, low, high) in ends if abs(y_k - low) <= AT_ROW or abs(y_k - high) <= AT_ROW]
        return [
            (group.name, rows.labels[k - group.first])
            for group, rows in self._parts
            for k in touched
            if group.first <= k < group.last
        ]

    def violations(self, x: Array) -> dict[str, float]:
        """By how much x (n,) leaves rows, in the limits' own units, by name of the limit."""
        found: dict[str, float] = {}
        for group, rows in self._parts:
            y = rows.G @ x
            excess = float((np.maximum(rows.low - y, y - rows.high) * rows.unit).max())
            if excess > AT_ROW:
                found[group.name] = max(excess, found.get(group.name, 0.0))
        return found
