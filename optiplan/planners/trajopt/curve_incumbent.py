"""The incumbent of the optimiser: the best motion, and the curve that refining and bumps begin with."""

from typing import Any

import numpy as np

from optiplan.planners.common.incumbent import Incumbent
from optiplan.planners.path_constraints.motion_check import PathConstraints
from optiplan.planners.trajopt.optimizer import Attempt
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory


@dataclass(eq=False, kw_only=True)
class CurveIncumbent(Incumbent):
    """The best motion of a search that optimises curves.

    Attributes:
        constraints: on its path.
        info: record of the run; says in `fallback` that the best motion was not optimised.
        curve: the best optimised one, as it was before it was refined; None where there is none.
        bound: on the cost of all motions, once the goals are known.
    """

    constraints: PathConstraints
    info: dict[str, Any]
    curve: Attempt | None = None
    bound: float = 0.0

    def cost_bound(self, duration: float) -> float:
        """Return a lower bound on the cost of motions of at least this duration, s."""
        return self.problem.objective.time * duration

    @property
    def longest(self) -> float:
        """Return the duration, s, from which on a motion costs more than the best one; infinite without one."""
        time = self.problem.objective.time
        return self.cost / time if time > 0.0 else np.inf

    def bounded(self, soonest: float) -> None:
        """Take a lower bound on the durations of all motions, s."""
        self.bound, self.soonest = self.cost_bound(soonest), soonest

    @property
    def rough(self) -> float:
        """Return the cost of the best curve before it was refined; infinite without one."""
        return np.inf if self.curve is None else self.cost_of(self.curve.trajectory)

    def offer(self, trajectory: Trajectory, *, holds: bool = False) -> bool:
        """Keep a free motion if it is better than the best and holds all path constraints; return whether it is.

        Args:
            trajectory: the motion.
            holds: whether it is known to hold them.
        """
        if not holds:
            trajectory = self.constraints.slowed(trajectory)
            if not self.improves(trajectory) or self.constraints.broken(trajectory):
                return False
        if not super().offer(trajectory):
            return False
        self.info.pop("fallback", None)
        return True

    def offer_curve(self, attempt: Attempt) -> bool:
        """Offer a free curve that is not refined; return whether it is the best of them."""
        self.offer(attempt.trajectory, holds=True)
        if self.cost_of(attempt.trajectory) <= self.rough:
            self.curve = attempt
        return self.curve is attempt

    def offer_first(self, attempt: Attempt) -> None:
        """Keep a curve that is free but not short yet while there is no other curve."""
        if self.curve is None:
            self.offer_curve(attempt)

    def is_best(self, attempt: Attempt) -> bool:
        """Return whether the best motion is that of this attempt."""
        return attempt.trajectory is self.best

    def within(self, factor: float) -> bool:
        """Return whether the best motion costs at most this factor of the bound."""
        return self.cost <= factor * self.bound
