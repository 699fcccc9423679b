"""Distances of a robot's bodies along an executed motion, block by block."""

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.geometry.scene import Scene
from optiplan.robot.robot import Robot
from optiplan.simulation.log import ContactLog

WINDOW = 0.05
"""m: farther apart than this nothing is measured."""

INTERVAL = 2e-3
"""s between two configurations that are measured: at 2 m/s a hand travels 4 mm meanwhile."""


class ContactWatch:
    """Measures the least distance of all pairs at configurations as they come."""

    def __init__(self, robot: Robot, scene: Scene, dt: float) -> None:
        """Prepare the queries.

        Args:
            robot: the robot.
            scene: what is around it.
            dt: s between the configurations that will be given; one each `interval` is measured.
        """
        self.enter(robot, scene)
        self._every = max(1, round(INTERVAL / dt))
        self.interval = self._every * dt
        self._seen = 0
        self._least, self._at = np.inf, 0.0
        self._pair: tuple[str, str] | None = None
        self._touched: dict[tuple[str, str], float] = {}

    def enter(self, robot: Robot, scene: Scene, begin: float = 0.0) -> None:
        """Measure in another scene from now on, whose obstacles began to move at `begin`, s; what was found is kept."""
        self._model, self._begin = CollisionModel(robot, scene), begin

    def look(self, t: Array, Q: Array) -> None:
        """Measure configurations Q (K, n) at times t (K,), s."""
        rows = np.arange(-self._seen % self._every, len(t), self._every)
        self._seen += len(t)
        if not len(rows) or not self._model.pairs:
            return
        placed = self._model.at_times(Q[rows], t[rows] - self._begin) if self._model.motions else Q[rows]
        found = self._model.near(placed, WINDOW)
        if not len(found.distance):
            return
        k = int(found.distance.argmin())
        if found.distance[k] < self._least:
            self._least, self._at = float(found.distance[k]), float(t[rows[found.rows[k]]])
            self._pair = self._names(int(found.pairs[k]))
        for k in np.flatnonzero(found.distance <= 0.0).tolist():
            self.touch(self._names(int(found.pairs[k])), float(t[rows[found.rows[k]]]))

    def touch(self, pair: tuple[str, str], t: float) -> None:
        """Note that two bodies touched at time t, s, whoever saw it."""
        names = (min(pair), max(pair))
        self._touched[names] = min(t, self._touched.get(names, np.inf))

    def result(self) -> ContactLog:
        """What was found."""
        if not self._model.pairs and self._pair is None:
            return ContactLog(self.interval, None, WINDOW, None, None, dict(self._touched))
        at = None if self._pair is None else self._at
        return ContactLog(self.interval, min(self._least, WINDOW), WINDOW, self._pair, at, dict(self._touched))

    def _names(self, pair: int) -> tuple[str, str]:
        found = self._model.pairs[pair]
        return found.name_a, found.name_b
