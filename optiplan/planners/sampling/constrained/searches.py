"""Searches on the constraints: RRT-Connect, RRT* (also informed) and a roadmap."""

from dataclasses import field
from itertools import pairwise

import numpy as np

from optiplan.arrays import Array
from optiplan.planners.common.tolerances import LEAST_GAIN
from optiplan.planners.sampling.constrained.constrained_steps import ConstrainedSteps
from optiplan.planners.sampling.ompl_space import search_bounds
from optiplan.planners.sampling.roadmap import shortest_way
from optiplan.planners.sampling.shortcutting import path_times
from optiplan.records import dataclass

_EXTEND = 0.6  # s at full joint speed: how far a tree grows towards a sample
_NEAR = 0.5  # share of samples that lie near the ends
_AROUND = 0.6  # s: how far beyond the ends these are
_NEIGHBOURS = 8
_PATIENCE, _GROWTH = 100, 2  # growths of each tree in the first round, and factor from one round to the next
_STALE = 150  # samples of RRT* in a row that gain nothing


@dataclass(frozen=True, eq=False)
class Query:
    """Arguments of a search from start (n,) to any of goals (k, n), all on the constraints.

    Attributes:
        seed: of its random numbers.
        iterations: of RRT* at most; 0: none.
        informed: whether RRT* samples only where shorter paths can pass.
        vertices: of the roadmap before its first query.
        states: result: how many configurations were reached.
        nearest: result of RRT-Connect: configurations reached from the start that came nearest to a goal.
    """

    steps: ConstrainedSteps
    start: Array
    goals: Array
    seed: int
    iterations: int = 0
    informed: bool = False
    vertices: int = 150
    states: list[int] = field(default_factory=list)
    nearest: list[Array] = field(default_factory=list)

    @property
    def over(self) -> bool:
        """Whether the budget is used up."""
        return self.steps.budget.over


class RandomConfigurations:
    """Random configurations within the limits, half of them near the ends."""

    def __init__(self, query: Query) -> None:
        self._rng = np.random.default_rng(query.seed)
        both = np.vstack([query.start, query.goals])
        reach = _AROUND * query.steps.units
        self._all = search_bounds(query.steps.check.limits, (query.start, query.goals))
        low, high = both.min(axis=0) - reach, both.max(axis=0) + reach
        self._near = np.maximum(low, self._all[0]), np.minimum(high, self._all[1])

    def __call__(self) -> Array:
        """Return one, (n,)."""
        low, high = self._near if self._rng.uniform() < _NEAR else self._all
        return np.asarray(self._rng.uniform(low, high))


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


def connect(query: Query) -> Array | None:
    """Grow two trees towards each other until they meet: RRT-Connect with walked edges (CBiRRT). Returns (k, n).

    Trees that have not met are begun anew, in rounds of growing patience: the time that random trees take is
    heavy-tailed.
    """
    draw, patience = RandomConfigurations(query), _PATIENCE
    while not query.over:
        found = _round(query, draw, patience)
        if found is not None:
            return found
        patience *= _GROWTH
    return None


def _round(query: Query, draw: RandomConfigurations, patience: int) -> Array | None:
    """Grow two new trees until they meet, or each has grown `patience` times."""
    steps = query.steps
    trees = [Tree(query.start[None], steps.units), Tree(query.goals, steps.units)]
    path: Array | None = None
    for number in range(2 * patience):
        one = number % 2
        new = None if query.over else _grown(trees[one], steps, draw())
        path = None if new is None else _met(trees, one, new, steps)
        if path is not None or query.over:
            break
    query.states.append(sum(map(len, trees)))
    if path is None:
        ways = [trees[0].distances(goal) for goal in query.goals]
        query.nearest.append(trees[0].node(int(np.min(ways, axis=0).argmin())))
    return path


def _met(trees: list[Tree], one: int, new: int, steps: ConstrainedSteps) -> Array | None:
    """Grow the other tree to a new node of one; return the path (k, n) from start to goal where it gets there."""
    tree, other = trees[one], trees[1 - one]
    target = tree.node(new)
    k = int(np.argmin(other.distances(target)))
    points = steps.towards(other.node(k), target)
    if not points:
        return None
    met = other.add(k, np.array(points))
    if points[-1] is not target:
        return None
    ways = [tree.path(new), other.path(met)]
    start, goal = ways[one], ways[1 - one]
    return np.vstack([start, goal[::-1][1:]])


def _grown(tree: Tree, steps: ConstrainedSteps, towards: Array) -> int | None:
    """Grow a tree from its node nearest to a sample; return the new node."""
    k = int(np.argmin(tree.distances(towards)))
    points = steps.towards(tree.node(k), towards, _EXTEND)
    return tree.add(k, np.array(points)) if points else None


def star(query: Query, path: Array) -> Array:
    """Shorten a path (k, n) by RRT* from its start to its end: a tree that is rewired as it grows, edges walked."""
    steps, draw, goal = query.steps, RandomConfigurations(query), path[-1]
    tree = Tree(query.start[None], steps.units)
    best, cost, stale = path, steps.cost(path), 0
    for _ in range(query.iterations):
        if query.over or stale > _STALE:
            break
        q = draw()
        stale += 1
        if query.informed and _least(query, q, goal) >= cost:
            continue
        new = _branch(tree, steps, q)
        if new is None or tree.costs[new] + _least(query, tree.node(new), goal, half=True) >= cost:
            continue
        points = steps.joined(tree.node(new), goal)
        if points is None:
            continue
        found = np.vstack([tree.path(new), points])
        shorter = steps.cost(found)
        stale = 0 if shorter < (1.0 - LEAST_GAIN) * cost else stale
        best, cost = (found, shorter) if shorter < cost else (best, cost)
    query.states.append(len(tree))
    return best


