"""Scenes with a start and a goal, drawn at random: what `generate: NAME` in a suite stands for.

A generator is a frozen dataclass: its fields are the parameters that a suite may set, its docstring says what it
makes, `LEVELS` gives the parameters of `level: easy | hard` (`medium` is the defaults), and `draw` makes one scene.
Lengths are shares of the arm's reach R about its shoulder S, so that one generator suits every arm; x is ahead, z is
up. Whether the robot can stand at start and goal is not the generator's business: `generate.py` draws again until it
can.
"""

from collections.abc import Mapping
from typing import Any, ClassVar, Protocol

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.records import dataclass

Obstacle = dict[str, Any]
Levels = Mapping[str, Mapping[str, Any]]

AHEAD, DOWN = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, -1.0])
AROUND = ((1, 0), (-1, 0), (0, 1), (0, -1))  # the four walls of a room
BOARD = 0.02  # thickness of boards and walls, shares of R


@dataclass(frozen=True, eq=False)
class Arm:
    """Scale of a scene: the shoulder S (3,), m, world, and the reach R, m."""

    shoulder: Array
    reach: float

    def at(self, *shares: float) -> Array:
        """The point S + R (x, y, z), m."""
        return np.asarray(self.shoulder + self.reach * np.array(shares))


@dataclass(frozen=True, eq=False)
class DrawnScene:
    """One scene: obstacles as in a problem file, tool poses X_WT; the start None is the robot's own first one."""

    obstacles: list[Obstacle]
    start: pin.SE3 | None
    goal: pin.SE3


class Generator(Protocol):
    """Protocol of the scene generators below."""

    LEVELS: ClassVar[Levels]

    def draw(self, rng: np.random.Generator, arm: Arm) -> DrawnScene:
        """One scene; same random numbers, same scene."""
        ...


def box(name: str, size: Array, center: Array) -> Obstacle:
    """A box of `size` (3,) m about `center` (3,) m."""
    return {"name": name, "shape": {"box": rounded(size)}, "pose": {"position": rounded(center)}}


def pillar(name: str, radius: float, length: float, center: Array) -> Obstacle:
    """An upright cylinder, m."""
    shape = {"cylinder": {"radius": round(radius, 6), "length": round(length, 6)}}
    return {"name": name, "shape": shape, "pose": {"position": rounded(center)}}


def enclosure(name: str, foot: tuple[float, float, float], sides: tuple[float, float], arm: Arm) -> list[Obstacle]:
    """A floor about `foot` and four walls on it, open at the top; `sides`: distance of opposite walls, and height.

    All in shares of R, about S.
    """
    (x, y, z), (side, height), R = foot, sides, arm.reach
    parts = [box(f"{name}_floor", R * np.array([side, side, BOARD]), arm.at(x, y, z - BOARD / 2.0))]
    for k, (dx, dy) in enumerate(AROUND):
        size = R * np.array([BOARD if dx else side + BOARD, BOARD if dy else side - BOARD, height])
        center = arm.at(x + dx * side / 2.0, y + dy * side / 2.0, z + height / 2.0)
        parts.append(box(f"{name}_wall_{k}", size, center))
    return parts


def pointing(position: Array, approach: Array, roll: float) -> pin.SE3:
    """X_WT of a tool at `position` (3,) whose z axis is the unit vector `approach` (3,), turned about it by `roll`."""
    aside = np.cross(approach, AHEAD if abs(approach[0]) < 0.9 else np.array([0.0, 0.0, 1.0]))
    x = aside / np.linalg.norm(aside)
    R = np.column_stack([x, np.cross(approach, x), approach])
    return pin.SE3(R @ pin.exp3(np.array([0.0, 0.0, roll])), position)


def rounded(values: Array) -> list[float]:
    """Return numbers of a problem file, to 1e-6 m or rad."""
    return [round(float(x), 6) for x in values]


