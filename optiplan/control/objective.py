"""`TaskObjective`: the tasks of one priority as weighted least squares in the velocities at the end of a step."""

import math
from collections.abc import Sequence
from copy import copy
from typing import Any

import numpy as np
from scipy.linalg.lapack import dgesdd

from optiplan._core import core
from optiplan.arrays import Array, Index
from optiplan.control.configuration import Configuration
from optiplan.control.tasks.base import ControlTask
from optiplan.control.tasks.frame_tasks import FrameTask
from optiplan.records import dataclass
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


@dataclass(slots=True, eq=False)
class Demand:
    """Rows A x = b that tasks ask for, weighted, and the program that they make.

    Attributes:
        A: (k, n); `b`: (k,); `wanted`: (k,), the rates that `b` approaches.
        error: weighted norm of the errors of the rows `main`: those that weigh at least a tenth of the heaviest.
        H: (n, n) and `g`: (n,) of ½ xᵀ H x + gᵀ x, see `TaskObjective.demand`.
        manipulability: product of the singular values of the first frame task's weighted Jacobian; None without one.
    """

    A: Array
    b: Array
    wanted: Array
    error: float
    main: Index
    H: Array
    g: Array
    manipulability: float | None

    def undone(self, x: Array) -> tuple[float, float]:
        """Norms, over the rows `main`, of what velocities x (n,) leave undone, and of what is wanted."""
        if core is not None:
            return core.undone(self.A, self.wanted, self.main, x)
        wanted = self.wanted[self.main]
        undone = self.A[self.main] @ x - wanted
        return math.sqrt(undone @ undone), math.sqrt(wanted @ wanted)