def _least(query: Query, q: Array, goal: Array, half: bool = False) -> float:
    """Return a lower bound, s, of paths from the start, or with `half` from q (n,), through q to the goal (n,)."""
    rest = path_times(q[None], goal[None], query.steps.units)[0]
    return float(rest if half else rest + path_times(query.start[None], q[None], query.steps.units)[0])


def _branch(tree: Tree, steps: ConstrainedSteps, towards: Array) -> int | None:
    """Grow a node towards a sample with the cheapest of its neighbours as parent, and rewire the others to it."""
    nearest = int(np.argmin(tree.distances(towards)))
    points = steps.towards(tree.node(nearest), towards, _EXTEND)
    if not points:
        return None
    q = points[-1]
    parent, way = nearest, np.array(points)
    cost = tree.costs[nearest] + _edge_cost(steps, tree.node(nearest), way)
    near = np.argsort(tree.distances(q))[:_NEIGHBOURS]
    for k in map(int, near):
        least = tree.costs[k] + float(path_times(tree.node(k)[None], q[None], steps.units)[0])
        if k == nearest or least >= cost:
            continue
        other = steps.joined(tree.node(k), q)
        if other is not None and tree.costs[k] + _edge_cost(steps, tree.node(k), np.array(other)) < cost:
            parent, way = k, np.array(other)
            cost = tree.costs[k] + _edge_cost(steps, tree.node(k), way)
    new = tree.add(parent, way, cost)
    for k in map(int, near):
        _rewire(tree, steps, k, new)
    return new


def _rewire(tree: Tree, steps: ConstrainedSteps, k: int, new: int) -> None:
    """Make a new node the parent of another where that is cheaper."""
    least = tree.costs[new] + float(path_times(tree.node(new)[None], tree.node(k)[None], steps.units)[0])
    if k == tree.parents[new] or least >= tree.costs[k]:
        return
    points = steps.joined(tree.node(new), tree.node(k))
    cost = np.inf if points is None else tree.costs[new] + _edge_cost(steps, tree.node(new), np.array(points))
    gain = tree.costs[k] - cost
    if points is None or gain <= 0.0:
        return
    tree.parents[k], tree.edges[k] = new, np.array(points)
    below = {k}
    tree.costs[k] = cost
    while below:
        parent = below.pop()
        children = [child for child, above in enumerate(tree.parents) if above == parent]
        for child in children:
            tree.costs[child] -= gain
        below.update(children)


def _edge_cost(steps: ConstrainedSteps, a: Array, points: Array) -> float:
    return steps.cost(np.vstack([a, points]))


def roadmap(query: Query) -> Array | None:
    """Connect samples on the constraints with their neighbours, and find the shortest way whose edges can be walked.

    Edges are walked when a shortest way takes them (Bohlin and Kavraki, "Path planning using lazy PRM", ICRA 2000); no
    way: half as many vertices again.
    """
    steps, draw = query.steps, RandomConfigurations(query)
    vertices = [query.start, *query.goals]
    walked: dict[tuple[int, int], list[Array] | None] = {}
    wanted = query.vertices
    while not query.over:
        while len(vertices) < wanted + 1 + len(query.goals) and not query.over:
            q = steps.manifold.project(draw())
            if q is not None and not steps.check.blocked(q):
                vertices.append(q)
        found = _shortest(query, vertices, walked)
        if found is not None:
            query.states.append(len(vertices))
            return found
        wanted += wanted // 2
    query.states.append(len(vertices))
    return None


def _shortest(query: Query, vertices: list[Array], walked: dict[tuple[int, int], list[Array] | None]) -> Array | None:
    """Return the shortest way (k, n) from vertex 0 to one of the goals after it, walking its edges as needed."""
    steps, Q = query.steps, np.array(vertices)
    apart = np.linalg.norm((Q[:, None] - Q[None]) / steps.units, axis=2)
    near = np.argsort(apart, axis=1)[:, 1 : 1 + _NEIGHBOURS]
    pairs = np.column_stack([np.repeat(np.arange(len(Q)), near.shape[1]), near.ravel()])
    edges = np.unique(np.sort(pairs, axis=1), axis=0)
    cost = apart[edges[:, 0], edges[:, 1]]
    place = {(i, j): k for k, (i, j) in enumerate(edges.tolist())}
    open_edges = np.array([walked.get(edge, []) is not None for edge in place], dtype=bool)
    goals = np.arange(1, 1 + len(query.goals))
    while not query.over:
        way = shortest_way(len(Q), edges[open_edges], cost[open_edges], 0, goals)
        if way is None:
            return None
        points = [query.start]
        for edge in pairwise(way):
            key = min(edge), max(edge)
            if key not in walked:
                found = steps.joined(Q[key[0]], target := vertices[key[1]])
                walked[key] = None if found is None else [Q[key[0]], *found[:-1], target]
            stretch = walked[key]
            if stretch is None:
                open_edges[place[key]] = False
                break
            points += stretch[1:] if edge[0] == key[0] else stretch[::-1][1:]
        else:
            return np.array(points)
    return None
