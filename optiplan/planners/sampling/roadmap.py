"""A roadmap of one scene, kept from query to query: free configurations, and which motions between them are free."""

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from optiplan.arrays import Array
from optiplan.libraries import loading
from optiplan.planners.base import Budget
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.sampling.ompl_space import Ends
from optiplan.planners.sampling.search import TREE_SAMPLE, Search
from optiplan.planners.sampling.shortcutting import path_times

_NEIGHBOURS = np.e * 1.1
"""Neighbours of a vertex, times log(N): enough for paths to approach the shortest (Karaman and Frazzoli, 2011)."""

_LOOKS = 64  # samples between two checks of the clock, some 2 ms
_LOCAL = 0.5  # share of samples near the ends of the current query, where passages are narrow
_NARROW, _WIDE = 0.03, 0.5  # s at full speed: standard deviations of those, evenly over their logarithm

Edges = npt.NDArray[np.intp]


class Roadmap:
    """Vertices are free configurations; edges join near ones and are proved when a path needs them.

    Results of edge checks are kept. OMPL's PRM grows and searches in two threads by the clock,
    which no seed makes repeatable, so this one is our own. Sources: Kavraki et al., "Probabilistic roadmaps", IEEE
    T-RA 1996; Bohlin and Kavraki, "Path planning using lazy PRM", ICRA 2000.

    Attributes:
        vertices: (N, n), rad or m.
        tried: edges checked against the scene, and whether they are free.
    """

    def __init__(self, box: tuple[Array, Array], velocity: Array, seed: int) -> None:
        self._box, self._velocity, self._rng = box, velocity, np.random.default_rng(seed)
        self.vertices = np.zeros((0, len(velocity)))
        self.tried: dict[tuple[int, int], bool] = {}
        self._edges: Edges = np.zeros((0, 2), dtype=np.intp)
        self._linked = 0  # vertices whose edges are computed

    def grow(self, check: MotionCheck, count: int, ends: Ends, budget: Budget) -> None:
        """Sample until there are `count` vertices, half of the new ones near the ends; fewer if the budget ends."""
        found = list(self.vertices)
        while len(found) < count and not budget.over:
            found += [q for q in self._draw(np.vstack(ends)) if not check.blocked(q)]
        self.vertices = np.array(found[: max(count, len(self.vertices))]).reshape(-1, len(self._velocity))

    def query(self, check: MotionCheck, ends: Ends, budget: Budget) -> Search:
        """Return the shortest path from the start to a goal whose edges are proved free, or the two components reached.

        The ends become vertices, so that later queries can reuse them.
        """
        start, *goals = (self._vertex(q) for q in np.vstack(ends))
        if self._linked < len(self.vertices) and not budget.over:
            self._edges, self._linked = self._links(), len(self.vertices)
        points, edges = self.vertices, self._edges
        cost = path_times(points[edges[:, 0]], points[edges[:, 1]], self._velocity)
        place = {(i, j): k for k, (i, j) in enumerate(edges.tolist())}
        alive = np.array([self.tried.get(edge, True) for edge in place], dtype=bool)
        while not budget.over:
            path = shortest_way(len(points), edges[alive], cost[alive], start, np.array(goals))
            if path is None:
                break
            blocked = self._first_blocked(check, path)
            if blocked is None:
                return Search(points[path], points[[start]], points[goals], (len(points), len(goals)))
            alive[place[blocked]] = False
        return self._failed(start, goals)

    def _vertex(self, q: Array) -> int:
        """Return the index of the vertex at q (n,), inserting it if new."""
        there = np.flatnonzero((self.vertices == q).all(axis=1))
        if len(there):
            return int(there[0])
        self.vertices = np.vstack([self.vertices, q])
        return len(self.vertices) - 1

    def _draw(self, ends: Array) -> Array:
        size = (_LOOKS, len(self._velocity))
        low, high = self._box
        anywhere = low + (high - low) * self._rng.uniform(size=size)
        spread = _NARROW * (_WIDE / _NARROW) ** self._rng.uniform(size=(_LOOKS, 1)) * self._velocity
        near = ends[self._rng.integers(len(ends), size=_LOOKS)] + spread * self._rng.standard_normal(size)
        local = self._rng.uniform(size=(_LOOKS, 1)) < _LOCAL
        return np.where(local, np.clip(near, low, high), anywhere)

    def _links(self) -> Edges:
        """Return edges (E, 2), i < j, from every vertex to its nearest neighbours."""
        total = len(self.vertices)
        count = min(total, 1 + int(np.ceil(_NEIGHBOURS * np.log(total))))
        scaled = self.vertices / self._velocity
        with loading():
            from scipy.spatial import cKDTree

        _, near = cKDTree(scaled).query(scaled, k=count)
        pairs = np.column_stack([np.repeat(np.arange(total), count), near.ravel()])
        pairs = np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1)
        return np.asarray(np.unique(pairs, axis=0), dtype=np.intp)

    def _first_blocked(self, check: MotionCheck, path: list[int]) -> tuple[int, int] | None:
        """Return the first edge of a path that is not free; every result is kept."""
        for a, b in pairwise(path):
            edge = (min(a, b), max(a, b))
            if edge not in self.tried:
                self.tried[edge] = check.free(self.vertices[a], self.vertices[b])
            if not self.tried[edge]:
                return edge
        return None

    def _failed(self, start: int, goals: list[int]) -> Search:
        """Return the search without a path: the vertices connected with the start, and with a goal."""
        points = self.vertices
        edges = np.array([edge for edge, free in self.tried.items() if free], dtype=np.intp).reshape(-1, 2)
        with loading():
            from scipy.sparse import csr_array
            from scipy.sparse.csgraph import connected_components

        graph = csr_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(len(points), len(points)))
        _, part = connected_components(graph, directed=False)
        sides = [np.flatnonzero(np.isin(part, part[ends])) for ends in ([start], goals)]
        trees = [points[side[:: len(side) // TREE_SAMPLE + 1]] for side in sides]
        return Search(None, trees[0], trees[1], (len(sides[0]), len(sides[1])))


def shortest_way(count: int, edges: Edges, cost: Array, start: int, goals: Edges) -> list[int] | None:
    """Return the points of the shortest way from the start to a goal by edges (E, 2) at costs (E,); None without one.

    Args:
        count: of points.
        edges: between points, each once.
        cost: >= 0.
        start: index of a point.
        goals: (g,) of others.
    """
    with loading():
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import dijkstra

    graph = csr_array((cost, (edges[:, 0], edges[:, 1])), shape=(count, count))
    reached, before = dijkstra(graph, directed=False, indices=start, return_predecessors=True)
    way = [int(goals[np.argmin(reached[goals])])]
    if not np.isfinite(reached[way[0]]):
        return None
    while way[-1] != start:
        way.append(int(before[way[-1]]))
    return way[::-1]
