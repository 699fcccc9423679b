"""Whether the states of a driver can be: no older than they may be, in order, and without jumps."""

import numpy as np

from optiplan.arrays import Array, is_finite
from optiplan.execution.arguments import numbers, told
from optiplan.execution.measurement import Measurement

OLDEST = 0.1
"""s: an older state says nothing about where the robot is."""

JUMP = 0.02
"""rad or m, beside what the joint may travel: noise and the resolution of stamps."""


class StateWatch:
    """Compare each state with the one before.

    Args:
        joint_names: of the robot.
        velocity: (n,) limits, rad/s or m/s.
    """

    def __init__(self, joint_names: tuple[str, ...], velocity: Array) -> None:
        self._names, self._velocity = joint_names, np.asarray(velocity)
        self._before: Measurement | None = None

    def fault(self, state: Measurement) -> str:
        """Return why a state cannot be, or nothing; positions that are no numbers are left to the executor."""
        if not is_finite(state.age) or state.age > OLDEST:
            return f"the driver's state is {_seconds(state.age)} old; expected at most {OLDEST:g} s"
        if not is_finite(state.stamp):
            return f"the driver's state has {told(state.stamp)} as its time; expected seconds"
        before, self._before = self._before, state
        if before is None or state.stamp == before.stamp:
            return ""
        if state.stamp < before.stamp:
            return f"the driver's states run backwards in time by {before.stamp - state.stamp:.3f} s"
        q, last = numbers(state.q), numbers(before.q)
        if q.shape != self._velocity.shape or last.shape != q.shape:
            return ""
        beyond = np.abs(q - last) - self._velocity * (state.stamp - before.stamp) - JUMP
        if not (beyond > 0.0).any():
            return ""
        worst = int(beyond.argmax())
        return f"the driver's state jumps: {self._names[worst]} by {abs(q[worst] - last[worst]):.4g}"


def _seconds(age: object) -> str:
    return f"{age:.3f} s" if is_finite(age) else told(age)