class TaskObjective:
    """Tasks of one priority.

    Args:
        tasks: bound to the robot.
        n: number of joints.
        by_acceleration: whether tasks ask for accelerations (second order) or for velocities (first order).
        response: s; at the level of velocities, the time in which rates of tasks follow what is wanted.
        damping: weight of all velocities, per rad/s or m/s.
        first: whether no priority comes before; near singularities of its first frame task velocities are damped more.
    """

    def __init__(
        self, tasks: Sequence[ControlTask], n: int, by_acceleration: bool, response: float, damping: float, first: bool
    ) -> None:
        self.tasks = tuple(tasks)
        self._response, self._damping = response, damping
        self._undone = 0.0
        self._by_acceleration = by_acceleration
        cost = np.concatenate([np.zeros(0), *(task.cost for task in self.tasks)])
        k = len(cost)
        self._A, self._rates = np.zeros((k, n)), np.zeros((3, k))  # what is asked, the error, what is wanted
        self._H, self._g = np.zeros((n, n)), np.zeros(n)
        self._main = np.flatnonzero(cost >= MAIN * cost.max(initial=0.0))
        self._measured = self._frame_rows() if first else (0, 0)
        self._forwards: list[Array | None] = [None] * len(self.tasks)
        self._set_step(1.0)

    def _frame_rows(self) -> tuple[int, int]:
        """First row of the first frame task, and the one behind its last; (0, 0) without one."""
        row = 0
        for task in self.tasks:
            if isinstance(task, FrameTask):
                return row, row + task.size
            row += task.size
        return 0, 0

    def _set_step(self, dt: float) -> None:
        """Everything that depends on dt alone."""
        self._dt = dt
        self._late = math.exp(-dt / self._response) if self._response > 0.0 else 0.0
        steadiness = STEADINESS / dt if self._response > 0.0 else 0.0
        lasting = dt * math.exp(-dt / PERSISTENCE)
        self._rules = np.array([dt, self._late, steadiness, lasting, NEAR_SINGULAR, SINGULAR_DAMPING])

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
        if dt != self._dt:
            self._set_step(dt)
        for task in self.tasks:
            task.begin_step(state, dt)

    def demand(self, c: Configuration, state: State) -> Demand:
        """What the tasks ask for at a configuration; the arrays are overwritten by the next call.

        At the level of velocities, rates approach the wanted ones as in a first order lag of time constant `response`.
        With w = exp(-dt / response):  (1 - w) wanted + w (r + change of the forward part), where r = (J - dt J̇) v is
        the rate of a step ago. A program that jumps to what is wanted within its limits jumps to and fro where limits
        and tasks meet.

        H and g are of ½ |A x - b|² + ½ w² |x|² + ½ s² |x - v - k dt a|²; w grows near singularities. s² = STEADINESS /
        dt: where tasks and limits leave many answers nearly as good, the steadiest is taken. With k = exp(-dt /
        PERSISTENCE) accelerations go on for a moment, so that a steady one does not lag behind its task. Damping
        follows as slowly as the tasks do: it asks for velocities of exp(-dt / response) v.

        w² = damping² + (SINGULAR_DAMPING (1 - (s / s_0)²))² for the least singular value s below s_0, + (UNDONE_DAMPING
        u)² where a share u of what is wanted has stayed undone for a while: out of reach, the errors' own curvature
        makes steps too long that small singular values make long, and the arm would swing about the nearest pose.
        """
        parts = []
        for k, task in enumerate(self.tasks):
            error, J = task.evaluate(c)
            wanted = task.wanted_rate(error)
            forward = task.feed_forward(c)
            if forward is not None:
                wanted = wanted + forward
            asked = change = drift = None
            if self._by_acceleration:
                asked = self._second_order(task, J, wanted, c, state)
            else:
                change = self._forward_change(k, forward, c)
                if self._late:
                    drift = task.drift(c)
            parts.append((J, error, wanted, task.cost, asked, change, drift))
        weight = self._damping**2 + (UNDONE_DAMPING * self._undone) ** 2
        motion, out = (state.v, state.a), (self._A, self._rates, self._H, self._g)
        size, product = task_program(parts, self._main, self._measured, motion, weight, self._rules, out)
        manipulability = product if self._measured[1] else None
        return Demand(self._A, self._rates[0], self._rates[2], size, self._main, self._H, self._g, manipulability)

    def _forward_change(self, k: int, forward: Array | None, c: Configuration) -> Array | None:
        """By how much the feed-forward of task k changes in a step: as it says itself, or as it did in the last one."""
        before, self._forwards[k] = self._forwards[k], forward
        rate = self.tasks[k].feed_forward_rate(c)
        if rate is not None:
            return np.asarray(self._dt * rate)
        if forward is None or before is None:
            return None
        change = forward - before
        return np.asarray(change) if max(map(abs, change.tolist())) <= JUMP * self._dt else None

    def _second_order(self, task: ControlTask, J: Array, wanted: Array, c: Configuration, state: State) -> Array:
        """J v + dt (J a) with J a + J̇ v = 4 max(gain, 1) (wanted - J v) - gain (J v - forward) + rate of forward.

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
        return np.asarray(rate + self._dt * acceleration)

    def learn(self, demand: Demand, x: Array) -> None:
        """Take in what velocities x (n,) leave undone."""
        undone, wanted = demand.undone(x)
        share = min(1.0, undone / max(wanted, 1e-6))
        self._undone += (1.0 - math.exp(-self._dt / FORGETTING)) * (share - self._undone)

    @property
    def weighted(self) -> tuple[Array, Array]:
        """The weighted Jacobian (k, n) and rates (k,) of the last demand."""
        return self._A, self._rates[0]


def program_in_python(
    parts: Sequence[tuple[Any, ...]],
    main: Index,
    measured: tuple[int, int],
    motion: tuple[Array, Array],
    weight: float,
    rules: Array,
    out: tuple[Array, Array, Array, Array],
) -> tuple[float, float]:
    """Fill the arrays of a demand; see `TaskObjective.demand`.

    Args:
        parts: of each task J, its error, what it wants, its cost, the rates that it asks for or None for the lag, by
            how much its feed-forward changes, and J̇ v, each None for zeros.
        main: rows that count for the error.
        measured: first row of those whose singular values count, and the one behind the last.
        motion: v (n,) and a (n,).
        weight: w² but for singularities.
        rules: (6,): dt, exp(-dt / response), s², k dt, s_0, SINGULAR_DAMPING.
        out: A (k, n); rates (3, k): requested, of the errors, wanted; H (n, n); g (n,).

    Returns:
        The weighted error, and the product of the singular values.
    """
    dt, late, steadiness, lasting, near, most = rules.tolist()
    (v, a), (A, rates, H, g) = motion, out
    first = 0
    for J, error, wanted, cost, given, change, drift in parts:
        asked, rows = given, slice(first, first + len(cost))
        first = rows.stop
        if asked is None:
            rate = J @ v - (0.0 if drift is None else dt * drift) + (0.0 if change is None else change)
            asked = wanted + late * (rate - wanted) if late else wanted
        A[rows], rates[:, rows] = cost[:, None] * J, (cost * asked, cost * error, cost * wanted)
    values = _singular_values(A[slice(*measured)])
    if values[-1] < near:
        weight += (most * (1.0 - (values[-1] / near) ** 2)) ** 2
    np.matmul(A.T, A, out=H)
    H.ravel()[:: len(v) + 1] += weight + steadiness
    g[:] = A.T @ -rates[0] - steadiness * (v + lasting * a) - (weight * late) * v
    return float(np.linalg.norm(rates[1, main])), float(values.prod())


def _singular_values(J: Array) -> Array:
    """Singular values of J, falling; infinity without rows, NaN where LAPACK does not converge."""
    if not len(J):
        return np.full(1, np.inf)
    _, s, _, info = dgesdd(J, compute_uv=0)
    return np.asarray(s) if info == 0 else np.full(min(J.shape), np.nan)


task_program = program_in_python if core is None else core.task_program
"""`program_in_python`, in the native core where that is there: the same formulas, other rounding."""
