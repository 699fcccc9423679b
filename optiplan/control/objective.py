"""`TaskObjective`: the tasks of one priority as weighted least squares in the velocities at the end of a step."""

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg.lapack import dgesdd

from optiplan._core import core
from optiplan.arrays import Array, Index
from optiplan.control.configuration import Configuration
from optiplan.control.tasks.base import ControlTask
from optiplan.trajectory.state import State

BASE_DAMPING = 1e-4
"""Weight, per rad/s or m/s, that every velocity has; makes the program strictly convex."""
NEAR_SINGULAR = 0.05
"""Singular value of the weighted Jacobian, m/rad, below which velocities are damped more."""
STEADINESS = 4e-5
"""s; half of it, divided by dt, is what a change of velocity costs per (rad/s)². A direction that tasks weigh by w per
rad/s follows them with the time constant STEADINESS / w²: 0.04 ms for a pose, 0.4 s for a posture of weight 0.01."""
PERSISTENCE = 0.02
"""s, in which accelerations fade that nothing asks for: what is steady is a velocity, but for motions that go on."""
UNDONE_DAMPING = 0.1
"""Weight, per rad/s or m/s, of velocities where nothing of what is wanted can be done."""
FORGETTING = 0.2
"""s, over which the share that stays undone is averaged."""
JUMP = 20.0
"""m/s² or rad/s²: a feed-forward that changes more quickly has jumped, and is approached like any other rate."""
MAIN = 0.1
"""Rows that weigh at least this share of the heaviest say how far off the target is, and whether it is followed."""
SINGULAR_DAMPING = 0.05
"""Weight, per rad/s or m/s, of velocities at a singularity."""


@dataclass(frozen=True, slots=True, eq=False)
class Demand:
    """Rows A x = b that tasks ask for, weighted: A (k, n), b (k,); `error` is the weighted norm of their errors.

    `wanted` (k,) are the weighted rates that `b` approaches; `main` are the rows that count for the error: those that
    weigh at least a tenth of the heaviest.
    """

    A: Array
    b: Array
    error: float
    main: Index | slice
    wanted: Array


