"""The log of a descent: its iterations, and why it ended."""

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from optiplan.arrays import Array

Ending = Literal[
    "converged", "trust region", "penetration", "too slow", "step limit", "stopped", "contact between samples"
]

COLUMNS = ("duration", "merit", "violation", "radius", "accepted")

_DIGITS = 5
"""Significant digits in a run's record."""


class IterationLog(NamedTuple):
    """The iterations of one descent, or of several one after the other.

    Attributes:
        rows: (m, 5), one row per iteration. Of its first curve: the duration, s, the merit, s, and the clearance
            violation summed over the samples, m. Then the trust region, as a share of the joints' travel. Then 1 for an
            accepted step, 0.5 for a step repaired by a second one, 0 for a refused step.
        ended: why. `converged`: the last steps gained little. `trust region`: no step was accepted down to the least
            one. `penetration`: the clearance violation was large or no longer fell. `too slow`: the curve was far
            longer than the best. `step limit`: the option `iterations`. `stopped`: the budget. `contact between
            samples`: a curve that was free at its samples.
    """

    rows: Array
    ended: Ending

    @classmethod
    def of(cls, iterations: Sequence[Sequence[float]], ended: Ending) -> "IterationLog":
        """Of iterations, five numbers each."""
        return cls(np.array(iterations, dtype=float).reshape(-1, len(COLUMNS)), ended)

    def then(self, later: "IterationLog") -> "IterationLog":
        """This and a later descent as one."""
        return IterationLog(np.concatenate([self.rows, later.rows]), later.ended)

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready: `ended`, and of each column a list under its name."""
        columns = zip(COLUMNS, self.rows.T.tolist(), strict=True)
        return {"ended": self.ended, "log": {name: [_rounded(x) for x in column] for name, column in columns}}


NOTHING = IterationLog.of((), "stopped")
"""Of no descent."""


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")
