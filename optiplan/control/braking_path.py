"""`BrakingPath`: the configurations that a robot passes if it brakes from the end of this step on."""

import math
from typing import TYPE_CHECKING

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array, Index
from optiplan.control.braking import Phase, farthest_way, stop_phases, travel
from optiplan.control.configuration import Configuration
from optiplan.control.limits.joint_box import JointBox, JointBrakes
from optiplan.control.limits.stop_limits import StopPath
from optiplan.robot.robot import Robot

if TYPE_CHECKING:
    from optiplan._core import _core_base

_PHASES = 3
FINEST = 5e-3
"""s; steps of the control loop may be longer, but not the parts of a stop that are checked."""


class BrakingPath(StopPath):
    """A stop of all joints, each as quick as its limits let it; one object is moved from candidate to candidate.

    Args:
        robot: the robot.
    """

    def __init__(self, robot: Robot) -> None:
        self._configuration = Configuration(robot)
        self.dt = 0.0
        self._phases: list[tuple[Phase, ...]] = []
        self._table: tuple[Array, Array, Array, Array] | None = None

    def start(self, q: Array, v: Array, a: Array, box: JointBox | JointBrakes, dt: float) -> None:
        """A stop from q, v, a (n,) at the end of the step, to be checked every dt seconds, or FINEST."""
        self._q, self._v, self.dt, self._table = q, v, min(dt, FINEST), None
        joints = list(zip(v.tolist(), a.tolist(), box.acceleration.tolist(), box.jerk.tolist(), strict=True))
        self._phases = [stop_phases(*joint) for joint in joints]
        self.end = q + [travel(phases, joint[0]) for phases, joint in zip(self._phases, joints, strict=True)]
        self.way = np.array([farthest_way(phases, *joint) for phases, joint in zip(self._phases, joints, strict=True)])
        most = max([sum([phase[0] for phase in phases]) for phases in self._phases])
        self._steps = min(math.ceil(most / self.dt), 10**9)

    @property
    def steps(self) -> int:  # type: ignore[override]
        """Number of steps until the last joint stands."""
        return self._steps

    def at(self, step: int) -> Array:
        """Configuration (n,) after so many steps."""
        return self._moved(step)[0]

    def motion(self, steps: Index) -> tuple[Array, Array]:
        """Configurations and velocities (k, n) after so many steps (k,)."""
        found = [self._moved(step) for step in steps.tolist()]
        return np.array([q for q, _ in found]), np.array([v for _, v in found])

    def strongest(self, first: int, last: int) -> Array:
        """See `StopPath.strongest`."""
        lasting, begin, change, before = self._tabulated()
        t_0, t_1 = np.maximum(first * self.dt - before, 0.0), np.minimum(last * self.dt - before, lasting)
        sizes = np.maximum(np.abs(begin + t_0 * change), np.abs(begin + t_1 * change))
        return np.asarray(np.where(t_0 < t_1, sizes, 0.0).max(axis=1))

    def _moved(self, step: int) -> tuple[Array, Array]:
        """Of each phase the part that is done; what is left of a velocity after them all is rounding."""
        if step == 0:
            return self._q, self._v
        lasting, first, change, before = self._tabulated()
        t = np.minimum(np.maximum(step * self.dt - before, 0.0), lasting)
        gained = t * (first + 0.5 * change * t)
        speed = self._v[:, None] + np.cumsum(gained, axis=1) - gained
        way = t * (speed + t * (0.5 * first + t * (change / 6.0)))
        done = step * self.dt >= before[:, -1] + lasting[:, -1]
        return self._q + way.sum(axis=1), np.where(done, 0.0, self._v + gained.sum(axis=1))

    def _tabulated(self) -> tuple[Array, Array, Array, Array]:
        """Durations, first accelerations, jerks and the time before each phase, (n, 3) each."""
        if self._table is not None:
            return self._table
        padded = [[*phases, *[(0.0, 0.0, 0.0)] * (_PHASES - len(phases))] for phases in self._phases]
        table = np.array(padded, dtype=np.float64)
        lasting = table[:, :, 0]
        self._table = lasting, table[:, :, 1], table[:, :, 2], np.cumsum(lasting, axis=1) - lasting
        return self._table

    def configuration(self, step: int) -> Configuration:
        """Kinematics after so many steps."""
        self._configuration.update(self.at(step), self._v)
        return self._configuration


class NativeBrakingPath(BrakingPath):
    """The same, computed by the native core.

    Attributes:
        native: the stop in the core.
    """

    native: "_core_base.StopPath"

    def start(self, q: Array, v: Array, a: Array, box: JointBox | JointBrakes, dt: float) -> None:
        """See `BrakingPath.start`."""
        self._q, self._v, self.dt = q, v, min(dt, FINEST)
        self.native = core.StopPath.of(q, v, a, box.acceleration, box.jerk, self.dt)

    @property
    def end(self) -> Array:  # type: ignore[override]
        """See `StopPath`."""
        return self.native.end

    @property
    def way(self) -> Array:  # type: ignore[override]
        """See `StopPath`."""
        return self.native.way

    @property
    def steps(self) -> int:  # type: ignore[override]
        """See `BrakingPath.steps`."""
        return self.native.steps

    def at(self, step: int) -> Array:
        """See `BrakingPath.at`."""
        return self.native.at(step)

    def strongest(self, first: int, last: int) -> Array:
        """See `StopPath.strongest`."""
        return self.native.strongest(first, last)

    def motion(self, steps: Index) -> tuple[Array, Array]:
        """See `BrakingPath.motion`."""
        return self.native.motion(steps)


def make_braking_path(robot: Robot) -> BrakingPath:
    """The native one where the core is there."""
    return BrakingPath(robot) if core is None else NativeBrakingPath(robot)
