"""Limits of distances that hold wherever the robot could stop: what clearance and half-spaces share."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.control.configuration import Configuration
from optiplan.control.limits.base import ControlLimit, LimitRows

BUFFER = 5e-4
"""m; how much more than the distance itself the rows keep, for the curvature of bodies and motions."""
CURVATURE = 20.0
"""1/m; how much a distance dips below both ends of a travel, per square of the travel: as of a radius of 6 mm."""
KEPT = 1.2
"""Pairs stay in view up to this multiple of the distance at which they come in, so that none flickers."""


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """Distances at one configuration.

    Attributes:
        q: (n,).
        bound: (P,) lower bounds of all distances, m; those in view are exact.
        near: (K,) indices of the distances in view.
        distance: (K,) m.
        gradient: (K, n), m/rad or m/m.
    """

    q: Array
    bound: Array
    near: Index
    distance: Array
    gradient: Array


class StopLimit(ControlLimit):
    """P distances d(q) that stay at least `at_least`, at the configuration where the robot would stop as well.

    With q_s(x) the configuration at which the robot stands if it has velocities x at the end of this step and brakes
    from there, and h = d(q_s) - at_least, each row demands that h shrinks by the share `rate` · dt of itself at most:

        grad d · T (x - x_b) >= -rate · dt · h,   T = diag(dq_s / dx),

    where x_b are the velocities of braking now, which h knows already. So braking is always a solution, and whatever is
    chosen can be stopped. Holds at: every step; along a stop as far as `path_is_clear` proves it.

    Attributes:
        at_least: m; `influence`: distances up to which they are rows, m; `rate`: 1/s.
        arms: (P, n), change of each distance at most per rad or m of each joint.
        labels: (P,), what each is about.
    """

    at_least: float
    influence: float
    rate: float
    arms: Array
    labels: tuple[str, ...]

    def distances(self, c: Configuration, which: Index) -> tuple[Array, Callable[[], Array]]:
        """Distances (K,), m, at a configuration, and what computes their gradients (K, n) if they are wanted."""
        raise NotImplementedError

    def view(self, c: Configuration, before: View | None) -> View:
        """What is near at a configuration; `before` is any earlier view, which spares most queries."""
        if before is None:
            bound, near = np.full(len(self.labels), -np.inf), np.zeros(0, dtype=np.intp)
        else:
            bound = before.bound - self.arms @ np.abs(c.q - before.q)
            near = before.near
        due = bound < self.influence
        if len(near):
            due[near] |= bound[near] < KEPT * self.influence
        which = np.flatnonzero(due)
        found, gradients = self.distances(c, which)
        bound[which] = found
        kept = found < KEPT * self.influence
        if kept.all():
            return View(c.q, bound, which, found, gradients())
        return View(c.q, bound, which[kept], found[kept], gradients()[kept])

    def rows(self, view: View, reach: Array, brake: Array, dt: float) -> LimitRows:
        """Rows of what is in view at the stop of braking now, with T = diag(`reach`) (n,) and x_b = `brake` (n,)."""
        G = view.gradient * reach
        unit = np.maximum(np.sqrt(np.einsum("ij,ij->i", G, G)), 1e-6)
        G = G / unit[:, None]
        room = view.distance - self.at_least - BUFFER
        # Between the distance and its buffer nothing is taken away; below the distance, back at once.
        shrink = np.where(room > 0.0, self.rate * dt * room, np.minimum(room + BUFFER, 0.0))
        low = G @ brake - shrink / unit
        labels = tuple(self.labels[k] for k in view.near.tolist())
        return LimitRows(G, low, np.full(len(low), np.inf), unit, labels)

    def path_is_clear(self, path: "StopPath", end: View, least: Array) -> bool:
        """Whether distances stay at least `least` (P,) from the next configuration to where the robot would stop.

        Between two points whose travel is at most D, and whose distances are d_1 and d_2, a distance is at least
        (d_1 + d_2 - D) / 2, and, for bodies and motions that curve no more than `CURVATURE`, min(d_1, d_2) minus
        CURVATURE D²/2. Where that is not enough, the point between is asked.
        """
        if (end.distance < least[end.near]).any():
            return False
        first = path.at(0)
        travel = self.arms @ np.abs(end.q - first)
        which = np.flatnonzero(end.bound - travel < least)
        if not len(which):
            return True
        start = self.distances(path.configuration(0), which)[0]
        return self._is_clear(path, (0, path.steps), (start, end.bound[which]), which, least[which])

    def _is_clear(
        self, path: "StopPath", steps: tuple[int, int], ends: tuple[Array, Array], which: Index, least: Array
    ) -> bool:
        lowest = np.minimum(*ends)
        if (ends[0] < least).any():
            return False
        travel = self.arms[which] @ path.travel(*steps)
        sure = np.maximum(0.5 * (ends[0] + ends[1] - travel), lowest - 0.5 * CURVATURE * travel**2)
        left = sure < least
        if not left.any() or steps[1] - steps[0] <= 1:
            return True
        which, least = which[left], least[left]
        middle = sum(steps) // 2
        found = self.distances(path.configuration(middle), which)[0]
        if (found < least).any():
            return False
        return self._is_clear(path, (steps[0], middle), (ends[0][left], found), which, least) and self._is_clear(
            path, (middle, steps[1]), (found, ends[1][left]), which, least
        )


class StopPath:
    """The configurations of a stop, step by step, from the end of the present step: `steps` more until it stands.

    Attributes:
        steps: number of steps.
        end: (n,), where it stands.
    """

    steps: int
    end: Array

    def at(self, step: int) -> Array:
        """Configuration (n,) after so many steps."""
        raise NotImplementedError

    def configuration(self, step: int) -> Configuration:
        """The same with kinematics, valid until the next call."""
        raise NotImplementedError

    def travel(self, first: int, last: int) -> Array:
        """How far each joint moves between two steps at most, (n,), rad or m."""
        raise NotImplementedError
