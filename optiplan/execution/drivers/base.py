"""The four calls of every driver."""

from dataclasses import dataclass
from typing import Literal, Protocol

from optiplan.errors import OptiPlanError
from optiplan.execution.measurement import Measurement
from optiplan.execution.status import Tick

Quantity = Literal["position", "velocity", "torque"]
"""What a driver takes of a set-point."""


class DriverError(OptiPlanError):
    """A robot or its controller that cannot be reached, refuses, or has stopped by itself."""


@dataclass(frozen=True)
class Capabilities:
    """What a driver can do.

    Attributes:
        name: of the driver.
        joint_names: of the robot, in the order of its set-points and states.
        rate: set-points per second, Hz.
        takes: what it uses of a set-point.
        measures: whether it has states of the robot.
        latency: time from `send` until the robot follows, s.
        lead: 0: the robot gets single set-points. Above: without further set-points it goes on for this time, s, and
            then stops along the path, by itself; `Tick.ahead` has that way.
        tried_on_hardware: whether it has moved a real robot.
    """

    name: str
    joint_names: tuple[str, ...]
    rate: float
    takes: tuple[Quantity, ...] = ("position",)
    measures: bool = False
    latency: float = 0.0
    lead: float = 0.0
    tried_on_hardware: bool = False


class Driver(Protocol):
    """What moves a robot, or stands for one.

    `Execution` calls all four from its own thread, `stop` also from another where `send` does not return. Each may
    raise: the execution ends, and the exception's text is its reason.
    """

    def capabilities(self) -> Capabilities:
        """Return what the driver can do; the same at every call."""

    def state(self) -> Measurement | None:
        """Return the newest state of the robot, without waiting for one; None where there is none yet."""

    def send(self, tick: Tick) -> None:
        """Hand over a set-point, without waiting until the robot is there."""

    def stop(self, reason: str) -> None:
        """Let the robot stand still as fast as its own controller can, and let go of it; once more does nothing."""
