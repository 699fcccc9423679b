"""Limits of distances that hold wherever the robot could stop: what clearance and half-spaces share."""

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array, Flags, Index
from optiplan.control.configuration import Configuration
from optiplan.control.limits.base import ControlLimit
from optiplan.control.limits.row_limit import LimitRows
from optiplan.records import dataclass
from optiplan.robot.robot import Robot

BUFFER = 5e-4
"""m; how much more than the distance itself the rows keep, for what is not linear in a step."""
KEPT = 1.2
"""Pairs stay in view up to this multiple of the distance at which they come in, so that none flickers."""


@dataclass(frozen=True, slots=True, eq=False)
class Abilities:
    """How joints brake: `delay` (n,), s, that jerk limits cost; 1 / acceleration (n,), 0 where there is no limit."""

    delay: Array
    per_acceleration: Array


@dataclass(frozen=True, slots=True, eq=False)
class DistanceView:
    """Distances at one configuration; the core has its own, of the same attributes.

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

    def __len__(self) -> int:
        """Number of distances in view."""
        return len(self.near)

    @property
    def least(self) -> tuple[int, float]:
        """The nearest of those in view, and its distance, m."""
        k = int(self.distance.argmin())
        return int(self.near[k]), float(self.distance[k])


class StopLimit(ControlLimit):
    """P distances d(q) that stay at least `at_least`, now and if the robot brakes.

    Joints brake each for itself, so a stop leads through any part of the box that their stops span. With the gradient g
    and stops of v τ + v² / 2A (τ stands for the time that jerk limits cost), the least distance there is, to first
    order,

        b(q, v) = d - at_least + sum_j τ_j g_j v_j - sum over j with g_j v_j < 0 of |g_j| v_j² / 2A_j,

    and each row demands b' >= (1 - rate · dt) b of the end of the step, linear in its velocities x: the nearer, the
    slower. Where the distance is too small already, b' >= 0 is demanded, and relaxed to the fastest way out.
    Holds at: every step; whether a stop is clear is measured, by `stop_is_clear`.

    Attributes:
        at_least: m; `influence`: distances up to which they are rows, m; `rate`: 1/s.
        least: (P,), m, what of it is asked of each; margin: (P,), m, what rows keep.
        moving: (P,), whether a distance changes by itself, as obstacles move; `still`: none does.
        comes_in: (P,), m, `influence` of each.
        arms: (P, n), travel of the bodies of each distance against each other at most, per rad or m of each joint.
        turns: (n,), rad that a joint turns what it carries, and slides (n,), m that it slides it, per rad or m.
        labels: (P,), what each is about.
        in_core: whether the native core looks at its stops, which is quicker than `is_far`.
    """

    in_core = False
    at_least: float
    influence: float
    rate: float
    arms: Array
    turns: Array
    slides: Array
    labels: tuple[str, ...]
    least: Array
    margin: Array
    moving: Flags
    still: bool
    comes_in: Array

    def bind(self, robot: Robot) -> None:
        """Look up what the joints do."""
        revolute = robot.kinematics.revolute > 0.5
        self.turns = robot.kinematics.planned_bound(revolute.astype(np.float64))
        self.slides = robot.kinematics.planned_bound((~revolute).astype(np.float64))

    def require_least(self) -> None:
        """Ask `at_least` of all distances; after `labels` are known."""
        self.least = np.full(len(self.labels), self.at_least)
        self.margin, self.moving = self.least + BUFFER, np.zeros(len(self.labels), dtype=bool)
        self.still = True
        self.comes_in = np.full(len(self.labels), self.influence)

    def bodies(self, k: int) -> tuple[str, str]:
        """The two bodies of distance k; of one that is not between bodies its label, and nothing."""
        return self.labels[k], ""

    def distances(self, c: Configuration, which: Index) -> Array:
        """Distances (K,), m, at a configuration."""
        raise NotImplementedError

    def gradients(self, c: Configuration, which: Index) -> Array:
        """Gradients (K, n) of what `distances` was asked for last, m/rad or m/m."""
        raise NotImplementedError

    def mark(self, c: Configuration) -> Array:
        """Where everything is at a configuration, for `moved`."""
        raise NotImplementedError

    def chords(self, first: Array, second: Array, which: Index) -> Array:
        """How far apart two marks are, for points of the bodies of each distance (K,) against each other at most, m."""
        raise NotImplementedError

    def between(self, d_0: Array, d_1: Array, chord: Array) -> Array:
        """The least distances (K,) on straight ways no longer than `chord` between places where they are d_0 and d_1.

        For two points; bodies are sets of points. In the triangle of a point, and of where the other comes from and
        goes to, it is the height, unless that stands outside.
        """
        difference, square = d_0 * d_0 - d_1 * d_1, chord * chord
        foot = (square + difference) / (2.0 * np.maximum(chord, 1e-300))
        height = np.sqrt(np.maximum(d_0 * d_0 - foot * foot, 0.0))
        least = np.where(square <= np.abs(difference), np.minimum(d_0, d_1), height)
        return np.asarray(np.where((d_0 > 0.0) & (d_1 > 0.0), least, -np.inf))

    def view(self, c: Configuration, before: DistanceView | None, t: float) -> DistanceView:
        """What is near at a configuration at time t, s; `before` is any earlier view, which spares most queries."""
        if before is None:
            bound, near = np.full(len(self.labels), -np.inf), np.zeros(0, dtype=np.intp)
        else:
            bound = before.bound - self.arms @ np.abs(c.q - before.q)
            near = before.near
        due = ~(bound >= self.comes_in)  # also where it is no number
        if len(near):
            due[near] |= ~(bound[near] >= KEPT * self.comes_in[near])
        which = np.flatnonzero(due)
        found = self.distances(c, which)
        bound[which] = found
        kept = found < KEPT * self.comes_in[which]
        if kept.all():
            return DistanceView(c.q, bound, which, found, self.gradients(c, which))
        return DistanceView(c.q, bound, which[kept], found[kept], self.gradients(c, which)[kept])

    def rows(self, view: DistanceView, v: Array, abilities: "Abilities", dt: float, t: float) -> LimitRows:
        """Rows of what is in view at the configuration of this step, in which joints have velocities v (n,)."""
        labels = tuple([self.labels[k] for k in view.near.tolist()])
        drift = lost = np.zeros(len(labels))
        if not self.still:
            drift = self.drift(view, t)
            lost = _lost(drift, view.gradient[:, : len(v)], abilities)
        delay, brake = abilities.delay, abilities.per_acceleration
        if core is not None:
            abilities_and_ends = delay, brake, self.least, self.margin
            return core.stop_rows(view, v, *abilities_and_ends, dt * drift, lost, dt, self.rate, labels)
        least, margin = self.least[view.near], self.margin[view.near] + lost
        g = view.gradient[:, : len(v)]
        towards = g * v < 0.0
        slope = delay + towards * (np.abs(v) * brake)
        G = g * (dt + slope)
        held = (g * slope) @ v
        b = view.distance - margin + held - 0.5 * ((towards * g) @ (v * np.abs(v) * brake))
        share = min(1.0, self.rate * dt)
        gain = np.where(view.distance < least, np.minimum(b, 0.0), share * b)
        return LimitRows.normalised(G, held - dt * drift - gain, np.full(len(labels), np.inf), labels, least=1e-6)

    def drift(self, view: DistanceView, t: float) -> Array:
        """How quickly distances in view change at time t where the robot stands, (K,), m/s."""
        raise NotImplementedError

    def ahead(self, path: "StopPath", t: float) -> Array:
        """The least of the distances that are `moving`, m, now and then along a stop that begins at time t."""
        raise NotImplementedError

    def is_far(self, start: DistanceView, way: Array, least: Array) -> bool:
        """Whether no way of the joints of at most `way` (n,) brings any distance below `least` (P,)."""
        return bool((start.bound - self.arms @ way >= least).all())

    def stop_is_clear(self, path: "StopPath", start: DistanceView, least: Array, t: float) -> bool:
        """Whether distances stay at least `least` (P,) from where `start` was taken until the robot stands.

        They do where the travel of all joints is less than is left. Else the stop is asked at its end, and between two
        of its steps wherever `between` and `_deviation` do not tell that the distance stays large enough, down to
        single steps. Nothing is taken for granted about the shapes of the bodies or of their paths.
        Holds at: every step of the stop, which begins at time t, s.
        """
        if not (start.distance >= least[start.near]).all():  # so what is no number is not clear
            return False
        which = np.flatnonzero(~(start.bound - self.arms @ path.way >= least))
        if not len(which):
            return True
        c = path.configuration(path.steps)
        found = self.distances(c, which)
        if not (found >= least[which]).all():
            return False
        last_mark = self.mark(c)
        ends = _Ends(0, path.steps, start.bound[which], found, self.mark(path.configuration(0)), last_mark)
        return self._is_clear(path, ends, which, least[which])

    def _is_clear(self, path: "StopPath", ends: "_Ends", which: Index, least: Array) -> bool:
        if ends.last - ends.first <= 1:
            return True
        straight = self.between(ends.distance, ends.last_distance, self.chords(ends.mark, ends.last_mark, which))
        left = ~(straight - self._deviation(path, ends, which) >= least)
        if not left.any():
            return True
        which, least = which[left], least[left]
        middle = (ends.first + ends.last) // 2
        c = path.configuration(middle)
        found = self.distances(c, which)
        if not (found >= least).all():
            return False
        mark = self.mark(c)
        before = _Ends(ends.first, middle, ends.distance[left], found, ends.mark, mark)
        after = _Ends(middle, ends.last, found, ends.last_distance[left], mark, ends.last_mark)
        return self._is_clear(path, before, which, least) and self._is_clear(path, after, which, least)

    def _deviation(self, path: "StopPath", ends: "_Ends", which: Index) -> Array:
        """How far points (K,) stray at most, against each other, from straight ways between two steps of a stop, m.

        Of a path p(t) that takes a time T it is T² |p̈| / 8. Joints stray so from their own straight ways; along these,
        by d_j of each joint, |p̈| <= (rad turned) · (sum of the arms' d_j + m slid), since each joint turns how all
        others move the point, but a slide is not among the arms that it lengthens.
        """
        time = (ends.last - ends.first) * path.dt
        way = np.abs(path.at(ends.last) - path.at(ends.first))
        arms = self.arms[which]
        moving = arms > 0.0
        turned, slid = moving @ (self.turns * way), moving @ (self.slides * way)
        unsteady = arms @ path.strongest(ends.first, ends.last)
        return np.asarray(0.125 * (time * time * unsteady + turned * (arms @ way + slid)))


def _lost(drift: Array, g: Array, abilities: Abilities) -> Array:
    """What distances (K,) lose, m, until the joints, all together, have matched the rate w < 0 at which they shrink.

    |w| τ + w² / 2 sum_j |g_j| A_j, with the gradient g (K, n).
    """
    brakes = np.where(abilities.per_acceleration > 0.0, 1.0 / np.maximum(abilities.per_acceleration, 1e-9), 1e9)
    toward = np.maximum(-drift, 0.0)
    return np.asarray(toward * (float(abilities.delay.max()) + 0.5 * toward / np.maximum(np.abs(g) @ brakes, 1e-3)))


@dataclass(frozen=True, slots=True, eq=False)
class _Ends:
    """A part of a stop: its first and last step, distances (K,) there and marks."""

    first: int
    last: int
    distance: Array
    last_distance: Array
    mark: Array
    last_mark: Array


class StopPath:
    """The configurations of a stop, step by step, from the end of the present step: `steps` more until it stands.

    Attributes:
        steps: number of steps, of `dt` s each.
        end: (n,), where it stands.
        way: (n,), how far each joint gets from where the stop begins at most, rad or m.
    """

    steps: int
    dt: float
    end: Array
    way: Array

    def at(self, step: int) -> Array:
        """Configuration (n,) after so many steps."""
        raise NotImplementedError

    def strongest(self, first: int, last: int) -> Array:
        """The largest accelerations (n,) in the steps first + 1 … last, without their signs, rad/s² or m/s²."""
        raise NotImplementedError

    def configuration(self, step: int) -> Configuration:
        """The same with kinematics, valid until the next call."""
        raise NotImplementedError
