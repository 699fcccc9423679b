"""Straight lines with parabolic blends: each joint runs at constant velocities and changes them at constant rates.

Source: Craig, Introduction to Robotics, section 7.3, equations 7.24 to 7.31, pseudo-via points included.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from optiplan.arrays import Array, distinct
from optiplan.records import dataclass
from optiplan.trajectory.paths.via_splines import heuristic_velocities
from optiplan.trajectory.tolerances import LIMIT_ROUNDING, SAME_TIME
from optiplan.trajectory.trajectory import Trajectory

_ROUNDED_TIME = 1e-15  # share of the duration by which rounding sets equal times apart


@dataclass(frozen=True, eq=False)
class Blends:
    """Velocity changes at points (k, n) at times (k,).

    Attributes:
        times: (k,), s.
        durations: (k, n) t_i, s, of the blends; NaN where no blend is strong enough. Those at the ends lie within the
            motion, the others halfway before and after their point.
        accelerations: (k, n) a_i, rad/s² or m/s².
    """

    times: Array
    durations: Array
    accelerations: Array

    @property
    def linear(self) -> Array:
        """(k - 1, n) s left for constant velocity between two blends; negative where they overlap."""
        before, after = 0.5 * self.durations[:-1], 0.5 * self.durations[1:]
        before[0] *= 2.0
        after[-1] *= 2.0
        return np.asarray(np.diff(self.times)[:, None] - before - after)

    @property
    def miss(self) -> Array:
        """(k, n) |a_i| t_i^2 / 8: how far an inner point is missed, rad or m; 0 at the ends."""
        miss = np.abs(self.accelerations) * self.durations**2 / 8.0
        miss[[0, -1]] = 0.0
        return np.asarray(miss)

    def keeps(self, velocity: Array, acceleration: Array) -> bool:
        """Whether no joint is faster than its limit velocity (n,) or acceleration (n,), and no blends overlap."""
        v = np.cumsum(self.accelerations * self.durations, axis=0)
        slow = bool((np.abs(v) <= velocity * (1.0 + LIMIT_ROUNDING)).all())  # NaN is not
        return slow and bool(
            (np.abs(self.accelerations) <= acceleration * (1.0 + LIMIT_ROUNDING)).all() and not self.overlap()
        )

    def overlap(self) -> "Overlap | None":
        """Return where blends overlap most; None where all fit."""
        lacking = np.where(np.isnan(self.linear), np.inf, -self.linear)
        i, j = np.unravel_index(int(lacking.argmax()), lacking.shape)
        return Overlap(int(i), int(j), float(lacking[i, j])) if lacking[i, j] > SAME_TIME * self.times[-1] else None


class Overlap(NamedTuple):
    """Two blends of a joint that do not fit into the segment between them: `seconds` are missing."""

    segment: int
    joint: int
    seconds: float


def blends_by_acceleration(points: Array, times: Array, acceleration: Array) -> Blends:
    """Blends with |a_i| = acceleration (n,), for points (k, n) at times (k,).

    Let h be the time and d the way of the first segment: t_0 = h - sqrt(h^2 - 2 |d| / a) and v = d / (h - t_0 / 2). The
    last is its mirror image. With one segment, t_0 = (h - sqrt(h^2 - 4 |d| / a)) / 2. Inner blends last
    t_i = |v_i - v_i-1| / a.
    """
    h, d = np.diff(times)[:, None], np.diff(points, axis=0)
    durations = np.zeros_like(points)
    with np.errstate(invalid="ignore"):
        if len(d) == 1:
            durations[[0, -1]] = 0.5 * (h - np.sqrt(h**2 - 4.0 * np.abs(d) / acceleration))
        else:
            durations[[0, -1]] = (h - np.sqrt(h**2 - 2.0 * np.abs(d) / acceleration))[[0, -1]]
    change = _changes(h, d, durations[[0, -1]])
    durations[1:-1] = np.abs(change[1:-1]) / acceleration
    return Blends(times, durations, np.sign(change) * acceleration)


def blends_by_time(points: Array, times: Array, blend_time: float) -> Blends:
    """Blends of one duration (s), all joints together: a_i = (v_i - v_i-1) / blend_time."""
    durations = np.full_like(points, blend_time)
    change = _changes(np.diff(times)[:, None], np.diff(points, axis=0), durations[[0, -1]])
    return Blends(times, durations, change / blend_time)


def with_pseudo_vias(points: Array, times: Array, hit: npt.NDArray[np.bool_], share: float) -> tuple[Array, Array]:
    """Points and times with two pseudo-via points beside each via that is to be hit.

    They lie on the line q_i + v_i (t - t_i) through the via, v_i from `heuristic_velocities`. Their distance in time is
    `share` of the shorter neighbouring segment, before and after it. If their blends end before the via, it is hit.

    Args:
        points: (k, n), rad or m.
        times: (k,), s.
        hit: (k,) whether; the first and the last always are, and get none.
        share: below 1 / 2.
    """
    velocities, h = heuristic_velocities(points, times), np.diff(times)
    new_points, new_times = [points[0]], [times[0]]
    for i in range(1, len(points) - 1):
        aside = share * min(h[i - 1], h[i]) if hit[i] else 0.0
        for offset in (-aside, 0.0, aside) if hit[i] else (0.0,):
            new_points.append(points[i] + velocities[i] * offset)
            new_times.append(times[i] + offset)
    return np.array([*new_points, points[-1]]), np.array([*new_times, times[-1]])


def run_blends(start: Array, blends: Blends, joint_names: tuple[str, ...]) -> Trajectory:
    """The motion from start (n,), at rest, through blends that do not overlap: acceleration is integrated twice."""
    T, half = blends.times[-1], 0.5 * blends.durations
    begin, end = blends.times[:, None] - half, blends.times[:, None] + half
    begin[0], end[0] = 0.0, 2.0 * half[0]
    begin[-1], end[-1] = T - 2.0 * half[-1], T
    edges = distinct(np.concatenate([[0.0, T], np.clip(np.append(begin, end), 0.0, T)]))
    edges = edges[np.concatenate([[True], np.diff(edges) > _ROUNDED_TIME * T])]  # no more: a brief blend is a motion
    edges[-1] = T
    middle = 0.5 * (edges[1:] + edges[:-1])[:, None, None]
    a = np.where((begin < middle) & (middle < end), blends.accelerations, 0.0).sum(axis=1)  # (m, n)
    h = np.diff(edges)[:, None]
    v = np.vstack([np.zeros_like(start), np.cumsum(a * h, axis=0)[:-1]])
    q = np.vstack([start, start + np.cumsum(v * h + 0.5 * a * h**2, axis=0)[:-1]])
    return Trajectory(joint_names, edges, np.stack([q, v, 0.5 * a], axis=1))


def _changes(h: Array, d: Array, ends: Array) -> Array:
    """(k, n) changes of velocity at the points: from rest, between segments h (k - 1, 1), d (k - 1, n), to rest.

    `ends` (2, n) are the durations of the first and the last blend, s.
    """
    lost = np.zeros_like(d)  # of a segment's time, s
    lost[0] += 0.5 * ends[0]
    lost[-1] += 0.5 * ends[1]
    v = d / (h - lost)
    return np.diff(np.pad(v, ((1, 1), (0, 0))), axis=0)
