"""`BrakingPath`: the configurations that a robot passes if it brakes from the end of this step on."""

import numpy as np

from optiplan.arrays import Array
from optiplan.control.braking import Phase, speed_after, stop_phases, stop_travel, travel
from optiplan.control.configuration import Configuration
from optiplan.control.limits.joint_box import JointBox
from optiplan.control.limits.stop_limits import StopPath
from optiplan.robot.robot import Robot


class BrakingPath(StopPath):
    """A stop of all joints, each as quick as its limits let it; one object is moved from candidate to candidate.

    Args:
        robot: the robot.
        by_acceleration: whether positions follow the mean of the velocities of both ends of a step, or the new one.
    """

    def __init__(self, robot: Robot, by_acceleration: bool) -> None:
        self._trapezoid = by_acceleration
        self._configuration = Configuration(robot)
        self.end = np.zeros(robot.n)

    def start(self, q: Array, v: Array, a: Array, box: JointBox, dt: float) -> None:
        """A stop from q, v, a (n,) at the end of the step."""
        self._q, self._v, self._a, self._dt = q, v, a, dt
        self._limits = box.acceleration.tolist(), box.change.tolist()
        joints = zip(v.tolist(), a.tolist(), *self._limits, strict=True)
        self.end = q + [stop_travel(*joint, dt) for joint in joints]
        if self._trapezoid:
            self.end = self.end + (0.5 * dt) * v
        self._phases: list[tuple[Phase, ...]] | None = None

    @property
    def phases(self) -> list[tuple[Phase, ...]]:
        """Those of each joint."""
        if self._phases is None:
            joints = zip(self._v.tolist(), self._a.tolist(), *self._limits, strict=True)
            self._phases = [stop_phases(*joint, self._dt) for joint in joints]
        return self._phases

    @property
    def steps(self) -> int:  # type: ignore[override]
        """Number of steps until the last joint stands."""
        return max(sum(phase.count for phase in phases) for phases in self.phases)

    def at(self, step: int) -> Array:
        """Configuration (n,) after so many steps."""
        if step == 0:
            return self._q
        both = list(zip(self.phases, self._v.tolist(), strict=True))
        q = self._q + [travel(phases, v, self._dt, step) for phases, v in both]
        if self._trapezoid:
            left = np.array([speed_after(phases, v, self._dt, step) for phases, v in both])
            q = q + (0.5 * self._dt) * (self._v - left)
        return np.asarray(q)

    def configuration(self, step: int) -> Configuration:
        """Kinematics after so many steps."""
        self._configuration.update(self.at(step), self._v)
        return self._configuration

    def travel(self, first: int, last: int) -> Array:
        """How far each joint moves between two steps, (n,): a stop goes one way but for a joint that over-braked."""
        return np.abs(self.at(last) - self.at(first))