class TaskObjective:
    """Tasks of one priority.

    Args:
        tasks: bound to the robot.
        n: number of joints.
        by_acceleration: whether tasks ask for accelerations (second order) or for velocities (first order).
        response: s; at the level of velocities, the time in which rates of tasks follow what is wanted.
    """

    def __init__(self, tasks: Sequence[ControlTask], n: int, by_acceleration: bool, response: float) -> None:
        self.tasks = tuple(tasks)
        self._response = response
        self._undone = 0.0
        self._by_acceleration = by_acceleration
        ends = np.cumsum([0, *(task.size for task in self.tasks)])
        self._slices = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        k = int(ends[-1])
        self._A, self._cost = np.zeros((k, n)), np.zeros(k)
        self._rates = np.zeros((3, k))  # what is asked, the error, what is wanted
        cost = np.concatenate([np.zeros(0), *(task.cost for task in self.tasks)])
        self._main = _as_slice(np.flatnonzero(cost >= MAIN * cost.max(initial=0.0)))
        self._diagonal = slice(None, None, n + 1)
        self._forwards: list[Array | None] = [None] * len(self.tasks)

    def copy(self) -> "TaskObjective":
        """Return an objective that starts from the same history and leaves this one, and its tasks, as they are."""
        other = copy(self)
        other.tasks, other._forwards = tuple(copy(task) for task in self.tasks), list(self._forwards)
        return other

    def row_names(self, joints: Sequence[str]) -> tuple[str, ...]:
        """Return a name for each row of `Demand.A`, (k,)."""
        return tuple(name for task in self.tasks for name in task.row_names(joints))

    def begin_step(self, state: State, dt: float) -> None:
        """Tell the tasks that a step of dt s begins."""
        for task in self.tasks:
            task.begin_step(state, dt)

    def demand(self, c: Configuration, state: State, dt: float) -> Demand:
        """What the tasks ask for at a configuration; the arrays are overwritten by the next call."""
        A, cost, rates_of = self._A, self._cost, self._rates
        for k, (task, rows) in enumerate(zip(self.tasks, self._slices, strict=True)):
            error, J = task.evaluate(c)
            wanted = task.wanted_rate(error)
            forward = task.feed_forward(c)
            if forward is not None:
                wanted = wanted + forward
            if self._by_acceleration:
                rates = self._second_order(task, J, wanted, c, state, dt)
            else:
                rates = self._first_order(task, J, wanted, self._forward_change(k, forward, c, dt), c, state, dt)
            A[rows], cost[rows] = J, task.cost
            rates_of[0, rows], rates_of[1, rows], rates_of[2, rows] = rates, error, wanted
        A *= cost[:, None]
        b, e, wanted = cost * rates_of
        main = e[self._main]
        return Demand(A, b, math.sqrt(main @ main), self._main, wanted)

    def _forward_change(self, k: int, forward: Array | None, c: Configuration, dt: float) -> Array | None:
        """By how much the feed-forward of task k changes in a step: as it says itself, or as it did in the last one."""
        before, self._forwards[k] = self._forwards[k], forward
        rate = self.tasks[k].feed_forward_rate(c)
        if rate is not None:
            return np.asarray(dt * rate)
        if forward is None or before is None:
            return None
        change = forward - before
        return np.asarray(change) if float(np.abs(change).max()) <= JUMP * dt else None

    def _first_order(
        self,
        task: ControlTask,
        J: Array,
        wanted: Array,
        change: Array | None,
        c: Configuration,
        state: State,
        dt: float,
    ) -> Array:
        """Rates that approach the wanted ones as in a first order lag of time constant `response`.

        With w = exp(-dt / response):  (1 - w) wanted + w (r + change of the forward part), where r = (J - dt J̇) v is
        the rate of a step ago. A program that jumps to what is wanted within its limits jumps to and fro where limits
        and tasks meet.
        """
        late = self._late(dt)
        if late == 0.0:
            return wanted
        rate = J @ state.v
        drift = task.drift(c)
        if drift is not None:
            rate = rate - dt * drift
        if change is not None:
            rate = rate + change
        return np.asarray(wanted + late * (rate - wanted))

    def _second_order(
        self, task: ControlTask, J: Array, wanted: Array, c: Configuration, state: State, dt: float
    ) -> Array:
        """J v + dt (J a) with J a + J̇ v = 4 gain (wanted - J v) - gain (J v - forward) + rate of forward.

        The rate J v follows the wanted one four times as fast as the error falls; how the wanted rate itself falls with
        the error is known and fed forward, and so is the drift J̇ v.
        """
        rate = J @ state.v
        forward, forward_rate = task.feed_forward(c), task.feed_forward_rate(c)
        drift = task.drift(c)
        if drift is None:
            drift = c.rate(rate, task.jacobian(c.ahead) @ state.v)
        falling = -task.gain * (rate if forward is None else rate - forward)
        acceleration = 4.0 * max(task.gain, 1.0) * (wanted - rate) + falling - drift
        if forward_rate is not None:
            acceleration = acceleration + forward_rate
        return np.asarray(rate + dt * acceleration)

    def learn(self, demand: Demand, x: Array, dt: float) -> None:
        """Take in what velocities x (n,) leave undone."""
        wanted = demand.wanted[demand.main]
        undone = demand.A[demand.main] @ x - wanted
        share = math.sqrt(float(undone @ undone) / max(float(wanted @ wanted), 1e-12))
        self._undone += (1.0 - math.exp(-dt / FORGETTING)) * (min(1.0, share) - self._undone)

    def _late(self, dt: float) -> float:
        return math.exp(-dt / self._response) if self._response > 0.0 else 0.0

    def program(
        self, demand: Demand, state: State, dt: float, damping: float, singular: float | None
    ) -> tuple[Array, Array]:
        """H (n, n) and g (n,) of ½ |A x - b|² + ½ w² |x|² + ½ s² |x - v - k dt a|²; w grows where `singular` is small.

        s² = STEADINESS / dt: where tasks and limits leave many answers nearly as good, the steadiest is taken. With
        k = exp(-dt / PERSISTENCE) accelerations go on for a moment, so that a steady one does not lag behind its task.

        w² = damping² + (SINGULAR_DAMPING (1 - (s / s_0)²))² for the least singular value s below s_0, + (UNDONE_DAMPING
        u)² where a share u of what is wanted has stayed undone for a while: out of reach, the errors' own curvature
        makes steps too long that small singular values make long, and the arm would swing about the nearest pose.
        """
        H = demand.A.T @ demand.A
        weight = damping**2
        if singular is not None and singular < NEAR_SINGULAR:
            weight += (SINGULAR_DAMPING * (1.0 - (singular / NEAR_SINGULAR) ** 2)) ** 2
        weight += (UNDONE_DAMPING * self._undone) ** 2
        steadiness = STEADINESS / dt if self._response > 0.0 else 0.0
        H.ravel()[self._diagonal] += weight + steadiness
        g = demand.A.T @ -demand.b
        if self._response > 0.0:
            # Damping follows as slowly as the tasks do: it asks for velocities of exp(-dt / response) v.
            v = state.v
            steady = steadiness * (v + (dt * math.exp(-dt / PERSISTENCE)) * state.a)
            g = g - steady - (weight * self._late(dt)) * v
        return H, g

    @property
    def weighted(self) -> tuple[Array, Array]:
        """The weighted Jacobian (k, n) and rates (k,) of the last demand."""
        return self._A, self._cost * self._rates[0]

    def dexterity(self, index: int) -> tuple[float, float]:
        """Product and least of the singular values of one task's weighted Jacobian, in what `demand` left."""
        values = _singular_values(self._A[self._slices[index]])
        return math.prod(values), values[-1]


def _as_slice(rows: Index) -> Index | slice:
    """Rising indices as a slice where they follow one another: rows of a slice are not copied."""
    return slice(int(rows[0]), int(rows[-1]) + 1) if len(rows) and rows[-1] - rows[0] == len(rows) - 1 else rows


def _singular_values(J: Array) -> list[float]:
    """Singular values of J, falling; NaN where LAPACK does not converge."""
    if core is not None and J.shape[0] <= J.shape[1]:
        return core.singular_values(J)
    _, s, _, info = dgesdd(J, compute_uv=0)
    return list(map(float, s)) if info == 0 else [math.nan] * min(J.shape)
