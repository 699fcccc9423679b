"""More generators of scenes, as described in `tabletop_scenes.py`: walls, clutter, machines, aisles."""

from typing import ClassVar

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.bench.sources.tabletop_scenes import (
    AHEAD,
    AROUND,
    BOARD,
    DOWN,
    Arm,
    DrawnScene,
    Levels,
    Obstacle,
    box,
    enclosure,
    pillar,
    pointing,
    rounded,
)
from optiplan.geometry.poses import pose_to_data
from optiplan.records import dataclass


@dataclass(frozen=True)
class Slot:
    """Through a narrow upright slot in a wall; the tool stands `beyond` it. The slot is `width` wide, `height` tall."""

    LEVELS: ClassVar[Levels] = {"easy": {"width": 0.4}, "hard": {"width": 0.24, "beyond": 0.25}}
    width: float = 0.31
    height: float = 0.6
    beyond: float = 0.18

    def draw(self, rng: np.random.Generator, arm: Arm) -> DrawnScene:
        """Four parts of a wall around the slot."""
        R, x, y = arm.reach, rng.uniform(0.45, 0.52), rng.uniform(-0.2, 0.2)
        z, half = rng.uniform(-0.1, 0.1), 0.9
        obstacles = []
        for k, sign in enumerate((-1.0, 1.0)):
            inner = y + sign * self.width / 2.0
            size = R * np.array([BOARD, abs(sign * half - inner), 1.4])
            obstacles.append(box(f"side_{k}", size, arm.at(x, (inner + sign * half) / 2.0, 0.0)))
            edge = z + sign * self.height / 2.0
            size = R * np.array([BOARD, self.width, abs(sign * 0.7 - edge)])
            obstacles.append(box(f"bar_{k}", size, arm.at(x, y, (edge + sign * 0.7) / 2.0)))
        tip = arm.at(x + self.beyond, y, z + rng.uniform(-0.3, 0.3) * self.height)
        return DrawnScene(obstacles, None, pointing(tip, AHEAD, rng.uniform(-np.pi, np.pi)))


@dataclass(frozen=True)
class Clutter:
    """Between `bodies` boxes, spheres and pillars that hang in the air at random; each up to `size` across."""

    LEVELS: ClassVar[Levels] = {"easy": {"bodies": 8}, "hard": {"bodies": 40}}
    bodies: int = 20
    size: float = 0.2

    def draw(self, rng: np.random.Generator, arm: Arm) -> DrawnScene:
        """Bodies in the shell from a third of the reach to the whole of it, and two poses in it."""
        obstacles = []
        for k in range(self.bodies):
            center, size = self._point(rng, arm, 0.4, 1.05), arm.reach * rng.uniform(0.3, 1.0, 3) * self.size
            obstacles.append(self._body(f"body_{k}", size, center, rng))
        start, goal = (self._pose(rng, arm) for _ in range(2))
        return DrawnScene(obstacles, start, goal)

    def _body(self, name: str, size: Array, center: Array, rng: np.random.Generator) -> Obstacle:
        kind = int(rng.integers(3))
        if kind == 0:
            turned = pin.SE3(pin.exp3(rng.normal(size=3)), center)
            return box(name, size, center) | {"pose": pose_to_data(turned)}
        if kind == 1:
            sphere = {"sphere": round(float(size[0]) / 2.0, 6)}
            return {"name": name, "shape": sphere, "pose": {"position": rounded(center)}}
        return pillar(name, float(size[0]) / 3.0, float(size[1]) * 1.5, center)

    def _point(self, rng: np.random.Generator, arm: Arm, near: float, far: float) -> Array:
        """Uniform in direction, ahead or beside, above the height of the base."""
        while True:
            direction = rng.normal(size=3)
            direction /= np.linalg.norm(direction)
            if direction[0] > -0.5 and direction[2] > -0.5:
                return arm.at(*(rng.uniform(near, far) * direction))

    def _pose(self, rng: np.random.Generator, arm: Arm) -> pin.SE3:
        position = self._point(rng, arm, 0.45, 0.8)
        out = position - arm.shoulder + 0.3 * arm.reach * rng.normal(size=3)
        return pointing(position, out / np.linalg.norm(out), rng.uniform(-np.pi, np.pi))