@dataclass(frozen=True)
class Shelf:
    """From one compartment of a shelf into another. `rows` x `columns` compartments, each `gap` high."""

    LEVELS: ClassVar[Levels] = {"easy": {"gap": 0.5, "rows": 2}, "hard": {"gap": 0.32, "rows": 4}}
    rows: int = 3
    columns: int = 2
    gap: float = 0.4
    width: float = 0.9
    depth: float = 0.35
    front: float = 0.55

    def draw(self, rng: np.random.Generator, arm: Arm) -> DrawnScene:
        """Boards and walls, then two compartments."""
        R, height = arm.reach, self.rows * (self.gap + BOARD)
        low, middle = rng.uniform(-0.62, -0.4), self.front + rng.uniform(0.0, 0.1) + self.depth / 2.0
        obstacles = []
        for k in range(self.rows + 1):
            size = R * np.array([self.depth, self.width, BOARD])
            obstacles.append(box(f"board_{k}", size, arm.at(middle, 0.0, low + k * (self.gap + BOARD))))
        for k, y in enumerate(np.linspace(-self.width / 2.0, self.width / 2.0, self.columns + 1)):
            size = R * np.array([self.depth, BOARD, height + BOARD])
            obstacles.append(box(f"wall_{k}", size, arm.at(middle, y, low + height / 2.0)))
        cells = rng.choice(self.rows * self.columns, 2, replace=False)
        start, goal = (self._inside(int(cell), low, middle, rng, arm) for cell in cells)
        return DrawnScene(obstacles, start, goal)

    def _inside(self, cell: int, low: float, middle: float, rng: np.random.Generator, arm: Arm) -> pin.SE3:
        row, column = divmod(cell, self.columns)
        y = self.width * ((column + 0.5) / self.columns - 0.5)
        z = low + row * (self.gap + BOARD) + 0.5 * self.gap
        x = middle - self.depth / 2.0 + rng.uniform(0.3, 0.6) * self.depth
        return pointing(arm.at(x, y + rng.uniform(-0.04, 0.04), z), AHEAD, rng.uniform(-np.pi, np.pi))


@dataclass(frozen=True)
class Cage:
    """From outside between the bars of a cage. Bars stand `gap` apart around a block with sides of length `side`."""

    LEVELS: ClassVar[Levels] = {"easy": {"gap": 0.6}, "hard": {"gap": 0.36}}
    gap: float = 0.45
    side: float = 0.6
    height: float = 0.7
    bar: float = 0.012

    def draw(self, rng: np.random.Generator, arm: Arm) -> DrawnScene:
        """Bars around the goal, a lid of bars, and a start over it."""
        R, x = arm.reach, rng.uniform(0.5, 0.6)
        y, low = rng.uniform(-0.25, 0.25), -0.45
        count = int(np.ceil(self.side / self.gap)) + 1
        edge = np.linspace(-self.side / 2.0, self.side / 2.0, count)
        feet = {
            (round(a, 9), round(b, 9))
            for e in edge
            for a, b in ((e, edge[0]), (e, edge[-1]), (edge[0], e), (edge[-1], e))
        }
        obstacles = [
            pillar(f"bar_{k}", self.bar * R, self.height * R, arm.at(x + a, y + b, low + self.height / 2.0))
            for k, (a, b) in enumerate(sorted(feet))
        ]
        for k, e in enumerate(edge):
            size = R * np.array([2.0 * self.bar, self.side, 2.0 * self.bar])
            obstacles.append(box(f"lid_{k}", size, arm.at(x + e, y, low + self.height + self.bar)))
        inside = arm.at(x + rng.uniform(-0.1, 0.1), y + rng.uniform(-0.1, 0.1), low + rng.uniform(0.2, 0.45))
        tilt = np.array([1.0, 0.0, -rng.uniform(0.0, 1.5)])
        goal = pointing(inside, tilt / np.linalg.norm(tilt), rng.uniform(-np.pi, np.pi))
        return DrawnScene(obstacles, None, goal)


