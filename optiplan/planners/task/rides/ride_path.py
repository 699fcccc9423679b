"""The way of a tool that goes with what moves: X(t) = M(t) Y(t), with lines and rests Y(t) as they are seen from there.

Along a line, Y goes from rest to rest: s(u) = 10 u³ - 15 u⁴ + 6 u⁵, u the share of its time.
"""

from bisect import bisect_right
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.obstacle_motion import SLIDES, ObstacleMotion
from optiplan.planners.cartesian.tool_path import ToolPath
from optiplan.records import dataclass
from optiplan.trajectory.profiles.laws import quintic_at

PEAK_SPEED, PEAK_ACCELERATION = 1.875, 5.774
"""Of s(u) for a way of 1 in a time of 1."""


@dataclass(frozen=True, eq=False)
class RideSection:
    """A line or a rest, as it is seen from what moves, and how long it takes, s."""

    path: ToolPath
    duration: float


class RidePath:
    """A path over s = (t - begin) / duration, of a tool that goes through sections one after another."""

    def __init__(self, motion: ObstacleMotion, begin: float, sections: Sequence[RideSection]) -> None:
        self.motion, self.begin, self.sections = motion, begin, tuple(sections)
        self.edges = np.concatenate([[0.0], np.cumsum([one.duration for one in sections])]).tolist()
        self.duration = float(self.edges[-1])

    def pose(self, s: float) -> pin.SE3:
        """X_WF(s)."""
        return self.motion.pose(self.begin + s * self.duration) * self._seen(s)[0]

    def twist(self, s: float) -> Array:
        """dX/ds (6,), in world axes."""
        return self._rates(s)[0] * self.duration

    def twist_rate(self, s: float) -> Array:
        """d/ds of `twist`, (6,)."""
        return self._rates(s)[1] * self.duration**2

    def _seen(self, s: float) -> tuple[pin.SE3, Array, Array]:
        """Return Y, and its twist and the rate of that, per second and second²."""
        t = s * self.duration
        k = min(max(bisect_right(self.edges, t) - 1, 0), len(self.sections) - 1)
        one = self.sections[k]
        u = min(max((t - self.edges[k]) / one.duration, 0.0), 1.0)
        law = quintic_at(u)
        rate, change = law.rate / one.duration, law.change / one.duration**2
        twist = one.path.twist(law.s)
        return one.path.pose(law.s), rate * twist, change * twist + rate**2 * one.path.twist_rate(law.s)

    def _rates(self, s: float) -> tuple[Array, Array]:
        """Return the twist, m/s and rad/s, and its rate, of M Y: that of M, the turned one of Y, and Coriolis' part."""
        Y, y, dy = self._seen(s)
        t = self.begin + s * self.duration
        rows = [self.motion.at(np.array([t]), order)[0] for order in range(3)]
        if self.motion.axis is None or self.motion.point is None:
            return np.append(rows[1], np.zeros(3)) + y, np.append(rows[2], np.zeros(3)) + dy
        R = pin.exp3(rows[0][SLIDES] * self.motion.axis)
        w, dw = rows[1][SLIDES] * self.motion.axis, rows[2][SLIDES] * self.motion.axis
        arm, v, turning = R @ (Y.translation - self.motion.point), R @ y[:3], R @ y[3:]
        linear = rows[1][:SLIDES] + np.cross(w, arm) + v
        change = (
            rows[2][:SLIDES] + np.cross(dw, arm) + np.cross(w, np.cross(w, arm)) + 2.0 * np.cross(w, v) + R @ dy[:3]
        )
        return (
            np.concatenate([linear, w + turning]),
            np.concatenate([change, dw + np.cross(w, turning) + R @ dy[3:]]),
        )
