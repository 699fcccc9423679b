"""Obstacles that move, as a controller looks ahead at them: joints behind those of the robot, which do not brake."""

import math
from collections.abc import Sequence

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.moving_obstacles import displacements
from optiplan.control.configuration import Configuration
from optiplan.control.limits.stop_limits import StopPath
from optiplan.geometry.obstacle_motion import ObstacleMotion

HORIZON = 0.4
"""s that moving obstacles are looked ahead at least, also where the robot stands sooner."""
AHEAD = 0.25
"""m; how much farther than others the bodies of moving obstacles come into view: getting out of the way takes time."""


class ObstacleJoints:
    """The sliding joints of m moving obstacles at a time, s since their motions began.

    Attributes:
        size: number of joints, 3 m.
    """

    def __init__(self, motions: Sequence[ObstacleMotion]) -> None:
        self._motions, self.size = tuple(motions), 3 * len(motions)

    def at(self, t: float) -> Array:
        """Positions (3 m,), m."""
        return np.asarray(displacements(self._motions, np.array([t]))[0])

    def rates(self, t: float) -> Array:
        """Velocities (3 m,), m/s."""
        return np.asarray(displacements(self._motions, np.array([t]), 1)[0])

    def coefficients(self, t: float) -> tuple[Array, Array]:
        """Positions as polynomials of the time from t on (3 m, K), and how long these hold (3 m,), s."""
        found = [motion.from_times(np.array([t]))[0] for motion in self._motions]
        size = max(rows.shape[1] for rows in found)
        C = np.vstack([np.pad(rows, ((0, 0), (0, size - rows.shape[1]))) for rows in found])
        left = np.repeat([max(0.0, motion.until - t) for motion in self._motions], 3)
        return np.ascontiguousarray(C), left


class PathAmongMoving(StopPath):
    """The stop of a robot, with the joints of obstacles that go on moving, for HORIZON at least."""

    def __init__(self, path: StopPath, joints: ObstacleJoints, t: float, placed: Configuration) -> None:
        self._path, self._joints, self._t, self._placed = path, joints, t, placed
        self.dt, self.steps = path.dt, max(path.steps, math.ceil(HORIZON / path.dt))
        C, left = joints.coefficients(t)
        powers = np.arange(C.shape[1])
        self._sizes, self._left, self._powers = np.abs(C), left, powers
        lasting = np.minimum(self.steps * self.dt, left)[:, None]
        self.way = np.append(path.way, (self._sizes * powers * lasting**powers).sum(axis=1))
        self.end = self.at(self.steps)

    def at(self, step: int) -> Array:
        """See `StopPath.at`."""
        return np.append(self._path.at(step), self._joints.at(self._t + step * self.dt))

    def strongest(self, first: int, last: int) -> Array:
        """See `StopPath.strongest`; a sudden stop by w in a time T strays by w T / 4, as 2 w / T does."""
        powers, begin, end = self._powers, first * self.dt, last * self.dt
        time = np.minimum(end, self._left)[:, None]
        steady = (self._sizes * powers * (powers - 1) * time ** np.maximum(powers - 2, 0)).sum(axis=1)
        speed = (self._sizes * powers * time ** np.maximum(powers - 1, 0)).sum(axis=1)
        sudden = (begin < self._left) & (self._left < end)
        return np.append(self._path.strongest(first, last), steady + np.where(sudden, 2.0 * speed / (end - begin), 0.0))

    def configuration(self, step: int) -> Configuration:
        """See `StopPath.configuration`."""
        q = self.at(step)
        self._placed.update(q, np.zeros(len(q)))
        return self._placed
