"""`Problem`: a planning problem as planners and the verifier read it, complete and frozen."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import pinocchio as pin

from optiplan.arrays import Array
from optiplan.model.robot import Limits, Robot
from optiplan.model.scene import Scene


@dataclass(frozen=True, eq=False)
class JointGoal:
    """End at this configuration, q of shape (n,), within `tolerance` (rad or m) of each joint."""

    q: Array
    tolerance: float = 1e-6


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
        velocity: (n,) rad/s or m/s, a wish: with what velocity.
        time: s from the start, a wish: when.
    """

    at: JointGoal | PoseGoal
    velocity: Array | None = None
    time: float | None = None


@dataclass(frozen=True)
class Objective:
    """Weights of the cost: time * T + jerk * (integral of squared jerk over the motion)."""

    time: float = 1.0
    jerk: float = 0.0


@dataclass(frozen=True, eq=False)
class Problem:
    """Everything a planner needs; same Problem, options and seed give the same result.

    Attributes:
        vias: to be passed in this order.
        limits: the robot's limits times the fractions asked for.
        source: the validated file as plain data (what `run.json` stores); `hash` is its SHA-256 with that of the robot
            and of every mesh named.
    """

    name: str
    robot: Robot
    scene: Scene
    start: Array
    goal: Goal
    limits: Limits
    vias: tuple[Via, ...] = ()
    objective: Objective = Objective()
    planner: str = "trajopt"
    options: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0
    source: Mapping[str, Any] = field(default_factory=dict)
    hash: str = ""
