"""Result of the certificate: what was proved, what was measured, and where."""

from dataclasses import field
from typing import Any, NamedTuple

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.records import dataclass

SELF, SCENE = 0, 1
"""Kinds of pairs: of links and what they hold, and of either with an obstacle."""


class Moment(NamedTuple):
    """A pair at a time: distance in m, names, nearest points (2, 3) in the world, configuration (n,)."""

    distance: float
    time: float
    pair: tuple[str, str]
    points: Array
    q: Array

    def witness(self, joints: int) -> dict[str, Any]:
        """Return the pair, its points and the configuration of that many joints, JSON-ready."""
        return {"pair": list(self.pair), "points": self.points.tolist(), "q": self.q[:joints].tolist()}


@dataclass
class Proof:
    """Result of the certificate, and its books on the way.

    Attributes:
        proved: every pair stays farther apart than the policy's clearance at all times.
        reason: why not, else empty.
        intervals: number of different intervals of time examined.
        queries: exact distance queries made.
        gjk_only: how many of them no separating plane confirmed (non-convex meshes): coal's distance less 1e-6 m.
        least: (2,) the smallest clearance proved of all intervals, m, of pairs of the robot's own bodies (`SELF`) and
            of those with an obstacle (`SCENE`): no pair of the kind ever comes nearer. inf where there is none.
        met: the smallest distance measured of either kind, an upper bound of the true minimum; None if no query was
            needed. Of pairs in `kept` the nearest is measured once.
        kept: pairs of links that needed no query, since their clearance is proved for all configurations.
        contact: whether bodies do come too near at the time of `nearest`, rather than only nothing being proved.
    """

    proved: bool
    reason: str = ""
    intervals: int = 0
    queries: int = 0
    gjk_only: int = 0
    least: Array = field(default_factory=lambda: np.full(2, np.inf))
    met: tuple[Moment | None, Moment | None] = (None, None)
    kept: frozenset[int] = frozenset()
    contact: bool = False

    @property
    def clearance(self) -> float:
        """Return the smallest clearance proved, m: no pair ever comes nearer."""
        return float(self.least.min())

    @property
    def nearest(self) -> Moment | None:
        """Return the smallest distance measured; None if no query was needed."""
        return min((one for one in self.met if one is not None), key=lambda one: one.distance, default=None)

    def measured(self, missing: float) -> Array:
        """Return the smallest distance measured of each kind, (2,) m; `missing` where none is."""
        return np.array([missing if met is None else met.distance for met in self.met])

    def meet(self, kind: int, met: Moment) -> None:
        """Remember a distance that was measured, if it is the smallest of its kind."""
        if met.distance < self.measured(np.inf)[kind]:
            self.met = (met, self.met[SCENE]) if kind == SELF else (self.met[SELF], met)


def least_of_kinds(margins: Array, kinds: Index) -> Array:
    """Return the least of margins (K,) of each kind, (2,) m; inf where there is none."""
    return np.array([margins[kinds == kind].min(initial=np.inf) for kind in (SELF, SCENE)])
