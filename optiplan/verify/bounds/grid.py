"""A grid over some joints, in which start and goal are to be separated by closed boxes."""

import time
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from optiplan.arrays import Array, Index
from optiplan.verify.bounds.closing import AT_ONCE, CLOSED, PASSABLE, Closing

EFFORTS = (1, 8, 64, 256)
"""Parts into which boxes are halved, in rounds: later ones only for boxes that join start and goal."""


class JointGrid:
    """Boxes over some joints, within which all other joints may be anywhere that motions shorter than T can pass.

    A motion is in some box at every time, and goes from one to the next through a face, an edge or a corner. All boxes
    hold their boundary. So if no chain of faces joins two open boxes that share an edge or a corner, a closed box holds
    it too, and the motion cannot pass there. If no chain of open boxes that share faces leads from the start to the
    goal, no motion is shorter than T.

    Args:
        closing: closes boxes.
        T: s.
        joints: indices of the planned joints of the grid.
        counts: boxes along each of them.
    """

    def __init__(self, closing: Closing, T: float, joints: Sequence[int], counts: Sequence[int]) -> None:
        self._closing, self._T, self._joints = closing, T, list(joints)
        passage = closing.passage
        self._low, self._high = passage.box(T)
        ends = np.stack([passage.start, passage.goal])
        self._low = np.minimum(self._low, ends.min(axis=0) - passage.tolerance)
        self._high = np.maximum(self._high, ends.max(axis=0) + passage.tolerance)
        self._edges = [np.linspace(self._low[j], self._high[j], n + 1) for j, n in zip(joints, counts, strict=True)]
        self.open: npt.NDArray[np.bool_] = np.ones(tuple(counts), dtype=bool)
        self._passable = np.zeros(tuple(counts), dtype=bool)
        self._ends = [self._boxes_at(q) for q in ends]
        self.parts = 0

    def separates(self, until: float) -> bool:
        """Close boxes until start and goal are apart; False where they cannot be, or at the time `until`, s."""
        for effort in EFFORTS:
            joining = self._joining(self.open)
            if joining is None:
                return True
            if self._joining(self._passable) is not None:
                return False
            boxes = np.argwhere(joining & ~self._passable)
            some = max(AT_ONCE // effort, 1)
            for first in range(0, len(boxes), some):
                if time.perf_counter() > until:
                    return False
                self._close(boxes[first : first + some], effort)
        return self._joining(self.open) is None

    def _close(self, boxes: Index, effort: int) -> None:
        low, high = np.tile(self._low, (len(boxes), 1)), np.tile(self._high, (len(boxes), 1))
        for axis, j in enumerate(self._joints):
            low[:, j], high[:, j] = self._edges[axis][boxes[:, axis]], self._edges[axis][boxes[:, axis] + 1]
        found = self._closing.close(self._T, low, high, effort)
        self.open[tuple(boxes[found == CLOSED].T)] = False
        self._passable[tuple(boxes[found == PASSABLE].T)] = True
        self.parts += effort * len(boxes)

    def _joining(self, mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_] | None:
        """Return the boxes of `mask` that are joined to start and goal; None where they do not join the two."""
        mask = mask.copy()
        for end in self._ends:
            mask[end] = True  # the ends themselves are passed
        labels, _ = ndimage.label(mask)
        at_start, at_goal = (set(np.unique(labels[end]).tolist()) for end in self._ends)
        if not at_start & at_goal:
            return None
        return np.asarray(np.isin(labels, list(at_start & at_goal)) & mask)

    def _boxes_at(self, q: Array) -> tuple[slice, ...]:
        """The boxes within which a configuration is, and what is within the tolerance of it."""
        near = self._closing.passage.tolerance
        found = []
        for edges, j in zip(self._edges, self._joints, strict=True):
            first = int(np.searchsorted(edges, q[j] - near[j], side="left")) - 1
            last = int(np.searchsorted(edges, q[j] + near[j], side="right"))
            found.append(slice(max(first, 0), max(last, 1)))
        return tuple(found)
