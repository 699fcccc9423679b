"""`Objective`: the tasks of one priority as weighted least squares in the velocities at the end of a step."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dgesdd

from optiplan.arrays import Array
from optiplan.control.configuration import Configuration
from optiplan.control.state import State
from optiplan.control.tasks.base import ControlTask

BASE_DAMPING = 1e-4
"""Weight, per rad/s or m/s, that every velocity has; makes the program strictly convex."""
NEAR_SINGULAR = 0.05
"""Singular value of the weighted Jacobian, m/rad, below which velocities are damped more."""
SINGULAR_DAMPING = 0.05
"""Weight, per rad/s or m/s, of velocities at a singularity."""


@dataclass(frozen=True, slots=True, eq=False)
class Demand:
    """Rows A x = b that tasks ask for, weighted: A (k, n), b (k,); `error` is the weighted norm of their errors."""

    A: Array
    b: Array
    error: float


class Objective:
    """Tasks of one priority.

    Args:
        tasks: bound to the robot.
        n: number of joints.
        by_acceleration: whether tasks ask for accelerations (second order) or for velocities (first order).
    """

    def __init__(self, tasks: Sequence[ControlTask], n: int, by_acceleration: bool) -> None:
        self.tasks = tuple(tasks)
        self._by_acceleration = by_acceleration
        ends = np.cumsum([0, *(task.size for task in self.tasks)])
        self._slices = [slice(int(a), int(b)) for a, b in zip(ends[:-1], ends[1:], strict=True)]
        self._A, self._b, self._e = np.zeros((int(ends[-1]), n)), np.zeros(int(ends[-1])), np.zeros(int(ends[-1]))
        self._n = n
        self._ridge = np.arange(n) * (n + 1)

    def demand(self, c: Configuration, state: State, dt: float) -> Demand:
        """What the tasks ask for at a configuration; the arrays are overwritten by the next call."""
        A, b, e = self._A, self._b, self._e
        for task, rows in zip(self.tasks, self._slices, strict=True):
            error, J = task.evaluate(c)
            wanted = self._second_order(task, error, J, c, state, dt) if self._by_acceleration else None
            if wanted is None:
                wanted = task.wanted_rate(error)
                forward = task.feed_forward(c)
                if forward is not None:
                    wanted = wanted + forward
            cost = task.cost
            np.multiply(J, cost[:, None], out=A[rows])
            np.multiply(wanted, cost, out=b[rows])
            np.multiply(error, cost, out=e[rows])
        return Demand(A, b, float(np.sqrt(e @ e)))

    def _second_order(
        self, task: ControlTask, error: Array, J: Array, c: Configuration, state: State, dt: float
    ) -> Array:
        """J v + dt (J a - J̇ v) for the wanted acceleration, critically damped towards the wanted rate of the error.

        With the wanted rate r = -gain e + forward:  J a + J̇ v = 2 gain (r - J v) + (rate of the forward part); where
        r = -gain e, that is a double root at about the gain.
        """
        rate = J @ state.v
        wanted = task.wanted_rate(error)
        forward, forward_rate = task.feed_forward(c), task.feed_forward_rate(c)
        if forward is not None:
            wanted = wanted + forward
        drift = c.rate(rate, task.jacobian(c.ahead) @ state.v)
        # The wanted rate itself falls as the error does; that is known, so it is fed forward too.
        falling = -task.gain * (rate if forward is None else rate - forward)
        acceleration = 4.0 * task.gain * (wanted - rate) + falling - drift
        if forward_rate is not None:
            acceleration = acceleration + forward_rate
        return np.asarray(rate + dt * acceleration)

    def program(self, demand: Demand, damping: float, singular: float | None) -> tuple[Array, Array]:
        """H (n, n) and g (n,) of ½ |A x - b|² + ½ w² |x|², w growing from `damping` where `singular` is small.

        w² = damping² + (1 - (s / s_0)²)² · SINGULAR_DAMPING² for the least singular value s below s_0.
        """
        H = demand.A.T @ demand.A
        weight = damping**2
        if singular is not None and singular < NEAR_SINGULAR:
            weight += (SINGULAR_DAMPING * (1.0 - (singular / NEAR_SINGULAR) ** 2)) ** 2
        H.ravel()[self._ridge] += weight
        return H, -(demand.A.T @ demand.b)

    def rows_of(self, index: int) -> Array:
        """Weighted Jacobian of one task, in what `demand` left."""
        return self._A[self._slices[index]]


def singular_values(J: Array) -> Array:
    """Singular values of J, falling; NaN where LAPACK does not converge."""
    _, s, _, info = dgesdd(J, compute_uv=0)
    return np.asarray(s) if info == 0 else np.full(min(J.shape), np.nan)
