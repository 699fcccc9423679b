"""Potential field, distance transform and D* beside PRM: two joints, a planar scene, a bar that appears on the way.

    python benchmarks/planar_grids.py --markdown /tmp/planar-grids.md       # about a minute
    python benchmarks/publish.py planar-grids /tmp/planar-grids.md --readme docs/theory/reports.md

The configuration space of `12_planar` is cut into cells of 2 degrees; a cell is free where the arm is free at its
centre. Distance transform and D* Lite (S. Koenig, M. Likhachev, AAAI 2002) find least paths between the centres of
free neighbours, eight of each. The potential field is Khatib's (1986), with the distance to cells that are not
free; its descent ends where no neighbour is lower. Their paths are shortened, timed and verified by `op.retime`; PRM
and trajopt plan as usual. The bar appears in the middle of the path found before.
"""

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise, product
from math import hypot, inf

import numpy as np
from published import print_table, table_parser, write_markdown
from scipy.ndimage import distance_transform_edt

import optiplan as op
from optiplan.arrays import Array, Flags
from optiplan.collision.model import CollisionModel

CELL = np.radians(2.0)
STARTS = 100
"""Random free cells that the goal is looked for from."""
NEAR = 6.0
"""Cells within which an obstacle repels."""
REPULSION = 3.0
"""Of the repelling potential, beside 1 of the attracting one; larger values of both arrive less often."""

Cell = tuple[int, int]
STEPS = [(i, j) for i, j in product((-1, 0, 1), repeat=2) if (i, j) != (0, 0)]


@dataclass(eq=False)
class CellGrid:
    """Cells of the configuration space: `free` (k, l), with the configuration of cell 0 and the sides of cells, rad."""

    lower: Array
    free: Flags

    @classmethod
    def of(cls, problem: op.Problem) -> "CellGrid":
        """Check the middle of every cell."""
        lower, upper = problem.limits.lower, problem.limits.upper
        counts = np.floor((upper - lower) / CELL).astype(int) + 1
        model = CollisionModel(problem.robot, problem.scene)
        cells = product(range(counts[0]), range(counts[1]))
        free = np.array([not model.collides(lower + CELL * np.array(cell)) for cell in cells])
        return cls(lower, free.reshape(counts))

    def cell(self, q: Array) -> Cell:
        """The cell of a configuration."""
        i, j = np.rint((q - self.lower) / CELL).astype(int)
        return int(i), int(j)

    def configurations(self, cells: list[Cell]) -> Array:
        """The middles of cells (k, 2), rad."""
        return np.asarray(self.lower + CELL * np.array(cells))

    def neighbours(self, cell: Cell) -> Iterator[tuple[Cell, float]]:
        """Neighbours of a cell inside the grid, with the cost of the step, infinite where an end is not free."""
        for i, j in STEPS:
            other = cell[0] + i, cell[1] + j
            if 0 <= other[0] < self.free.shape[0] and 0 <= other[1] < self.free.shape[1]:
                yield other, hypot(i, j) if self.free[cell] and self.free[other] else inf


def distance_transform(grid: CellGrid, goal: Cell) -> tuple[Array, int]:
    """Costs of least paths from every cell to the goal, in cells, and how many cells were expanded."""
    cost = np.full(grid.free.shape, inf)
    cost[goal] = 0.0
    heap, expanded = [(0.0, goal)], 0
    while heap:
        value, cell = heapq.heappop(heap)
        if value > cost[cell]:
            continue
        expanded += 1
        for other, step in grid.neighbours(cell):
            if value + step < cost[other]:
                cost[other] = value + step
                heapq.heappush(heap, (value + step, other))
    return cost, expanded


