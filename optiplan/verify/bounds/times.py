"""Least times in which joints pass a configuration on their way from one rest to another."""

from dataclasses import dataclass

import numpy as np

from optiplan.arrays import Array
from optiplan.robot.limits import Limits
from optiplan.trajectory.timing.lower_bound import joint_times


def times_to_turn(distances: Array, limits: Limits) -> Array:
    """Return the least times, s, from rest over distances (..., n) >= 0, rad or m, to speed 0 there: (..., n).

    2 sqrt(d / A) while d <= V^2 / A, and V / A + d / V beyond; without limits of jerk.
    """
    speed, acceleration = limits.velocity, limits.acceleration
    short = 2.0 * np.sqrt(distances / acceleration)
    return np.where(distances <= speed**2 / acceleration, short, speed / acceleration + distances / speed)


SLACK = 2e-6
"""rad or m, by which positions may pass limits here: more than the verifier grants."""


@dataclass(frozen=True)
class Passage:
    """The way from rest at `start` to rest at `goal`, each (n,), rad or m, past a configuration q.

    Both ends count as reached within `tolerance` (n,).

    Each joint needs T1 from the start to q and T2 from q to the goal, whatever its speed at q. All joints are at q at
    one time, so no motion past q is shorter than max_i T1_i + max_i T2_i. A joint whose q is not between its ends turns
    beyond it: with R the time from rest to speed 0, it needs R(start to q) + R(q to goal).
    """

    start: Array
    goal: Array
    limits: Limits
    tolerance: Array

    def box(self, T: float) -> tuple[Array, Array]:
        """Return bounds low and high (n,) of the positions that motions of at most `T`, s, can pass.

        Within the limits of position, and no farther beyond the ends than a joint can turn in that time.
        """
        first, last = np.minimum(self.start, self.goal), np.maximum(self.start, self.goal)
        span = np.maximum(last - first - 2.0 * self.tolerance, 0.0)
        inside, outside = np.zeros(len(first)), T * self.limits.velocity
        for _ in range(60):
            middle = 0.5 * (inside + outside)
            fits = times_to_turn(middle, self.limits) + times_to_turn(middle + span, self.limits) < T
            inside, outside = np.where(fits, middle, inside), np.where(fits, outside, middle)
        beyond = outside + self.tolerance + 1e-9
        low = np.maximum(first - beyond, self.limits.lower - SLACK)
        return low, np.minimum(last + beyond, self.limits.upper + SLACK)

    @property
    def direct(self) -> Array:
        """The least time (n,), s, of every joint from the start to the goal, obstacles left out."""
        span = np.maximum(np.abs(self.goal - self.start) - 2.0 * self.tolerance, 0.0)
        times: Array = joint_times(span[None], self.limits)[0]
        return times
