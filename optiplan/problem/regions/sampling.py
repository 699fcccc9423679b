"""Configurations that put a frame in a goal region."""

import numpy as np

from optiplan.arrays import Array
from optiplan.kinematics.ik.levenberg_marquardt import Descent
from optiplan.problem.regions.region import RegionGoal
from optiplan.robot.robot import Robot

_AIMED, _GOOD = 0.5, 0.9
"""Shares of the tolerances: where projection aims, and what it may use; the rest is for the error of planning."""

_ROUNDS, _ITERATIONS, _FIRST = 12, 4, 60
_LEAST = 0.97
"""Share of the miss that a round may leave; with less progress a fresh start is the better use of time."""


class RegionSampler:
    """Projection onto one region, by descents towards the pose in it nearest to where the frame is."""

    def __init__(self, robot: Robot, goal: RegionGoal) -> None:
        self.goal = goal
        self._aimed, self._good = goal.inner(_AIMED), goal.inner(_GOOD)
        self._descent = Descent(robot, goal.frame, goal.oriented or bool(goal.X_RF.translation.any()))

    def contains(self, q: Array) -> bool:
        """Return whether q (n,) is in the region, with room for the error of planning."""
        return self._good.contains(self._descent.place(q))

    def miss(self, q: Array) -> tuple[float, float]:
        """Return by how much q (n,) is out of the region, m and rad."""
        excess = self.goal.excess(self._descent.place(q))
        return float(np.linalg.norm(excess[:3])), float(np.linalg.norm(excess[3:]))

    def onto(self, q: Array) -> tuple[Array, bool]:
        """Return a configuration (n,) within limits near q (n,), and whether it is in the region."""
        q, before = self._descent.inside(q), np.inf
        for _ in range(_ROUNDS):
            X_WF = self._descent.place(q).copy()
            if self._good.contains(X_WF):
                return q, True
            off = float(np.linalg.norm(self._aimed.excess(X_WF)))
            if off > _LEAST * before:
                break
            before = off
            self._descent.aim(self._aimed.nearest(X_WF))
            q = self._descent.descend(q, _ITERATIONS)
        return q, self.contains(q)

    def drawn(self, seed: Array, rng: np.random.Generator) -> tuple[Array, bool]:
        """Return a configuration (n,) that reaches a pose drawn from the region, or any of it, and whether it does.

        Coordinates that are free begin with those of `seed` (n,).
        """
        self._descent.aim(self._aimed.drawn(self._descent.place(seed).copy(), rng))
        return self.onto(self._descent.descend(seed, _FIRST))