def potential(grid: CellGrid, goal: Cell) -> Array:
    """The attracting potential D² / 2 and the repelling one c / 2 (1 / d - 1 / near)² D², in cells.

    D is the distance to the goal, d that to what is not free, within `NEAR`. The factor D² of the repelling one is that
    of S. Ge, Y. Cui (2000): without it a goal beside an obstacle is no minimum.
    """
    i, j = np.indices(grid.free.shape)
    clearance, squared = distance_transform_edt(grid.free), (i - goal[0]) ** 2 + (j - goal[1]) ** 2
    with np.errstate(divide="ignore"):
        repelling = np.where(clearance < NEAR, (1.0 / clearance - 1.0 / NEAR) ** 2, 0.0)
    return np.where(grid.free, 0.5 * squared * (1.0 + REPULSION * repelling), inf)


def descended(grid: CellGrid, value: Array, start: Cell) -> list[Cell]:
    """The path from cell to the lowest neighbour, as long as that is lower; of least paths: its step included."""
    way = [start]
    while True:
        options = [(value[other], other) for other, step in grid.neighbours(way[-1]) if np.isfinite(step)]
        if not options or not min(options)[0] < value[way[-1]]:
            return way
        way.append(min(options)[1])


@dataclass(eq=False)
class DStarLite:
    """D* Lite from a goal back to a start: costs that are repaired where the grid has changed."""

    grid: CellGrid
    start: Cell
    goal: Cell
    expanded: int = 0
    g: dict[Cell, float] = field(default_factory=dict)
    rhs: dict[Cell, float] = field(default_factory=dict)
    heap: list[tuple[tuple[float, float], Cell]] = field(default_factory=list)
    queued: dict[Cell, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.rhs[self.goal] = 0.0
        self._insert(self.goal)

    def key(self, cell: Cell) -> tuple[float, float]:
        """Priority of a cell: least cost through it, then from it."""
        least = min(self.g.get(cell, inf), self.rhs.get(cell, inf))
        return least + hypot(cell[0] - self.start[0], cell[1] - self.start[1]), least

    def _insert(self, cell: Cell) -> None:
        self.queued[cell] = self.key(cell)
        heapq.heappush(self.heap, (self.queued[cell], cell))

    def update(self, cell: Cell) -> None:
        """Make the one-step cost of a cell anew."""
        if cell != self.goal:
            self.rhs[cell] = min((step + self.g.get(other, inf) for other, step in self.grid.neighbours(cell)))
        self.queued.pop(cell, None)
        if self.g.get(cell, inf) != self.rhs.get(cell, inf):
            self._insert(cell)

    def search(self) -> list[Cell]:
        """Return a least path from the start; empty without one."""
        while self.heap:
            key, cell = self.heap[0]
            if self.queued.get(cell) != key:
                heapq.heappop(self.heap)
                continue
            consistent = self.rhs.get(self.start, inf) == self.g.get(self.start, inf)
            if key >= self.key(self.start) and consistent:
                break
            heapq.heappop(self.heap)
            del self.queued[cell]
            self.expanded += 1
            if self.g.get(cell, inf) > self.rhs.get(cell, inf):
                self.g[cell] = self.rhs[cell]
            else:
                self.g[cell] = inf
                self.update(cell)
            for other, _ in self.grid.neighbours(cell):
                self.update(other)
        way = [self.start]
        while way[-1] != self.goal and np.isfinite(self.g.get(way[-1], inf)):
            way.append(min((step + self.g.get(c, inf), c) for c, step in self.grid.neighbours(way[-1]))[1])
        return way if way[-1] == self.goal else []

    def change(self, grid: CellGrid) -> None:
        """Take the grid of another scene, and repair what it changes."""
        changed = [(int(i), int(j)) for i, j in np.argwhere(grid.free != self.grid.free)]
        self.grid = grid
        for cell in {c for one in changed for c in (one, *(other for other, _ in grid.neighbours(one)))}:
            self.update(cell)


def main() -> None:
    """Search, change the scene, search again, print."""
    options = table_parser(__doc__).parse_args()
    before = op.load_problem("12_planar")
    grid = CellGrid.of(before)
    start, goal = grid.cell(before.start), grid.cell(before.goal[0].q)
    search = DStarLite(grid, start, goal)
    way = search.search()
    first = search.expanded
    after = with_bar(before, grid.configurations(way)[len(way) // 2])
    changed = CellGrid.of(after)
    search.change(changed)
    repaired = search.search()
    costs, whole = distance_transform(grid, goal)
    again, again_whole = distance_transform(changed, goal)
    from_scratch = DStarLite(changed, start, goal)
    from_scratch.search()
    rows = []
    for name, value, cells in (
        ("potential field", lambda g: potential(g, goal), "–"),
        ("distance transform", lambda g: distance_transform(g, goal)[0], f"{whole}, then {again_whole}"),
    ):
        ways = [descended(g, value(g), start) for g in (grid, changed)]
        rows.append(
            [name, arrived(grid, value(grid), goal), cells, *ends(ways, goal, (before, after), (grid, changed))]
        )
    told = f"{first}, then {search.expanded - first} ({from_scratch.expanded} anew)"
    rows.append(["D* Lite", "100 %", told, *ends([way, repaired], goal, (before, after), (grid, changed))])
    assert np.isclose(costs[start], length(way))
    assert np.isclose(again[start], length(repaired))
    for planner in ("prm", "trajopt"):
        runs = [op.plan(problem, planner, budget=3.0) for problem in (before, after)]
        rows.append([f"`{planner}`", "–", "–", *(words(run) for run in runs)])
    headings = ("method", "arrives from", "cells expanded, then after the bar", "path, rad", "path past the bar, rad")
    print_table(headings, rows)
    write_markdown(options.markdown, headings, rows)


def length(way: list[Cell]) -> float:
    """Length of a path, in cells."""
    return float(sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(way)))


def arrived(grid: CellGrid, value: Array, goal: Cell) -> str:
    """From how many random free cells, connected with the goal, the descent arrives."""
    reachable = np.argwhere(np.isfinite(distance_transform(grid, goal)[0]))
    chosen = reachable[np.random.default_rng(0).integers(0, len(reachable), STARTS)]
    found = [descended(grid, value, (int(i), int(j)))[-1] == goal for i, j in chosen]
    return f"{100.0 * np.mean(found):.0f} %"


def ends(
    ways: list[list[Cell]], goal: Cell, problems: tuple[op.Problem, ...], grids: tuple[CellGrid, ...]
) -> list[str]:
    """What each way comes to: its length once it is timed and verified, or where it ends."""
    found = []
    for way, problem, grid in zip(ways, problems, grids, strict=True):
        if not way or way[-1] != goal:
            off = CELL * hypot(way[-1][0] - goal[0], way[-1][1] - goal[1]) if way else inf
            found.append(f"stuck {off:.2f} rad before the goal")
            continue
        Q = grid.configurations(way)
        Q[0], Q[-1] = problem.start, problem.goal[0].q
        found.append(words(op.retime(problem, shortened(problem, Q))))
    return found


def shortened(problem: op.Problem, Q: Array) -> Array:
    """The waypoints (k, n) that straight lines, free at steps of a quarter of a cell, cannot leave out."""
    model = CollisionModel(problem.robot, problem.scene)

    def free(a: Array, b: Array) -> bool:
        count = int(np.ceil(np.linalg.norm(b - a) / CELL * 4.0)) + 1
        return not any(model.collides(a + share * (b - a)) for share in np.linspace(0.0, 1.0, count))

    kept = [0]
    while kept[-1] < len(Q) - 1:
        kept.append(next((k for k in range(len(Q) - 1, kept[-1] + 1, -1) if free(Q[kept[-1]], Q[k])), kept[-1] + 1))
    return np.asarray(Q[kept])


def words(run: op.Run) -> str:
    """Length of the path of a run, and whether it is verified."""
    if run.metrics is None:
        return "none found"
    return f"{run.metrics.joint_path:.3f}, {'verified' if run.verified else 'refused'}"


def with_bar(problem: op.Problem, q: Array) -> op.Problem:
    """The problem with a small bar where the tool is at q."""
    x, y, z = problem.robot.fk(q).position
    bar = op.Box("bar", size=(0.06, 0.3, 0.06), position=(x, y, z))
    return problem.with_scene(op.Scene([*problem.scene.obstacles, bar]))


if __name__ == "__main__":
    main()
