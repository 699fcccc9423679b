"""Where joints can be at any time of a motion from one rest to another."""

from dataclasses import replace

import numpy as np

from optiplan.arrays import Array
from optiplan.records import dataclass
from optiplan.robot.limits import Limits
from optiplan.trajectory.timing.lower_bound import joint_times

SLACK = 2e-6
"""rad or m, by which positions may pass limits here: more than the verifier grants."""

STEPS = 128
"""Of the time of a motion, for each of which it is known where the joints can be."""

WINDOWS = np.geomspace(1e-3, 1.0, 40)
"""Shares of half the time of a motion, over which it is smoothed: the best of them counts."""


@dataclass(frozen=True)
class Corridor:
    """Where each joint can be in each of K equal steps of the time of a motion.

    Attributes:
        low, high: positions (n, K), rad or m.
    """

    low: Array
    high: Array

    def box(self) -> tuple[Array, Array]:
        """Return bounds low and high (n,) of the positions at any time."""
        return self.low.min(axis=1), self.high.max(axis=1)


@dataclass(frozen=True)
class Passage:
    """The way from rest at `start` to rest at `goal`, each (n,), rad or m.

    Both ends count as reached within `tolerance` (n,). At each end, and in all steps on the way together, the share
    `loose` of the greatest speed and, with a limit of jerk, of the greatest acceleration counts as none.
    """

    start: Array
    goal: Array
    limits: Limits
    tolerance: Array
    loose: float = 0.0

    def corridor(self, T: float) -> Corridor:
        """Return where each joint can be while it goes from start to goal in T, s; limits of jerk are left out.

        A joint that is at x with speed v at time t has come from the start in t, and goes to the goal in T - t. So with
        P(t, v) the farthest that it gets from rest in t to the speed v, x <= max_v min(start + P(t, v), goal + P(T - t,
        -v)). P grows with v and with t: for a step, t is its end in the first and its beginning in the second.
        """
        high = self._highest(T, self.start, self.goal)
        low = -self._highest(T, -self.start, -self.goal)
        lower, upper = self.limits.lower - SLACK, self.limits.upper + SLACK
        return Corridor(np.maximum(low - 1e-9, lower[:, None]), np.minimum(high + 1e-9, upper[:, None]))

    def _highest(self, T: float, start: Array, goal: Array) -> Array:
        """The highest positions (n, K), by halving the interval of speeds where the two terms are equal."""
        speed, acceleration = self.limits.velocity[:, None], self.limits.acceleration[:, None]
        begin = T * np.arange(STEPS) / STEPS
        came, goes = begin + T / STEPS, T - begin
        most = np.minimum(speed, acceleration * np.minimum(came, goes))
        start, goal = (start + self.tolerance)[:, None], (goal + self.tolerance)[:, None]
        slow, fast = -most, most
        for _ in range(50):
            v = 0.5 * (slow + fast)
            late = goal + _farthest(goes, -v, speed, acceleration) < start + _farthest(came, v, speed, acceleration)
            slow, fast = np.where(late, slow, v), np.where(late, v, fast)
        highest: Array = np.minimum(
            start + _farthest(came, fast, speed, acceleration), goal + _farthest(goes, -slow, speed, acceleration)
        )
        return highest

    @property
    def direct(self) -> Array:
        """The least time (n,), s, of every joint from the start to the goal, obstacles left out.

        Without limits of jerk, or with them and `_smoothed` over some time: each is proved.
        """
        span = np.maximum(np.abs(self.goal - self.start) - 2.0 * self.tolerance, 0.0)
        times: Array = joint_times(span[None], self.limits.scaled(jerk="none"))[0]
        if np.isinf(self.limits.jerk).all():
            return times
        longest = 0.5 * joint_times(span[None], self.limits)[0]
        smoothed = np.stack([self._smoothed(span, share * longest) for share in WINDOWS]).max(axis=0)
        best: Array = np.where(np.isinf(self.limits.jerk), times, np.maximum(times, smoothed))
        return best

    def _smoothed(self, span: Array, w: Array) -> Array:
        """The least times (n,), s, over distances `span`, with limits of jerk; w (n,), s, is any time.

        With e for `loose`, a motion of 2 w or longer is made one from rest to rest without steps by adding terms of the
        length w. One against a step d of speed has a speed up to d, an acceleration up to 1.5 d / w, a jerk up to
        6 d / w^2 and a way of d w / 2; one against a step d of acceleration has d 4 w / 27, d, 4 d / w and d w^2 / 12.
        There are 3 e times the limit of each in all. So the motion takes 2 w, or what the sums of limits allow.
        """
        limits, steps = self.limits, 3.0 * self.loose
        V, A, J = limits.rates
        w = np.maximum(w, 1e-12)
        wider = replace(
            limits,
            velocity=V + steps * (V + 4.0 / 27.0 * w * A),
            acceleration=A + steps * (A + 1.5 * V / w),
            jerk=J + steps * (6.0 * V / w**2 + 4.0 * A / w),
        )
        way = np.maximum(span - steps * (0.5 * V * w + A * w**2 / 12.0), 0.0)
        least: Array = np.minimum(2.0 * w, joint_times(way[None], wider)[0])
        return least


def _farthest(t: Array, v: Array, speed: Array, acceleration: Array) -> Array:
    """The farthest that joints get from rest within t, s, if they have the speed v, |v| <= acceleration t, then.

    They speed up to w = (acceleration t + v) / 2, or the greatest speed, and slow down to v.
    """
    w = np.minimum(0.5 * (acceleration * t + v), speed)
    cruise = np.maximum(t - (2.0 * w - v) / acceleration, 0.0)
    farthest: Array = (2.0 * w**2 - v**2) / (2.0 * acceleration) + speed * cruise
    return farthest
