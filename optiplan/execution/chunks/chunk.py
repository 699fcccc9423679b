"""`Chunk`: what became of a chunk of set-points, and the motion to send."""

from collections.abc import Mapping
from dataclasses import field, replace
from typing import Literal

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, number_argument
from optiplan.errors import wrong_argument
from optiplan.geometry.scene import Scene
from optiplan.problem.goals_and_vias import JointGoal
from optiplan.problem.problem import Problem, derived
from optiplan.records import dataclass
from optiplan.trajectory.joining import cut_trajectory, standstill
from optiplan.trajectory.state import State
from optiplan.trajectory.trajectory import Trajectory

Outcome = Literal["proved", "nearest", "stopped", "refused"]

_SHORTEST = 1e-6
"""s: the rest of a motion is no shorter."""


@dataclass(frozen=True, eq=False, repr=False)
class Chunk:
    """Result of `op.certify`.

    Attributes:
        outcome: `proved` as it is; `nearest`: with set-points changed as little as the proof needs; `stopped`: the
            robot stops, after `reached` set-points of the chunk as it is; `refused`: not even a stop is proved.
        trajectory: the motion to send, from where the robot is to rest; None if refused.
        until: at which time of it the chunk ends and the stop begins, s.
        reached: how many set-points it reaches, each at its time.
        times: (k,) s, of the set-points; found where none were given; empty where there are none.
        set_points: (k, n), rad or m: those of the motion for `proved` and `nearest`, else the ones that were given.
        change: (k,) joint metric |x_i - q_i| between the set-points x of the motion and the ones given, q: the
            Euclidean norm over the joints, rad or m; zeros but for `nearest`.
        reason: why it is not proved as it is; empty where it is. Names the pair of bodies, the joint and its limit, or
            the set-point by index.
        clearance: proved of all pairs of the robot's own bodies, and of those with an obstacle, m.
        scope: what the proof is about, in short statements.
    """

    outcome: Outcome
    trajectory: Trajectory | None
    until: float
    reached: int
    times: Array
    set_points: Array
    change: Array
    reason: str
    clearance: tuple[float, float]
    scope: tuple[str, ...]
    _problem: Problem = field(kw_only=True)
    _poses: Mapping[str, pin.SE3] = field(kw_only=True, default_factory=dict)

    @property
    def is_proved(self) -> bool:
        """Whether there is a motion to send."""
        return self.trajectory is not None

    @property
    def max_change(self) -> float:
        """Largest change of a set-point in the joint metric, rad or m."""
        return float(self.change.max(initial=0.0))

    @property
    def rms_change(self) -> float:
        """Root mean square of the changes of all set-points in the joint metric, rad or m."""
        return float(np.sqrt(np.mean(self.change**2))) if len(self.change) else 0.0

    @property
    def problem(self) -> Problem:
        """The problem that the motion solves, with obstacles as they were placed: for `op.verify`.

        Raises:
            InputError: the chunk was refused.
        """
        motion = self._motion("problem")
        first = motion.state(0.0)
        places = [
            replace(one, X_WO=self._poses[one.name], stated=None) if one.name in self._poses else one
            for one in self._problem.scene.obstacles
        ]
        scene = Scene(places, self._problem.scene.attached, self._problem.scene.allowed)
        start = {"start": first.q, "start_velocity": first.v, "start_acceleration": first.a}
        return derived(self._problem, **start, goal=(JointGoal(motion.end),), vias=(), scene=scene)

    def rest(self, t: float) -> Trajectory:
        """Return the rest of the motion from a time t of it on, s: the `start` of the next chunk.

        After its end the robot stands.

        Raises:
            InputError: the chunk was refused, or t is no number >= 0.
        """
        motion = self._motion("rest")
        t = number_argument("Chunk.rest", "t", t, "a time >= 0, s", 0.0)
        if t >= motion.duration - _SHORTEST:
            return standstill(motion.joint_names, motion.end, _SHORTEST)
        return cut_trajectory(motion, t, motion.duration)

    def state(self, t: float) -> State:
        """Return the state of the robot at a time t of the motion, s; after its end it stands.

        Raises:
            InputError: the chunk was refused, or t is no number >= 0.
        """
        motion = self._motion("state")
        return motion.state(min(number_argument("Chunk.state", "t", t, "a time >= 0, s", 0.0), motion.duration))

    def _motion(self, what: str) -> Trajectory:
        if self.trajectory is None:
            raise wrong_argument(f"Chunk.{what}", "chunk", f"a refused one ({self.reason})", "one with a motion")
        return self.trajectory

    def __repr__(self) -> str:
        """Outcome, change or reason in one line."""
        if self.outcome == "proved":
            return f"Chunk: proved as it is, {len(self.set_points)} set-points, {self.until:.3f} s"
        changed = f", changed by {self.max_change:.3g} at most" if self.outcome == "nearest" else ""
        return f"Chunk: {self.outcome}{changed}: {self.reason}"
