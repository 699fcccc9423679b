"""A grid over some joints, in which start and goal are to be separated by closed boxes."""

import time
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from optiplan.arrays import Array, Index
from optiplan.verify.bounds.closing import AT_ONCE, CLOSED, PASSABLE, Closing

Mask = npt.NDArray[np.bool_]
Slices = tuple[slice, ...]

EFFORTS = (1, 8, 64, 512)
"""Parts into which boxes are halved, in rounds: later ones only for boxes that resisted with fewer."""

MORE = 4
"""The part of the fewest unknown boxes of a way by which others may have more that are closed beside them."""

FAR = 1 << 20
"""More boxes than a way has."""


class JointGrid:
    """Boxes over some joints, within which all other joints may be anywhere that motions shorter than T can pass.

    A motion is in some box at every time, and goes from one to the next through a face, an edge or a corner. All boxes
    hold their boundary. So if no chain of faces joins two open boxes that share an edge or a corner, a closed box holds
    it too, and the motion cannot pass there. If no chain of open boxes that share faces leads from the start to the
    goal, no motion is shorter than T.

    Boxes are closed where it matters: on the ways from start to goal through few boxes not known to be passable.

    Args:
        closing: closes boxes.
        T: s.
        joints: indices of the planned joints of the grid.
        counts: boxes along each of them.
    """

    def __init__(self, closing: Closing, T: float, joints: Sequence[int], counts: Sequence[int]) -> None:
        self._closing, self._joints = closing, list(joints)
        passage = closing.passage
        self._corridor = passage.corridor(T)
        self._low, self._high = self._corridor.box()
        ends = np.stack([passage.start, passage.goal])
        self._low = np.minimum(self._low, ends.min(axis=0) - passage.tolerance)
        self._high = np.maximum(self._high, ends.max(axis=0) + passage.tolerance)
        self._edges = [np.linspace(self._low[j], self._high[j], n + 1) for j, n in zip(joints, counts, strict=True)]
        self._ends = [self._boxes_at(q) for q in ends]
        self.open: Mask = np.ones(tuple(counts), dtype=bool)
        self._passable: Mask = np.zeros(tuple(counts), dtype=bool)
        for end in self._ends:
            self._passable[end] = True  # the ends themselves are passed
        self.parts = 0

    def separates(self, until: float) -> bool:
        """Close boxes until start and goal are apart; False where they cannot be, or at the time `until`, s."""
        for effort in EFFORTS:
            tried = self._passable.copy()
            while len(boxes := self._needed(tried, until)):
                some = max(AT_ONCE // effort, 1)
                for first in range(0, len(boxes), some):
                    if time.perf_counter() > until:
                        return False
                    self._close(boxes[first : first + some], effort)
                tried[tuple(boxes.T)] = True
            if not self._joined(self.open):
                return True
            if self._joined(self._passable):
                return False
        return False

    def _close(self, boxes: Index, effort: int) -> None:
        low, high = np.tile(self._low, (len(boxes), 1)), np.tile(self._high, (len(boxes), 1))
        for axis, j in enumerate(self._joints):
            low[:, j], high[:, j] = self._edges[axis][boxes[:, axis]], self._edges[axis][boxes[:, axis] + 1]
        found = self._closing.close(self._corridor, low, high, effort)
        self.open[tuple(boxes[found == CLOSED].T)] = False
        self._passable[tuple(boxes[found == PASSABLE].T)] = True
        self.parts += effort * len(boxes)

    def _joined(self, mask: Mask) -> bool:
        """Whether boxes of `mask` join start and goal."""
        labels, _ = ndimage.label(mask)
        at_start, at_goal = (set(np.unique(labels[end]).tolist()) for end in self._ends)
        return bool(at_start & at_goal)

    def _needed(self, known: Mask, until: float) -> Index:
        """Indices of the open boxes not `known` on ways from start to goal with few of them.

        None without such a way, or where none is found until the time `until`, s.
        """
        start, goal = self._ends
        fewest, after_start = self._unknown(known, start, goal, until)
        if fewest is None:
            return np.zeros((0, known.ndim), dtype=np.intp)
        _, after_goal = self._unknown(known, goal, start, until)
        # Each counts itself in both.
        return np.argwhere((after_start + after_goal - 1 <= fewest + fewest // MORE) & self.open & ~known)

    def _unknown(self, known: Mask, end: Slices, other: Slices, until: float) -> tuple[int | None, Index]:
        """The fewest open boxes that are not known on ways from an end to the other, and to each box, itself counted.

        None where no way to the other end is found until the time `until`, s; `FAR` for boxes that are not reached.
        """
        labels, count = ndimage.label(known & self.open)
        reached, distance = np.zeros_like(known), np.full(known.shape, FAR)
        reached[end] = True
        fewest, k = None, 0
        while (fewest is None or k <= fewest + fewest // MORE) and time.perf_counter() < until:
            touched = np.zeros(count + 1, dtype=bool)
            touched[labels[reached]] = True
            touched[0] = False
            reached |= touched[labels]
            distance[reached & (distance == FAR)] = k
            if fewest is None and reached[other].any():
                fewest = k
            more = _widened(reached) & self.open
            if np.array_equal(more, reached):
                break
            reached, k = more, k + 1
        return fewest, distance

    def _boxes_at(self, q: Array) -> Slices:
        """The boxes within which a configuration is, and what is within the tolerance of it."""
        near = self._closing.passage.tolerance
        found = []
        for edges, j in zip(self._edges, self._joints, strict=True):
            first = int(np.searchsorted(edges, q[j] - near[j], side="left")) - 1
            last = int(np.searchsorted(edges, q[j] + near[j], side="right"))
            found.append(slice(max(first, 0), max(last, 1)))
        return tuple(found)


def _widened(mask: Mask) -> Mask:
    """Boxes of a mask, and those that share a face with one of them."""
    more = mask.copy()
    for axis in range(mask.ndim):
        there, here = np.moveaxis(more, axis, 0), np.moveaxis(mask, axis, 0)
        there[1:] |= here[:-1]
        there[:-1] |= here[1:]
    return more
