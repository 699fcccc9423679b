"""`Measurement`: what a driver measured of a robot, and how old it is."""

from optiplan.arrays import Array
from optiplan.records import dataclass


@dataclass(frozen=True, eq=False)
class Measurement:
    """The newest state of a robot that its driver knows.

    Attributes:
        q: (n,) positions in the robot's order, rad or m.
        v: (n,) velocities, rad/s or m/s.
        stamp: time of the measurement by the driver's clock, s; it must not run backwards.
        age: time since the measurement at the moment when it was asked for, s, with what the driver knows of delays.
    """

    q: Array
    v: Array
    stamp: float
    age: float = 0.0
