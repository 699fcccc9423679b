"""Goals and vias of a problem, as planners and the verifier read them: nobody writes into what the hash is about."""

from typing import TypeAlias

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, ReadOnlyArrays
from optiplan.geometry.poses import ReadOnlyPoses
from optiplan.problem.regions.region import RegionGoal
from optiplan.records import dataclass
from optiplan.trajectory.state import State


@dataclass(frozen=True, eq=False)
class JointGoal(ReadOnlyArrays):
    """End at this configuration, q of shape (n,), within `tolerance` (rad or m) of each joint.

    `velocity` (n,), rad/s or m/s, and `acceleration` (n,), rad/s² or m/s², are those at the end of the motion; None:
    at rest. For `op.Problem` they may be `{joint: value}`; a problem has arrays.
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
class ExactGoal(JointGoal):
    """A configuration to end at exactly: joints without limits may not arrive a whole turn away."""


@dataclass(frozen=True, eq=False)
class PoseGoal(ReadOnlyPoses):
    """End with `frame` at X_WG: translation error <= `position` (m), rotation angle error <= `orientation` (rad)."""

    frame: str
    X_WG: pin.SE3
    position: float = 1e-4
    orientation: float = 1e-3


@dataclass(frozen=True, eq=False)
class AllOfGoal:
    """End with several frames in their places at once: each of `parts` holds."""

    parts: tuple[PoseGoal | RegionGoal, ...]


def parts_of(goal: PoseGoal | RegionGoal | AllOfGoal) -> tuple[PoseGoal | RegionGoal, ...]:
    """Return the poses and regions that a goal holds at once."""
    return goal.parts if isinstance(goal, AllOfGoal) else (goal,)


GoalEnd: TypeAlias = JointGoal | PoseGoal | RegionGoal | AllOfGoal
"""One end of a motion: a configuration, a pose, any of a region of poses, or several of these frames at once."""

Goal = tuple[GoalEnd, ...]
"""Any one of these ends is good."""


@dataclass(frozen=True, eq=False)
class Via(ReadOnlyArrays):
    """A point to be passed on the way, after those before it: `at`, within its tolerances.

    Attributes:
        at: where; a pose is passed in any configuration that reaches it.
        velocity: (n,) rad/s or m/s, desired velocity.
        time: s from the start, desired time.
    """

    at: JointGoal | PoseGoal
    velocity: Array | None = None
    time: float | None = None

    @property
    def goal(self) -> tuple[JointGoal | PoseGoal]:
        """The goal of a motion that ends at the via."""
        at = self.at
        return (ExactGoal(at.q, at.tolerance) if isinstance(at, JointGoal) else at,)
