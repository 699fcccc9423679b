"""A roadmap of one scene, kept from query to query: free configurations, and which motions between them are free."""

from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from optiplan.arrays import Array
from optiplan.planners.base import Budget
from optiplan.planners.motion import MotionCheck
from optiplan.planners.search import Search
from optiplan.planners.shortcut import path_times
from optiplan.planners.space import Ends

_NEIGHBOURS = np.e * 1.1
"""Neighbours of a vertex, times log(N): enough for paths to approach the shortest (Karaman and Frazzoli, 2011)."""

_LOOKS = 64  # samples between two looks at the clock, some 2 ms
_LOCAL = 0.5  # share of samples near the ends of the query that asks for more: there the ways are narrow
_NARROW, _WIDE = 0.03, 0.5  # s at full speed: standard deviations of those, evenly over their logarithm
_SAMPLE = 500  # vertices that are reported

Edges = npt.NDArray[np.intp]


class Roadmap:
    """Vertices are free configurations; edges join near ones and are proved when a path needs them.

    What was proved free or found blocked is remembered. OMPL's PRM grows and searches in two threads by the clock,
    which no seed makes repeatable, so this one is our own. Sources: Kavraki et al., "Probabilistic roadmaps", IEEE
    T-RA 1996; Bohlin and Kavraki, "Path planning using lazy PRM", ICRA 2000.

    Attributes:
        vertices: (N, n), rad or m.
        tried: motions between vertices that were held against the scene, and whether they are free.
    """

    def __init__(self, box: tuple[Array, Array], velocity: Array, seed: int) -> None:
        self._box, self._velocity, self._rng = box, velocity, np.random.default_rng(seed)
        self.vertices = np.zeros((0, len(velocity)))
        self.tried: dict[tuple[int, int], bool] = {}
        self._edges: Edges = np.zeros((0, 2), dtype=np.intp)
        self._linked = 0  # vertices that have their edges

    def grow(self, check: MotionCheck, count: int, ends: Ends, budget: Budget) -> None:
        """Draw until there are `count` vertices, half of the new ones near the ends; a cut budget leaves fewer."""
        found = list(self.vertices)
        while len(found) < count and not budget.over:
            found += [q for q in self._draw(np.vstack(ends)) if not check.blocked(q)]
        self.vertices = np.array(found[: max(count, len(self.vertices))]).reshape(-1, len(self._velocity))
        if not budget.over and self._linked < len(self.vertices):
            self._edges, self._linked = self._links(self.vertices, 0), len(self.vertices)

    def query(self, check: MotionCheck, ends: Ends, budget: Budget) -> Search:
        """The shortest path from the start to a goal whose edges are proved free, or how far the two sides reach.

        The ends are joined with the roadmap for this query only.
        """
        if budget.over:
            return Search(None, ends[0][None], ends[1], (1, len(ends[1])))
        n, points = len(self.vertices), np.vstack([self.vertices, *ends])
        edges = np.vstack([self._edges, self._links(points, n)])
        cost = path_times(points[edges[:, 0]], points[edges[:, 1]], self._velocity)
        place = {(i, j): k for k, (i, j) in enumerate(edges.tolist())}
        alive = np.array([self.tried.get(edge, True) for edge in place], dtype=bool)
        own: dict[tuple[int, int], bool] = {}
        while True:
            reached, before = _shortest(len(points), edges[alive], cost[alive], n)
            goal = n + 1 + int(np.argmin(reached[n + 1 :]))
            if budget.over or not np.isfinite(reached[goal]):
                return self._failed(points, own)
            path = _walk(before, n, goal)
            blocked = self._first_blocked(check, points, path, own)
            if blocked is None:
                return Search(points[path], points[n : n + 1], points[n + 1 :], (n + 1, len(ends[1])))
            alive[place[blocked]] = False

    def _draw(self, ends: Array) -> Array:
        size = (_LOOKS, len(self._velocity))
        low, high = self._box
        anywhere = low + (high - low) * self._rng.uniform(size=size)
        spread = _NARROW * (_WIDE / _NARROW) ** self._rng.uniform(size=(_LOOKS, 1)) * self._velocity
        near = ends[self._rng.integers(len(ends), size=_LOOKS)] + spread * self._rng.standard_normal(size)
        local = self._rng.uniform(size=(_LOOKS, 1)) < _LOCAL
        return np.where(local, np.clip(near, low, high), anywhere)

    def _links(self, points: Array, first: int) -> Edges:
        """Edges (E, 2), i < j, from the points `first` on to their nearest neighbours among all."""
        if len(points) < 2:
            return np.zeros((0, 2), dtype=np.intp)
        count = min(len(points) - 1, int(np.ceil(_NEIGHBOURS * np.log(len(points)))))
        scaled = points / self._velocity
        _, near = cKDTree(scaled).query(scaled[first:], k=count + 1)
        pairs = np.column_stack([np.repeat(np.arange(first, len(points)), count + 1), near.ravel()])
        pairs = np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1)
        return np.asarray(np.unique(pairs, axis=0), dtype=np.intp)

    def _first_blocked(
        self, check: MotionCheck, points: Array, path: list[int], own: dict[tuple[int, int], bool]
    ) -> tuple[int, int] | None:
        """The first edge of a path that is not free; `own` remembers those of the query, `tried` the others."""
        n = len(self.vertices)
        for a, b in pairwise(path):
            edge = (min(a, b), max(a, b))
            known = self.tried if edge[1] < n else own
            if edge not in known:
                known[edge] = check.free(points[a], points[b])
            if not known[edge]:
                return edge
        return None

    def _failed(self, points: Array, own: dict[tuple[int, int], bool]) -> Search:
        """No path: what is joined with the start, and with a goal, by motions that are proved free."""
        n = len(self.vertices)
        free = [edge for edge, is_free in (*self.tried.items(), *own.items()) if is_free]
        edges = np.array(free, dtype=np.intp).reshape(-1, 2)
        graph = csr_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(len(points), len(points)))
        _, part = connected_components(graph, directed=False)
        sides = [np.flatnonzero(np.isin(part, part[ends])) for ends in ([n], range(n + 1, len(points)))]
        trees = [points[side[:: len(side) // _SAMPLE + 1]] for side in sides]
        return Search(None, trees[0], trees[1], (len(sides[0]), len(sides[1])))


def _shortest(count: int, edges: Edges, cost: Array, start: int) -> tuple[Array, Edges]:
    """Cost (count,) of the shortest way from the start to every point, inf where there is none, and its last step."""
    graph = csr_array((cost, (edges[:, 0], edges[:, 1])), shape=(count, count))
    reached, before = dijkstra(graph, directed=False, indices=start, return_predecessors=True)
    return reached, before


def _walk(before: Edges, start: int, goal: int) -> list[int]:
    path = [goal]
    while path[-1] != start:
        path.append(int(before[path[-1]]))
    return path[::-1]
