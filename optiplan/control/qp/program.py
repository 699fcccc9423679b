"""`Program`: minimise ½ xᵀ H x + gᵀ x within bounds, rows and equations."""

import numpy as np

from optiplan.arrays import Array
from optiplan.records import dataclass

FEASIBLE = 1e-6
"""rad/s or m/s: by how much an accepted answer may leave rows of unit size; bounds are kept exactly, by clipping."""


@dataclass(slots=True, eq=False)
class Program:
    """Minimise ½ xᵀ H x + gᵀ x subject to low <= C x <= high and box[0] <= x <= box[1], with A x = b.

    Attributes:
        H: (n, n), positive definite; `g`: (n,).
        C: (m, n), `low` and `high`: (m,), infinite where a row has one side.
        box: (n,) and (n,), never empty.
        A: (p, n) and `b`: (p,), equations that can hold; p may be 0.
    """

    H: Array
    g: Array
    C: Array
    low: Array
    high: Array
    box: tuple[Array, Array]
    A: Array
    b: Array

    def value(self, x: Array) -> float:
        """½ xᵀ H x + gᵀ x."""
        return float(0.5 * (x @ (self.H @ x)) + self.g @ x)

    def infeasibility(self, x: Array) -> float:
        """The largest violation of a row, an equation or a bound, or 0."""
        worst = max(float((self.box[0] - x).max()), float((x - self.box[1]).max()), 0.0)
        if len(self.C):
            y = self.C @ x
            worst = max(worst, float((self.low - y).max()), float((y - self.high).max()))
        if len(self.A):
            worst = max(worst, float(np.abs(self.A @ x - self.b).max()))
        return worst

    def towards(self, inside: Array, x: Array) -> Array:
        """The farthest point (n,) on the way from a point (n,) that keeps all rows to x (n,) that keeps them, too."""
        if not len(self.C):
            return x
        y, change = self.C @ inside, self.C @ (x - inside)
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(change > 0.0, self.high - y, self.low - y) / change
        share = float(np.nanmin(np.maximum(room, 0.0), initial=1.0))
        return x if share >= 1.0 else inside + share * (x - inside)

    def clipped(self, x: Array) -> Array:
        """Within the bounds exactly, (n,)."""
        return np.minimum(np.maximum(x, self.box[0]), self.box[1])
