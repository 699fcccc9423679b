"""`Problem`: a planning problem as planners and the verifier read it, complete and frozen."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.scene import Scene
from optiplan.robot.robot import Limits, Robot


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

    What is derived from a problem by `with_…` is read and checked as a file is, and has a source and a hash of its own.
    `dataclasses.replace` keeps neither, since they would describe another problem: so planners make parts of problems.

    Attributes:
        vias: to be passed in this order.
        limits: the robot's limits times the fractions asked for.
        source: the validated file as plain data (what `run.json` stores); `hash` is its SHA-256 with that of the robot
            and of every mesh named. Both are empty for problems that were put together by hand.
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
    source: Mapping[str, Any] = field(default_factory=dict, init=False)
    hash: str = field(default="", init=False)
    _reader: "Reader | None" = field(default=None, init=False, repr=False)

    @property
    def one_end(self) -> bool:
        """Whether every motion that solves the problem ends in the same configuration, up to a tolerance.

        Not so for poses, for a choice of ends, and where a joint turns without end and may arrive a turn away.
        """
        endless = np.isinf(self.robot.limits.lower) & np.isinf(self.robot.limits.upper)
        return len(self.goal) == 1 and isinstance(self.goal[0], JointGoal) and not endless.any()

    def identified(self, source: Mapping[str, Any], digest: str, reader: "Reader") -> "Problem":
        """The same problem with what it was read from, the hash of that, and what reads it when it is changed."""
        problem = replace(self)
        for name, value in (("source", source), ("hash", digest), ("_reader", reader)):
            object.__setattr__(problem, name, value)
        return problem

    def with_seed(self, seed: int) -> "Problem":
        """The same problem with another seed, which is recorded beside source and hash and changes neither."""
        other = replace(self, seed=seed)
        return other if self._reader is None else other.identified(self.source, self.hash, self._reader)

    def with_start(self, start: Array) -> "Problem":
        """From another configuration (n,), rad or m.

        Raises:
            InputError: as for a file: it is outside the limits or in collision.
        """
        return self._with(start=start)

    def with_goal(self, *goal: JointGoal | PoseGoal) -> "Problem":
        """To any one of other ends.

        Raises:
            InputError: as for a file: none of them can be reached.
            ValueError: a joint goal with a tolerance that no file can state.
        """
        return self._with(goal=goal)

    def with_vias(self, *vias: Via) -> "Problem":
        """Past other points, or past none.

        Raises:
            InputError: as for a file.
        """
        return self._with(vias=vias)

    def with_scene(self, scene: Scene) -> "Problem":
        """In another scene.

        Raises:
            InputError: as for a file: names that are taken or unknown, a start in collision.
        """
        return self._with(scene=scene)

    def with_limits(self, **fractions: float | str) -> "Problem":
        """With other fractions of the robot's own limits: `velocity`, `acceleration`, `jerk` (or "none"), `torque`.

        What is not given is 1.

        Raises:
            InputError: as for a file: there is no such limit, or the fraction is not in (0, 1].
        """
        return self._with(limits=fractions)

    def _with(self, **changes: Any) -> "Problem":
        if self._reader is not None:
            return self._reader(self, changes)
        fractions = changes.get("limits")
        limits = {} if fractions is None else {"limits": self.robot.limits.scaled(**fractions)}
        return replace(self, **{**changes, **limits})


Reader = Callable[[Problem, Mapping[str, Any]], Problem]
"""Reads a problem again with other `start`, `goal`, `vias`, `scene`, or fractions of `limits`."""
