"""`BrakingPath`: the configurations that a robot passes if it brakes from the end of this step on."""

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


class BrakingPath(StopPath):
    """A stop of all joints, each as quick as its limits let it; one object is moved from candidate to candidate.

    Args:
        robot: the robot.
        by_acceleration: whether positions follow the mean of the velocities of both ends of a step, or the new one.
    """

    def __init__(self, robot: Robot, by_acceleration: bool) -> None:
        self._trapezoid = by_acceleration
        self._configuration = Configuration(robot)
        self.dt = 0.0
        self.end, self.way = np.zeros(robot.n), np.zeros(robot.n)
        self._phases: list[tuple[Phase, ...]] = []
        self._table: tuple[Array, Array, Array, Array] | None = None

    def start(self, q: Array, v: Array, a: Array, box: JointBox | JointBrakes, dt: float) -> None:
        """A stop from q, v, a (n,) at the end of the step."""
        self._q, self._v, self.dt, self._table = q, v, dt, None
        speeds = v.tolist()
        joints = zip(speeds, a.tolist(), box.acceleration_list, box.change_list, strict=True)
        self._phases = [stop_phases(speed, a_j, limit, change, dt) for speed, a_j, limit, change in joints]
        ways = [travel(phases, speed, dt) for phases, speed in zip(self._phases, speeds, strict=True)]
        self.end = q + ways
        joints = zip(self._phases, speeds, a.tolist(), box.change_list, strict=True)
        self.way = np.array([farthest_way(phases, speed, a_j, change, dt) for phases, speed, a_j, change in joints])
        if self._trapezoid:
            self.end += (0.5 * dt) * v
            # The mean velocities lag by half a step of what the velocity changes: by v at most, and what a adds to it.
            self.way += dt * (np.abs(v) + dt * a * a / np.array(box.change_list))

    @property
    def steps(self) -> int:  # type: ignore[override]
        """Number of steps until the last joint stands."""
        return max([sum([phase[0] for phase in phases]) for phases in self._phases])

    def at(self, step: int) -> Array:
        """Configuration (n,) after so many steps."""
        return self._moved(step)[0]

    def motion(self, steps: Index) -> tuple[Array, Array]:
        """Configurations and velocities (k, n) after so many steps (k,)."""
        found = [self._moved(step) for step in steps.tolist()]
        return np.array([q for q, _ in found]), np.array([v for _, v in found])

    def strongest(self, first: int, last: int) -> Array:
        """See `StopPath.strongest`."""
        counts, begin, change, before = self._tabulated()
        k_0, k_1 = np.maximum(first - before, 0.0), np.minimum(last - before, counts)
        sizes = np.maximum(np.abs(begin + k_0 * change), np.abs(begin + (k_1 - 1.0) * change))
        return np.asarray(np.where(k_0 < k_1, sizes, 0.0).max(axis=1))

    def _moved(self, step: int) -> tuple[Array, Array]:
        """Of each phase k steps are done, with which the sums of `braking.travel` hold."""
        if step == 0:
            return self._q, self._v
        counts, first, change, before = self._tabulated()
        k = np.minimum(np.maximum(step - before, 0.0), counts)
        gained = k * first + 0.5 * change * k * (k - 1.0)
        speed = self._v[:, None] + self.dt * (np.cumsum(gained, axis=1) - gained)
        way = k * speed + self.dt * (0.5 * first * k * (k + 1.0) + change * (k - 1.0) * k * (k + 1.0) / 6.0)
        q = self._q + self.dt * way.sum(axis=1)
        if self._trapezoid:
            q -= (0.5 * self.dt) * (self.dt * gained.sum(axis=1))
        return np.asarray(q), self._v + self.dt * gained.sum(axis=1)

    def _tabulated(self) -> tuple[Array, Array, Array, Array]:
        """Counts, first accelerations, their changes and the steps before each phase, (n, 3) each."""
        if self._table is not None:
            return self._table
        padded = [[*phases, *[(0, 0.0, 0.0)] * (_PHASES - len(phases))] for phases in self._phases]
        table = np.array(padded, dtype=np.float64)
        counts = table[:, :, 0]
        self._table = counts, table[:, :, 1], table[:, :, 2], np.cumsum(counts, axis=1) - counts
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
        self._q, self._v, self.dt = q, v, dt
        self.native = core.StopPath.of(q, v, a, box.acceleration, box.change, dt, self._trapezoid)
        self.end, self.way = self.native.end, self.native.way

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


def make_braking_path(robot: Robot, by_acceleration: bool) -> BrakingPath:
    """The native one where the core is there."""
    return BrakingPath(robot, by_acceleration) if core is None else NativeBrakingPath(robot, by_acceleration)
