"""Parameters and rows of a nonlinear program, block by block, each with its name."""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from optiplan.arrays import Array, Index
from optiplan.kinematics.symbolic.compiled import compiled
from optiplan.libraries import loading
from optiplan.planners.trajopt.terms.term import Curve, SoftRows
from optiplan.records import dataclass

SLOTS = 4
"""Rows that a sample is given at least for distances, and by which their number grows: unused ones hold always."""

UNUSED = 1.0
"""Value of the rows without a pair, in the unit of their term."""

_NO_WEIGHT = 1e-9
"""Weight of a control point below which a sample does not depend on it."""


class Parameters:
    """Named blocks of the vector p, in the order in which they were made.

    Attributes:
        sizes: numbers in each block, by name.
    """

    def __init__(self) -> None:
        self.sizes: dict[str, int] = {}
        self._symbols: list[ca.MX] = []

    def block(self, name: str, *shape: int) -> ca.MX:
        """Return a new block as an expression of this shape, column by column in p."""
        symbol = ca.MX.sym(name, *shape)
        self.sizes[name] = symbol.numel()
        self._symbols.append(symbol)
        return symbol

    @property
    def vector(self) -> ca.MX:
        """Return p."""
        return ca.veccat(*self._symbols)

    def values(self, by_name: dict[str, Array]) -> Array:
        """Return the numbers of p; a block is given as rows of what it holds by columns."""
        parts = [np.asarray(by_name[name], dtype=float).ravel() for name in self.sizes]
        for part, (name, size) in zip(parts, self.sizes.items(), strict=True):
            assert part.size == size, (name, part.size, size)
        return np.concatenate([np.zeros(0), *parts])


@dataclass(frozen=True, eq=False)
class RowBlock:
    """Rows of one kind, column by column: one column a control point or sample.

    Attributes:
        kind: of the rows.
        rows: (R,) expressions.
        least, most: (R,) bounds.
        columns: numbers of control points or samples (C,); R is a multiple of C.
        labels: of the rows of a column (R / C,).
    """

    kind: str
    rows: ca.MX
    least: Array
    most: Array
    columns: Index
    labels: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class LinearRows:
    """Slots for rows g + G (q - q') + d (T - T'), up to as many a sample: distances linearised at a curve.

    Attributes:
        constant: (N, slots) expression; `slope`: for each slot (n, N); `by_duration`: (N, slots).
    """

    name: str
    slots: int
    joints: int
    samples: int
    constant: ca.MX
    slopes: tuple[ca.MX, ...]
    by_duration: ca.MX

    @classmethod
    def among(cls, parameters: Parameters, name: str, slots: int, joints: int, samples: int) -> "LinearRows":
        """Return slots whose numbers are blocks of the parameters."""
        constant = parameters.block(f"{name}: constants", samples, slots)
        slopes = tuple(parameters.block(f"{name}: slopes {k}", joints, samples) for k in range(slots))
        return cls(name, slots, joints, samples, constant, slopes, parameters.block(f"{name}: rates", samples, slots))

    def expression(self, q: ca.MX, duration: ca.MX) -> ca.MX:
        """Return the rows (N, slots) at configurations q (n, N) at the samples."""
        moved = ca.horzcat(*(ca.sum1(slope * q).T for slope in self.slopes))
        return self.constant + moved + self.by_duration * duration

    def values(self, rows: SoftRows, curve: Curve, unit: float) -> dict[str, Array]:
        """Return the parameters of rows linearised at a curve; the smallest of a sample where there are too many."""
        order = np.argsort(rows.value, kind="stable")
        gradient = by_configuration(rows, curve)[order]
        return self.at(curve, rows.sample[order], rows.value[order], gradient, rows.by_duration[order], UNUSED * unit)

    def at(
        self,
        curve: Curve,
        sample: Index,
        value: Array,
        slope: Array,
        by_duration: Array | None = None,
        unused: float = 0.0,
    ) -> dict[str, Array]:
        """Return the parameters of values (K,) at samples (K,) with slopes (K, n) by q and (K,) by T."""
        constant, rates = np.full((self.slots, self.samples), unused), np.zeros((self.slots, self.samples))
        slopes, taken = np.zeros((self.slots, self.samples, self.joints)), np.zeros(self.samples, dtype=int)
        by_duration = np.zeros(len(value)) if by_duration is None else by_duration
        for k, (place, gradient) in enumerate(zip(sample, slope, strict=True)):
            slot = taken[place]
            if slot < self.slots:
                taken[place] += 1
                moved = gradient @ curve.motion[0][place] + by_duration[k] * curve.duration
                constant[slot, place] = value[k] - moved
                slopes[slot, place], rates[slot, place] = gradient, by_duration[k]
        found = {f"{self.name}: slopes {k}": slopes[k] for k in range(self.slots)}
        return {f"{self.name}: constants": constant, f"{self.name}: rates": rates, **found}


def by_configuration(rows: SoftRows, curve: Curve) -> Array:
    """Return the derivatives (K, n) by q of rows that depend on nothing else of the state."""
    weights = curve.samples.moving[0][rows.sample]
    count, points = weights.shape
    if not count:
        return np.zeros((0, curve.control.shape[1]))
    most = np.abs(weights).argmax(axis=1)
    weight = weights[np.arange(count), most]
    slope = rows.by_control.reshape(count, points, -1)[np.arange(count), most]
    free = np.abs(weight) > _NO_WEIGHT
    return np.where(free[:, None], slope / np.where(free, weight, 1.0)[:, None], 0.0)


def slots_for(rows: SoftRows) -> int:
    """Return how many slots a sample needs, a multiple of `SLOTS`."""
    most = int(np.bincount(rows.sample).max(initial=0)) if len(rows.sample) else 0
    return SLOTS * max(1, -(-most // SLOTS))


def function_of(robot: Any, name: str, build: Callable[[Any], Any], machine_code: bool) -> ca.Function | None:
    """Return the function (q, v, a) -> (m,) of an expression of the state; None where it has no rows.

    As machine code with its Jacobian, compiled once and kept on disk, or for CasADi's virtual machine.
    """
    from optiplan.kinematics.symbolic.state import SymbolicState

    state = SymbolicState(robot)
    value = ca.vec(ca.densify(ca.SX(build(state))))
    if not value.numel():
        return None
    value = ca.substitute([value], [one for one, _ in state.constants], [ca.DM(x) for _, x in state.constants])[0]
    made = ca.Function(name, [state.q, state.v, state.a], [value], {"cse": True})
    if machine_code:
        with loading():
            made = compiled(name, [made.serialize().encode()], lambda: made)
    return made
