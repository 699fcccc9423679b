"""Motion of an obstacle: its displacement is a polynomial of time."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from optiplan.arrays import Array


@dataclass(frozen=True, eq=False)
class ObstacleMotion:
    """Displacement d(t) = sum_k c_k t^k, m, of an obstacle that does not turn and stands still after `until`.

    Attributes:
        coefficients: (3, k + 1), one row an axis of the world, in ascending powers of time, m/s^k.
        until: s, the last instant of the motion; infinite: it never ends.
    """

    coefficients: Array
    until: float = np.inf

    @classmethod
    def of_data(cls, polynomial: Sequence[Sequence[float]], until: float | None = None) -> "ObstacleMotion":
        """Return the motion of three rows of coefficients of any lengths; an empty row is zero."""
        size = max(1, *(len(row) for row in polynomial))
        rows = [[*row, *[0.0] * (size - len(row))] for row in polynomial]
        return cls(np.array(rows, float), np.inf if until is None else float(until))

    def to_data(self) -> dict[str, Any]:
        """Return the keys of a problem file."""
        data: dict[str, Any] = {"polynomial": self.coefficients.tolist()}
        return data if np.isinf(self.until) else {**data, "until": self.until}

    def at(self, t: Array, order: int = 0) -> Array:
        """Return the displacement (N, 3), m, at times t (N,), s, or its derivative of an order, m/s^order."""
        powers = np.arange(self.coefficients.shape[1])
        factor = np.prod([powers - i for i in range(order)], axis=0) if order else np.ones(len(powers))
        time = np.minimum(t, self.until)[:, None] ** np.maximum(powers - order, 0)
        moving = 1.0 if order == 0 else (np.asarray(t) <= self.until)[:, None]
        return np.asarray((time * factor) @ self.coefficients.T * moving)

    def from_times(self, t: Array) -> Array:
        """Return the coefficients (N, 3, k + 1) of d(t + s) in powers of s, for 0 <= s <= `until` - t, of times t (N,).

        At and after `until` they are those of an obstacle that stands still.
        """
        count = self.coefficients.shape[1]
        found = np.stack([self.at(t, order) / math.factorial(order) for order in range(count)], axis=2)
        found[t >= self.until, :, 1:] = 0.0
        return found
