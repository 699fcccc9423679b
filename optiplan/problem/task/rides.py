"""Steps that go with something that moves on a stated motion, and steps that wait for it."""

import operator
import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Flags
from optiplan.geometry.obstacle_motion import SLIDES, ObstacleMotion
from optiplan.geometry.poses import ReadOnlyPoses
from optiplan.records import dataclass

CONDITION = r"^\s*(\S+)\.(x|y|z|angle)\s*(<=|>=|<|>)\s*(\S+)\s*$"
"""`conveyor.x > 0.3`: where something is, m, or how far it has turned, rad."""

LONGEST = 600.0
"""s after which nothing is waited for."""

_STEP, _HALVINGS = 0.005, 60
"""s between the times at which a condition is looked at first; halvings of such a time."""

_COMPARED: Mapping[str, Callable[[Any, float], Any]] = {
    ">": operator.gt,
    ">=": operator.ge,
    "<": operator.lt,
    "<=": operator.le,
}


@dataclass(frozen=True, eq=False)
class Mover(ReadOnlyPoses):
    """Something that moves as stated.

    Attributes:
        name: of a frame or an obstacle.
        motion: M(t).
        X_WO: its pose without any displacement: at time t it is at M(t) X_WO.
    """

    name: str
    motion: ObstacleMotion
    X_WO: pin.SE3


@dataclass(frozen=True, eq=False)
class Ride:
    """What a step is done in: its poses are at M(t) X at time t, and between lines the frame rests there.

    Attributes:
        mover: with which the robot goes.
        frame: of the robot, that goes with it.
        joints: names of the joints that lead that frame, which move although a step does not name them.
    """

    mover: Mover
    frame: str
    joints: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class WaitUntil:
    """The robot rests until a condition holds, which it does at the end of the step.

    Attributes:
        mover: what it is about.
        axis: `x`, `y` or `z` of its origin in the world, m, or `angle`, rad.
        relation: `>`, `>=`, `<` or `<=`.
        value: m or rad.
    """

    mover: Mover
    axis: str
    relation: str
    value: float

    def holds(self, t: float) -> bool:
        """Whether the condition holds at time t, s."""
        return bool(self._holding(np.array([t]))[0])

    def _holding(self, t: Array) -> Flags:
        """Return at which of the times (N,), s, the condition holds."""
        motion = self.mover.motion
        if self.axis == "angle":
            values = motion.at(t)[:, SLIDES]
        else:
            values = motion.places(self.mover.X_WO.translation, t)[:, "xyz".index(self.axis)]
        return np.asarray(_COMPARED[self.relation](values, self.value))

    def first(self, begin: float) -> float | None:
        """Return the first time from `begin` on at which it holds, s; None within `LONGEST`."""
        if self.holds(begin):
            return begin
        times: Array = begin + _STEP * np.arange(1.0, LONGEST / _STEP + 1.0)
        holding = np.flatnonzero(self._holding(times))
        if not len(holding):
            return None
        high = float(times[holding[0]])
        low = high - _STEP
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if self.holds(middle) else (middle, high)
        return high

    @property
    def words(self) -> str:
        """The condition, as a file has it."""
        return f"{self.mover.name}.{self.axis} {self.relation} {self.value:g}"


def split_condition(text: str) -> tuple[str, str, str, float] | None:
    """Return name, axis, relation and value of a condition; None where it is none."""
    found = re.match(CONDITION, text)
    if found is None:
        return None
    try:
        return found[1], found[2], found[3], float(found[4])
    except ValueError:
        return None
