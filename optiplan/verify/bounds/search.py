"""The search for the greatest duration below which no motion goes from start to goal among the obstacles."""

import time
from collections.abc import Callable, Iterator

import numpy as np

from optiplan.records import dataclass
from optiplan.verify.bounds.closing import Closing
from optiplan.verify.bounds.grid import JointGrid

NEAR = 1e-3
"""Share of a bound by which it has to be below the known motion for a greater one to be looked for."""

GRIDS = ((3, 16), (4, 8), (3, 32), (4, 12), (3, 48), (4, 17), (5, 8), (3, 72), (4, 24), (5, 12), (4, 34), (6, 8))
"""Joints, and boxes along each, of the grids, in the order in which they are tried; of a robot with more joints."""

SMALL_GRIDS = (30, 100, 300, 800)
"""Boxes along each joint of a robot with few joints; no more than `MOST_BOXES` of them together."""

MOST_BOXES = 1_000_000

LONGEST = 1e6
"""s; a greater bound is not looked for: where obstacles cut the goal off, every bound could be doubled for ever."""

FIRST = 0.1
"""Share of what is between the bound and the known motion, or twice the bound, that is tried first."""


@dataclass
class BoundSearch:
    """Raises the proved bound by grids over the first joints, which move the larger links, that become finer.

    Attributes:
        closing: closes boxes.
        proved: s; no motion is shorter.
        below: s, of a known motion; inf: none is known.
        found: called with every greater bound.
        joints: of the grid that proved it; none: the joints alone.
        parts: parts of boxes that were examined.
    """

    closing: Closing
    proved: float
    below: float
    found: Callable[[float], None]
    joints: tuple[int, ...] = ()
    parts: int = 0

    def run(self, until: float) -> None:
        """Raise the bound until the time `until`, s, until it is near that of the known motion, or above `LONGEST`."""
        for joints, count in self._grids():
            share, failed = FIRST, 0
            while failed < 2 and time.perf_counter() < until:
                above = self.below if np.isfinite(self.below) else 2.0 * self.proved
                if above <= self.proved * (1.0 + NEAR) or self.proved > LONGEST:
                    return
                T = self.proved + share * (above - self.proved)
                grid = JointGrid(self.closing, T, joints, [count] * len(joints))
                apart = grid.separates(until)
                self.parts += grid.parts
                if apart:
                    self.proved, self.joints, failed = T, joints, 0
                    self.found(T)
                    share = min(1.6 * share, 0.9)
                else:
                    share, failed = 0.5 * share, failed + 1

    def _grids(self) -> Iterator[tuple[tuple[int, ...], int]]:
        """Joints, and boxes along each, in the order in which they are tried: first the joints that move most."""
        n = len(self.closing.passage.start)
        if n > 4:
            low, high = self.closing.passage.corridor(1.3 * self.proved).box()
            order = np.argsort(-(high - low) * self.closing.sway, kind="stable").tolist()
            yield from ((tuple(sorted(order[:joints])), count) for joints, count in GRIDS)
            return
        for count in SMALL_GRIDS:
            yield tuple(range(n)), min(count, int(MOST_BOXES ** (1.0 / n)))
