"""Obstacles that move, as a controller looks ahead at them: joints behind those of the robot, which do not brake."""

import math
from collections.abc import Sequence

import numpy as np

from optiplan.arrays import Array
from optiplan.control.configuration import Configuration
from optiplan.control.limits.stop_limits import StopPath
from optiplan.geometry.obstacle_motion import ObstacleMotion
from optiplan.trajectory.polynomial import shifted

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
        self.size, powers = 3 * len(motions), max([2, *(motion.coefficients.shape[1] for motion in motions)])
        self._rows = np.zeros((len(motions), 3, powers))
        for rows, motion in zip(self._rows, motions, strict=True):
            rows[:, : motion.coefficients.shape[1]] = motion.coefficients
        self._until = np.array([motion.until for motion in motions])
        self._powers = np.arange(powers)

    @property
    def motions(self) -> list[ObstacleMotion]:
        """The motions as they are by now, m."""
        return [ObstacleMotion(rows.copy(), float(until)) for rows, until in zip(self._rows, self._until, strict=True)]

    def replace(self, k: int, motion: ObstacleMotion) -> None:
        """Let obstacle k move on a straight line from now on."""
        self._rows[k] = 0.0
        self._rows[k, :, : motion.coefficients.shape[1]] = motion.coefficients
        self._until[k] = motion.until

    def at(self, t: float | Array) -> Array:
        """Positions (…, 3 m), m, at times t (…), s."""
        powers = np.minimum(np.asarray(t)[..., None], self._until)[..., None] ** self._powers  # (…, m, K)
        return np.asarray((self._rows * powers[..., None, :]).sum(axis=-1).reshape(*np.shape(t), self.size))

    def rates(self, t: float) -> Array:
        """Velocities (3 m,), m/s."""
        powers = self._powers * np.minimum(t, self._until)[:, None] ** np.maximum(self._powers - 1, 0)
        return np.asarray(((self._rows * powers[:, None]).sum(axis=2) * (t <= self._until)[:, None]).ravel())

    def coefficients(self, t: float) -> tuple[Array, Array]:
        """Positions as polynomials of the time from t on (3 m, K), and how long these hold (3 m,), s."""
        C = shifted(self._rows.swapaxes(1, 2), np.minimum(t, self._until)).swapaxes(1, 2)
        C[t >= self._until, :, 1:] = 0.0
        left = np.repeat(np.maximum(self._until - t, 0.0), 3)
        return np.ascontiguousarray(C.reshape(self.size, -1)), left


def straight_on(displacement: Array, velocity: Array, t: float) -> ObstacleMotion:
    """Return the motion with a displacement (3,), m, and a velocity (3,), m/s, at time t, s, that ends HORIZON later.

    Who is not seen again stands still there: nothing is known of a longer way.
    """
    return ObstacleMotion(np.column_stack([displacement - t * velocity, velocity]), t + HORIZON)


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