@dataclass(frozen=True)
class Machine:
    """Tending a machine that stands below the robot's base: through the opening in its top, `opening` wide, into it."""

    LEVELS: ClassVar[Levels] = {"easy": {"opening": 0.5, "depth": 0.15}, "hard": {"opening": 0.32, "depth": 0.3}}
    opening: float = 0.4
    depth: float = 0.22

    def draw(self, rng: np.random.Generator, arm: Arm) -> DrawnScene:
        """A pedestal under the base, a machine with walls, a lid with an opening, a part inside."""
        R, base = arm.reach, arm.shoulder[2]
        lid = -base / R - rng.uniform(0.02, 0.06)  # just below the base plate, which is at height 0
        x, y, side, tall = rng.uniform(0.55, 0.62), rng.uniform(-0.15, 0.15), 0.8, 0.6
        foot = np.array([arm.shoulder[0], arm.shoulder[1], -0.34 * R])
        low, rim = lid - tall, (side - self.opening) / 2.0
        obstacles = [box("pedestal", R * np.array([0.2, 0.2, 0.62]), foot)]
        obstacles += enclosure("machine", (x, y, low), (side, tall), arm)
        for k, (dx, dy) in enumerate(AROUND):
            size = R * np.array([rim if dx else self.opening, rim if dy else side, BOARD])
            away = (self.opening + rim) / 2.0
            obstacles.append(box(f"machine_lid_{k}", size, arm.at(x + dx * away, y + dy * away, lid)))
        goal = pointing(arm.at(x, y, lid - self.depth), DOWN, rng.uniform(-np.pi, np.pi))
        return DrawnScene(obstacles, None, goal)


@dataclass(frozen=True)
class Aisle:
    """A mobile arm drives along an aisle `width` wide and reaches into a rack; all lengths in m."""

    LEVELS: ClassVar[Levels] = {"easy": {"width": 1.8}, "hard": {"width": 1.2, "pallets": 2}}
    width: float = 1.5
    length: float = 4.0
    gap: float = 0.45
    pallets: int = 1

    def draw(self, rng: np.random.Generator, arm: Arm) -> DrawnScene:
        """Racks on both sides from x = 0.9 m on, pallets in the way, and a place in a rack."""
        del arm  # an aisle is as wide as it is, whoever drives in it
        obstacles, middle, deep = [], 0.9 + self.length / 2.0, 0.5
        for side, sign in (("left", 1.0), ("right", -1.0)):
            y = sign * (self.width + deep) / 2.0
            for k in range(4):
                size = np.array([self.length, deep, 0.03])
                obstacles.append(box(f"{side}_board_{k}", size, np.array([middle, y, 0.15 + k * (self.gap + 0.03)])))
            for k, x in enumerate(np.linspace(0.9, 0.9 + self.length, 4)):
                post = np.array([0.05, deep, 0.15 + 3.0 * (self.gap + 0.03)])
                obstacles.append(box(f"{side}_post_{k}", post, np.array([x, y, post[2] / 2.0])))
        for k in range(self.pallets):
            x, side = rng.uniform(1.2, 0.6 + self.length / 2.0), rng.choice([-1.0, 1.0])
            wide = 0.25 * self.width
            center = np.array([x, side * (self.width - wide) / 2.0, 0.08])
            obstacles.append(box(f"pallet_{k}", np.array([0.3, wide, 0.16]), center))
        sign, shelf = rng.choice([-1.0, 1.0]), int(rng.integers(1, 3))
        x = 0.9 + self.length * rng.uniform(0.55, 0.8)
        z = 0.15 + (shelf + 0.5) * (self.gap + 0.03)
        place = np.array([x, sign * (self.width / 2.0 + 0.1), z])
        return DrawnScene(obstacles, None, pointing(place, np.array([0.0, sign, 0.0]), rng.uniform(-np.pi, np.pi)))
