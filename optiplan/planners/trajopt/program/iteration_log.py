"""What a descent did in each of its iterations, and why it ended."""

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from optiplan.arrays import Array

Ending = Literal[
    "converged", "trust region", "penetration", "too slow", "step limit", "stopped", "contact between samples"
]

COLUMNS = ("duration", "merit", "violation", "radius", "accepted")

_DIGITS = 5
"""Of what is kept in a run's record."""


class IterationLog(NamedTuple):
    """The iterations of one descent, or of several one after the other.

    Attributes:
        rows: (m, 5): of the curve that an iteration begins at the duration, s, the merit, s, and the clearance
            violation summed over the samples, m; the trust region, as a share of what joints can travel; and 1 where
            the step was accepted, 0.5 where it was with a second one from its end, 0 where it was undone.
        ended: why: the last steps gained little (`converged`), no step was accepted down to the least trust region,
            a violation of clearance that was large or no longer fell (`penetration`), a curve far longer than the best
            (`too slow`), the option `iterations` (`step limit`), the budget (`stopped`), or bodies that met between the
            samples of a curve that was free at them.
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
