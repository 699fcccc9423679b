"""What a closed loop is to follow: positions of the joints, or poses of a frame, each with its rates."""

from typing import Protocol, runtime_checkable

import pinocchio as pin

from optiplan.arrays import Array
from optiplan.records import dataclass


@dataclass(frozen=True, eq=False, slots=True)
class JointTargets:
    """Joints at K instants: `q`, `v`, `a`, each (K, n), rad (m) and its rates.

    `torque` is (K, n), N·m (N), of a reference that knows it: feed-forward of the rigid bodies with their loads.
    """

    q: Array
    v: Array
    a: Array
    torque: Array | None = None


@dataclass(frozen=True, eq=False, slots=True)
class ToolTarget:
    """A pose X_WF with its rates.

    Attributes:
        X_WF: pose of the frame.
        twist: (6,) [v; w], m/s of the frame's origin and rad/s, along the axes of the world.
        acceleration: (6,) its rate, m/s² and rad/s².
    """

    X_WF: pin.SE3
    twist: Array
    acceleration: Array


@runtime_checkable
class JointReference(Protocol):
    """A motion of the joints; after `duration`, s, it stands at its end."""

    @property
    def duration(self) -> float:
        """Length in time, s."""

    def sample(self, t: Array) -> JointTargets:
        """Targets at times t (K,), s."""


@runtime_checkable
class ToolReference(Protocol):
    """A motion of a frame; after `duration`, s, it stands at its end."""

    @property
    def frame(self) -> str:
        """Name of the frame."""

    @property
    def duration(self) -> float:
        """Length in time, s."""

    def at(self, t: float) -> ToolTarget:
        """Target at time t, s."""


Reference = JointReference | ToolReference
