"""References of the joints: any trajectory, and a step."""

import numpy as np

from optiplan.arrays import Array
from optiplan.records import dataclass
from optiplan.simulation.references.base import JointTargets
from optiplan.trajectory.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class TrajectoryReference:
    """Follow a trajectory; before and after it, its ends."""

    trajectory: Trajectory

    @property
    def duration(self) -> float:
        """That of the trajectory, s."""
        return self.trajectory.duration

    def sample(self, t: Array) -> JointTargets:
        """Targets at times t (K,), s."""
        q, v, a = (self.trajectory(t, order, clamp=True) for order in range(3))
        return JointTargets(q, v, a)


@dataclass(frozen=True, eq=False)
class StepReference:
    """Stand at q = `start` until t = `at`, then ask for `end`, with no rates: the step of a step response.

    Attributes:
        start: (n,), rad or m; `end`: (n,).
        at: s.
        duration: s, with the time to settle.
    """

    start: Array
    end: Array
    at: float
    duration: float

    def sample(self, t: Array) -> JointTargets:
        """Targets at times t (K,), s."""
        q = np.where((t >= self.at)[:, None], self.end, self.start)
        return JointTargets(q, np.zeros_like(q), np.zeros_like(q))
