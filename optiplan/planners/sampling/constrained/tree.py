"""A tree of configurations whose edges are walked."""

import numpy as np

from optiplan.arrays import Array


class Tree:
    """Nodes with the points from their parents to them.

    Attributes:
        parents: index of each node's parent, -1 of a root.
        edges: points after the parent, the node last, (k, n) each; a root's is itself.
        costs: s from the root, where they are kept.
    """

    def __init__(self, roots: Array, units: Array) -> None:
        self._units, self._count = units, 0
        self._scaled = np.empty((256, roots.shape[1]))
        self.parents: list[int] = []
        self.edges: list[Array] = []
        self.costs: list[float] = []
        for q in roots:
            self.add(-1, q[None], 0.0)

    def __len__(self) -> int:
        """Return the number of nodes."""
        return self._count

    def add(self, parent: int, points: Array, cost: float = 0.0) -> int:
        """Add a node at the end of points (k, n) from its parent, and return its index."""
        if self._count == len(self._scaled):
            self._scaled = np.vstack([self._scaled, np.empty_like(self._scaled)])
        self._scaled[self._count] = points[-1] / self._units
        self.parents.append(parent)
        self.edges.append(points)
        self.costs.append(cost)
        self._count += 1
        return self._count - 1

    def node(self, k: int) -> Array:
        """Return the configuration (n,) of a node."""
        return np.asarray(self.edges[k][-1])

    def distances(self, q: Array) -> Array:
        """Return the distances, s at full joint speed in the 2-norm, of all nodes from q (n,)."""
        return np.asarray(np.linalg.norm(self._scaled[: self._count] - q / self._units, axis=1))

    def path(self, k: int) -> Array:
        """Return the points (k, n) from the root to a node."""
        parts = []
        while k >= 0:
            parts.append(self.edges[k])
            k = self.parents[k]
        return np.vstack(parts[::-1])
