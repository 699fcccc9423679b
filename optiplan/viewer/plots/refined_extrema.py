"""Extrema of what is no polynomial of time: the best of dense samples, refined between them.

No bound is claimed: a peak narrower than the samples' distance can be missed, so the result stays *sampled*.
"""

from collections.abc import Callable

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Extrema, Trajectory

LEAST_IN_PIECE = 4
"""Samples of a polynomial piece, at the least, both ends included."""

_PEAKS = 4  # local extrema of a column that are refined, the best ones
_POINTS = 9  # in a bracket, its ends included: a round makes it a quarter as wide
_ROUNDS = 8

States = tuple[Array, ...]
"""Positions, velocities, accelerations, jerks, (k, n) each, at k times."""


@dataclass(frozen=True, eq=False)
class PieceSamples:
    """Times of a motion, each within a polynomial piece: at a breakpoint the piece decides on which side of a jump.

    Attributes:
        trajectory: of the motion.
        piece: (k,) its number, not falling.
        local: (k,) from the piece's begin, s.
    """

    trajectory: Trajectory
    piece: Index
    local: Array

    @classmethod
    def of(cls, trajectory: Trajectory, least: int) -> "PieceSamples":
        """At `least` times or more, evenly within every piece, both ends of each included."""
        widths = np.diff(trajectory.breakpoints)
        counts = np.maximum(LEAST_IN_PIECE, np.ceil(least * widths / trajectory.duration).astype(int) + 1)
        piece = np.repeat(np.arange(len(widths)), counts)
        local = np.concatenate([np.linspace(0.0, h, count) for h, count in zip(widths, counts, strict=True)])
        return cls(trajectory, piece, local)

    @property
    def t(self) -> Array:
        """Times (k,), s."""
        return np.asarray(self.trajectory.breakpoints[self.piece] + self.local)

    def states(self) -> States:
        """Positions to jerks (k, n), of the pieces themselves."""
        return tuple(self.trajectory.derivative_in(self.piece, self.local, order) for order in range(4))


def refined_extrema(samples: PieceSamples, values: Array, of: Callable[[PieceSamples], Array]) -> Extrema:
    """Extrema over time of each column of a quantity.

    The four best local extrema of the samples are each refined within their two neighbours, in one piece.

    Args:
        samples: k times.
        values: the quantity there, (k, m).
        of: the quantity (j, m) at j times.
    """
    low, t_low = _highest(samples, -values, lambda inside: -of(inside))
    high, t_high = _highest(samples, values, of)
    return Extrema(-low, high, t_low, t_high)


def _highest(samples: PieceSamples, values: Array, of: Callable[[PieceSamples], Array]) -> tuple[Array, Array]:
    """The largest value of each column (m,) and its time (m,)."""
    before, after = _neighbours(samples.piece)
    peak = (values >= values[before]) & (values >= values[after])
    ranked = np.argsort(np.where(peak, values, -np.inf), axis=0)[-_PEAKS:]  # (p, m), the best last
    at = ranked.ravel()
    column = np.tile(np.arange(values.shape[1]), len(ranked))
    a, b, piece = samples.local[before[at]], samples.local[after[at]], samples.piece[at]
    best, best_local = values[at, column], samples.local[at]
    for _ in range(_ROUNDS):
        local = a[:, None] + (b - a)[:, None] * np.linspace(0.0, 1.0, _POINTS)
        inside = PieceSamples(samples.trajectory, np.repeat(piece, _POINTS), local.ravel())
        found = of(inside).reshape(len(at), _POINTS, -1)[np.arange(len(at)), :, column]
        k = found.argmax(axis=1)
        rows = np.arange(len(at))
        better = found[rows, k] > best
        best, best_local = np.where(better, found[rows, k], best), np.where(better, local[rows, k], best_local)
        a, b = local[rows, np.maximum(k - 1, 0)], local[rows, np.minimum(k + 1, _POINTS - 1)]
    values_of, times = (x.reshape(ranked.shape) for x in (best, samples.trajectory.breakpoints[piece] + best_local))
    top, columns = values_of.argmax(axis=0), np.arange(values.shape[1])
    return values_of[top, columns], times[top, columns]


def _neighbours(piece: Index) -> tuple[Index, Index]:
    """Numbers of the samples before and after each in its piece; its own at an end of the piece."""
    k = np.arange(len(piece))
    before, after = np.maximum(k - 1, 0), np.minimum(k + 1, len(piece) - 1)
    return np.where(piece[before] == piece, before, k), np.where(piece[after] == piece, after, k)