@dataclass(frozen=True)
class OpenBox:
    """Into a box that is open at the top, out of another one beside it; `opening` is its inner width and length."""

    LEVELS: ClassVar[Levels] = {"easy": {"opening": 0.45}, "hard": {"opening": 0.28, "height": 0.4}}
    opening: float = 0.36
    height: float = 0.3

    def draw(self, rng: np.random.Generator, arm: Arm) -> DrawnScene:
        """Two boxes, one on either side."""
        obstacles, poses = [], []
        for k, sign in enumerate(rng.permutation([-1.0, 1.0])):
            x, y, low = rng.uniform(0.45, 0.58), sign * rng.uniform(0.3, 0.4), -0.5
            obstacles += enclosure(f"box_{k}", (x, y, low), (self.opening + BOARD, self.height), arm)
            depth = low + rng.uniform(0.35, 0.75) * self.height
            poses.append(pointing(arm.at(x, y, depth), DOWN, rng.uniform(-np.pi, np.pi)))
        return DrawnScene(obstacles, poses[0], poses[1])


@dataclass(frozen=True)
class Table:
    """Over a table full of things: from one free place to another. `objects` stand on it, up to `height` tall."""

    LEVELS: ClassVar[Levels] = {"easy": {"objects": 4}, "hard": {"objects": 14, "height": 0.5}}
    objects: int = 8
    height: float = 0.35

    def draw(self, rng: np.random.Generator, arm: Arm) -> DrawnScene:
        """The board, the things, two places between them."""
        R, top = arm.reach, -0.42
        obstacles = [box("table", R * np.array([0.7, 1.4, BOARD]), arm.at(0.65, 0.0, top - BOARD / 2.0))]
        for k in range(self.objects):
            x, y = rng.uniform(0.4, 0.9), rng.uniform(-0.6, 0.6)
            tall, wide = rng.uniform(0.3, 1.0) * self.height, rng.uniform(0.03, 0.07)
            if rng.uniform() < 0.5:
                size = R * np.array([2.0 * wide, 2.0 * wide, tall])
                obstacles.append(box(f"thing_{k}", size, arm.at(x, y, top + tall / 2.0)))
            else:
                obstacles.append(pillar(f"thing_{k}", R * wide, R * tall, arm.at(x, y, top + tall / 2.0)))
        start, goal = (self._place(sign, top, rng, arm) for sign in rng.permutation([-1.0, 1.0]))
        return DrawnScene(obstacles, start, goal)

    def _place(self, side: float, top: float, rng: np.random.Generator, arm: Arm) -> pin.SE3:
        x, y, z = rng.uniform(0.42, 0.7), side * rng.uniform(0.2, 0.55), top + rng.uniform(0.04, 0.15)
        return pointing(arm.at(x, y, z), DOWN, rng.uniform(-np.pi, np.pi))


@dataclass(frozen=True)
class UnderTable:
    """From above a table to below it; `room` is the height between board and floor."""

    LEVELS: ClassVar[Levels] = {"easy": {"room": 0.6, "width": 0.7}, "hard": {"room": 0.42, "width": 1.2}}
    room: float = 0.5
    width: float = 0.9

    def draw(self, rng: np.random.Generator, arm: Arm) -> DrawnScene:
        """The board, the floor, a pose on each side of the board."""
        R, top = arm.reach, rng.uniform(0.0, 0.1)
        obstacles = [
            box("board", R * np.array([0.5, self.width, BOARD]), arm.at(0.7, 0.0, top)),
            box("floor", R * np.array([0.6, 1.6, BOARD]), arm.at(0.75, 0.0, top - self.room - BOARD)),
        ]
        over = arm.at(rng.uniform(0.5, 0.65), rng.uniform(-0.3, 0.3), top + rng.uniform(0.1, 0.2))
        under = arm.at(rng.uniform(0.55, 0.7), rng.uniform(-0.2, 0.2), top - rng.uniform(0.45, 0.6) * self.room)
        start = pointing(over, DOWN, rng.uniform(-np.pi, np.pi))
        return DrawnScene(obstacles, start, pointing(under, AHEAD, rng.uniform(-np.pi, np.pi)))
