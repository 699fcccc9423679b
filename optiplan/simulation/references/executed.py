"""References of an executor: the set-points of its ticks, at a speed that changes on the way."""

from collections.abc import Callable, Sequence

import numpy as np

from optiplan.arrays import Array
from optiplan.errors import wrong_argument
from optiplan.execution.executor import Executor
from optiplan.runs.run import Run
from optiplan.simulation.references.base import JointTargets

Speeds = Sequence[tuple[float, float]] | Callable[[Executor], object]
"""Pairs of a time, s, and the speed wanted from then on, 0 to 1; or a function that is called before every tick."""

LONGEST = 600.0
"""s; an execution that lasts longer is given up."""


class ExecutedReference:
    """What an executor sends while its speed changes; then the end of the motion.

    Attributes:
        place: (K,), s of the planned motion, at each tick.
        override: (K,), the speed that was wanted.
    """

    def __init__(self, run: Run, speeds: Speeds, dt: float) -> None:
        """Execute a run to its end in ticks of `dt`, s.

        Raises:
            InputError: the executor refuses the run; it does not come to its end within `LONGEST`, or stops by itself.
        """
        executor, change = Executor(run), speeds if callable(speeds) else _changes(speeds)
        change(executor)
        ticks = [executor.tick(0.0)]
        while ticks[-1].status.phase != "done":
            change(executor)
            ticks.append(executor.tick(dt))
            if len(ticks) * dt > LONGEST or ticks[-1].status.phase == "stopped":
                status = ticks[-1].status
                found = f"speeds at which the robot is {status.phase} at {status.place:.3f} s of {run.duration:.3f} s"
                found += f" ({status.reason})" if status.reason else ""
                raise wrong_argument("execute", "speeds", found, f"an execution to the end within {LONGEST:g} s")
        self._dt = dt
        self._rows = [np.array([getattr(tick, key) for tick in ticks]) for key in ("q", "v", "a", "torque")]
        self.place: Array = np.array([tick.status.place for tick in ticks])
        self.override: Array = np.array([tick.status.override for tick in ticks])

    @property
    def duration(self) -> float:
        """Until the robot stands still at the end, s."""
        return (len(self.place) - 1) * self._dt

    def sample(self, t: Array) -> JointTargets:
        """Targets at times t (K,), s; between two ticks, their mean by distance."""
        at = np.clip(np.asarray(t) / self._dt, 0.0, len(self.place) - 1.0)
        at = np.where(np.abs(at - np.round(at)) < 1e-6, np.round(at), at)
        before = np.minimum(at.astype(np.intp), len(self.place) - 2)
        share = (at - before)[:, None]
        return JointTargets(*((1.0 - share) * rows[before] + share * rows[before + 1] for rows in self._rows))

    def places(self, t: Array) -> Array:
        """Places at the last ticks before times t (K,), s: (K,)."""
        return np.asarray(
            self.place[np.clip(np.round(np.asarray(t) / self._dt), 0, len(self.place) - 1).astype(np.intp)]
        )


def _changes(speeds: Sequence[tuple[float, float]]) -> Callable[[Executor], None]:
    waiting = sorted(((float(t), float(speed)) for t, speed in speeds), key=lambda one: one[0])  # the last counts

    def change(executor: Executor) -> None:
        while waiting and waiting[0][0] <= executor.time:
            executor.override = waiting.pop(0)[1]

    return change
