"""The four calls of every driver."""

from typing import Literal, Protocol

from optiplan.arrays import number_argument
from optiplan.errors import OptiPlanError, described, flag_argument, text_argument, wrong_argument
from optiplan.execution.measurement import Measurement
from optiplan.execution.status import Tick
from optiplan.records import dataclass

Quantity = Literal["position", "velocity", "torque"]
"""What a driver takes of a set-point."""

MOST_LATENCY, MOST_LEAD = 10.0, 3.0
"""s: of a driver at most; between samples of a longer way ahead a robot would leave the path."""


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
        waits: whether nothing moves between two set-points, so that they may be as late as they like.
        tried_on_hardware: whether it has moved a real robot.

    Raises:
        InputError: names, a rate, times or truth values that cannot be.
    """

    name: str
    joint_names: tuple[str, ...]
    rate: float
    takes: tuple[Quantity, ...] = ("position",)
    measures: bool = False
    latency: float = 0.0
    lead: float = 0.0
    waits: bool = False
    tried_on_hardware: bool = False

    def __post_init__(self) -> None:
        """Check the values: a driver may be anybody's."""
        if self.name is None:
            raise wrong_argument("Capabilities", "name", "None", "text")
        text_argument("Capabilities", "name", self.name, "text")
        names = self.joint_names
        if not isinstance(names, tuple | list) or not all(isinstance(one, str) for one in names):
            raise wrong_argument("Capabilities", "joint_names", described(names), "names of joints")
        number_argument("Capabilities", "rate", self.rate, "a finite number > 0, Hz", above=0.0)
        for key, most in (("latency", MOST_LATENCY), ("lead", MOST_LEAD)):
            number_argument("Capabilities", key, getattr(self, key), f"0 to {most:g} s", 0.0, most=most)
        for key in ("measures", "waits", "tried_on_hardware"):
            flag_argument("Capabilities", key, getattr(self, key))


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
