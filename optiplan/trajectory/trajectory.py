"""`Trajectory`: piecewise polynomials in time, the one representation that every planner returns."""

from dataclasses import dataclass
from typing import Any

from optiplan.arrays import Array


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Motion q(t) of n joints for t in [0, duration].

    On piece i, for t in [t_i, t_{i+1}]:  q_j(t) = sum_k coefficients[i, k, j] (t - t_i)^k.

    Attributes:
        joint_names: names of the n joints, in the order of the columns.
        breakpoints: (m + 1,) increasing, in s; the first is 0.
        coefficients: (m, degree + 1, n), ascending powers, rad/s^k or m/s^k.
    """

    joint_names: tuple[str, ...]
    breakpoints: Array
    coefficients: Array

    @property
    def duration(self) -> float:
        """Length in time, s."""
        return float(self.breakpoints[-1])

    def __call__(self, t: Array, order: int = 0) -> Array:
        """Derivative of the given order (0 to 3) at times t of shape (k,): array of shape (k, n)."""
        raise NotImplementedError

    def extrema(self, order: int) -> tuple[Array, Array]:
        """Exact minimum and maximum of a derivative over all time: two arrays of shape (n,)."""
        raise NotImplementedError

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready form that `from_dict` reproduces without loss."""
        raise NotImplementedError
