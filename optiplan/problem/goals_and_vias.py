"""Goals, vias and objective of a problem, as planners and the verifier read them."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.trajectory.state import State
from optiplan.trajectory.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class JointGoal:
    """End at this configuration, q of shape (n,), within `tolerance` (rad or m) of each joint.

    `velocity` (n,), rad/s or m/s, and `acceleration` (n,), rad/s² or m/s², are those at the end of the motion; None:
    at rest.
    """

    q: Array
    tolerance: float = 1e-6
    velocity: Array | None = None
    acceleration: Array | None = None

    @property
    def state(self) -> State:
        """The state of motion at the end."""
        return State(self.q, self.velocity, self.acceleration)

    @property
    def moving(self) -> bool:
        """Whether the motion goes on at the end."""
        return any(rate is not None and np.any(rate) for rate in (self.velocity, self.acceleration))


@dataclass(frozen=True, eq=False)
class PoseGoal:
    """End with `frame` at X_WG: translation error <= `position` (m), rotation angle error <= `orientation` (rad)."""

    frame: str
    X_WG: pin.SE3
    position: float = 1e-4
    orientation: float = 1e-3


Goal = tuple[JointGoal | PoseGoal, ...]
"""Any one of these ends is good."""


@dataclass(frozen=True, eq=False)
class Via:
    """A point to be passed on the way, after those before it: `at`, within its tolerances.

    Attributes:
        at: where; a pose is passed in any configuration that reaches it.
        velocity: (n,) rad/s or m/s, desired velocity.
        time: s from the start, desired time.
    """

    at: JointGoal | PoseGoal
    velocity: Array | None = None
    time: float | None = None


@dataclass(frozen=True)
class Objective:
    """Weights of the cost: time * T + jerk * (integral of squared jerk over the motion).

    Example:
        >>> import optiplan as op
        >>> op.Objective(time=1.0, jerk=1e-6)
        Objective(time=1.0, jerk=1e-06)
    """

    time: float = 1.0
    jerk: float = 0.0

    def cost(self, trajectory: Trajectory) -> float:
        """Return the value for a motion, s."""
        jerk = self.jerk * trajectory.squared_jerk() if self.jerk else 0.0
        return self.time * trajectory.duration + jerk
