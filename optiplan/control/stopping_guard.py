"""`StoppingGuard`: accepts a command only if the robot can stop from it, clear of everything."""

from collections.abc import Container, Iterator, Sequence
from copy import copy

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.control.braking_path import make_braking_path
from optiplan.control.configuration import Configuration
from optiplan.control.limits.joint_box import JointBox
from optiplan.control.limits.row_limit import KeptRowLimit, LimitRows
from optiplan.control.limits.stop_limits import Abilities, DistanceView, StopLimit
from optiplan.control.step import NearestPair
from optiplan.robot.robot import Robot
from optiplan.trajectory.state import State

SLIP = 1e-7
"""m; by how much a distance that is too small already may shrink until it is large enough: what it is exact to."""

WAYS = 4
"""Pairs that a way out is looked for from, one by one."""


class StoppingGuard:
    """What is near the robot in the last accepted state; kept for the next step, which starts there."""

    def __init__(self, robot: Robot, limits: Sequence[StopLimit], kept: Sequence[KeptRowLimit], box: JointBox) -> None:
        self._limits, self._kept, self._box = tuple(limits), tuple(kept), box
        self._path = make_braking_path(robot)
        self._configuration = Configuration(robot)
        self._views: list[DistanceView] = []
        self._least: list[Array] = []
        self._dt, self._per_jerk = 0.0, 1.0 / box.jerk
        self._unlimited = np.where(np.isinf(box.acceleration), self._per_jerk, 0.0)
        self._abilities = _abilities(box, 0.0)
        self._last: State | None = None
        self._t, self._timed = 0.0, not all(limit.still for limit in self._limits)
        self._spare = make_braking_path(robot)
        self._ahead: dict[StopLimit, Array] = {}

    def copy(self) -> "StoppingGuard":
        """Return a guard that starts from the same history; what its `rows` learn leaves this one as it is."""
        other = copy(self)
        other._least = [least.copy() for least in self._least]
        return other

    def forget(self) -> None:
        """Measure everything again in the next step: what was near tells nothing any more."""
        self._views, self._least = [], []
        self._timed = not all(limit.still for limit in self._limits)

    def rows(self, c: Configuration, state: State, dt: float, t: float) -> list[tuple[str, LimitRows]]:
        """Rows of all limits for a step from a state, at which `c` is, at time t, s."""
        if not self._limits:
            return []
        self._ahead = {}
        if not self._continues(state, t):
            self._look(c, t)
            self._least = []
        if dt != self._dt:
            self._dt, self._abilities, self._per_jerk = dt, _abilities(self._box, dt), 1.0 / self._box.jerk
        if not self._least:
            self._least = [np.full(len(limit.labels), -np.inf) for limit in self._limits]
        for limit, view, least in zip(self._limits, self._views, self._least, strict=True):
            _raise(least, limit, view)
        return [
            (limit.name, limit.rows(view, state.v, self._abilities, dt, t))
            for limit, view in zip(self._limits, self._views, strict=True)
            if len(view)
        ]

    def accepts(
        self, candidate: State, dt: float, t: float, start: State | None = None, relaxed: Container[str] = ()
    ) -> bool:
        """Whether the robot stays clear from a state at time t on, if it brakes there; then the next step starts there.

        Limits of speeds have to hold until it stands, too, but for those that are `relaxed`. Where moving obstacles
        come too near also if the robot brakes from `start` of the step on, they must only not do so sooner.
        """
        if not all(limit.name in relaxed or limit.keeps(candidate, dt) for limit in self._kept):
            return False
        if self._limits:
            c = self._configuration
            c.update(candidate.q, candidate.v)
            started, views = False, []
            for limit, before, least in zip(self._limits, self._views, self._least, strict=True):
                view = limit.view(c, before, t)
                if limit.in_core or not limit.is_far(view, self._longest_way(candidate), least):
                    if not started:
                        self._path.start(candidate.q, candidate.v, candidate.a, self._box, dt)
                        started = True
                    if not limit.stop_is_clear(self._path, view, least, t):
                        if limit.still or start is None or not self._stays_as_far(limit, start, dt, t):
                            return False
                        if not limit.stop_is_clear(self._path, view, np.where(limit.moving, -np.inf, least), t):
                            return False
                views.append(view)
            self._views = views
        self._last, self._t = candidate, t
        return True

    def _stays_as_far(self, limit: StopLimit, start: State, dt: float, t: float) -> bool:
        """Whether moving obstacles come too near no sooner, and no nearer then, than where the robot brakes now."""
        if limit not in self._ahead:
            brake = self._box.brake(start, dt)
            self._spare.start(brake.q, brake.v, brake.a, self._box, dt)
            self._ahead[limit] = limit.ahead(self._spare, t)
        braking, found = self._ahead[limit], limit.ahead(self._path, t)
        first = int(np.argmax(braking < limit.at_least)) if (braking < limit.at_least).any() else len(braking) - 1
        return bool((found >= np.minimum(braking, limit.at_least) - SLIP)[: first + 1].all())

    def keep(self, start: State, state: State, dt: float, t: float) -> None:
        """Brake from a state to another, at time t, whatever is near there.

        Where `start` is the last accepted state, the stop from it was found clear: what distances must be at least
        falls by what rounding costs, and no more.
        """
        if not self._continues(start, t - dt):
            self._least = []
        self._last, self._t = state, t
        if self._limits:
            self._configuration.update(state.q, state.v)
            self._look(self._configuration, t)
            for least, view in zip(self._least, self._views, strict=False):
                least[view.near] = np.minimum(least[view.near], view.distance)

    def ways_out(self) -> Iterator[tuple[str, Array]]:
        """Directions (n,) of the joints that lead away from what is too near, with names, the best first.

        First away from all of it together, each distance the more the less it is, then from each alone.
        """
        near: list[tuple[float, str, Array]] = []
        for limit, view in zip(self._limits, self._views, strict=False):
            for k in np.flatnonzero(view.distance < limit.margin[view.near]).tolist():
                lack = float(limit.margin[view.near[k]] - view.distance[k])
                gradient = view.gradient[k, : len(self._per_jerk)]
                near.append((lack, limit.labels[int(view.near[k])], gradient))
        near.sort(key=lambda entry: -entry[0])
        if len(near) > 1:
            yield "all of these", np.sum([lack * gradient for lack, _, gradient in near], axis=0)
        for _, label, gradient in near[:WAYS]:
            yield label, gradient

    @property
    def nearest(self) -> NearestPair | None:
        """The least distance in view."""
        best: NearestPair | None = None
        for limit, view in zip(self._limits, self._views, strict=False):
            if len(view):
                pair, distance = view.least
                if best is None or distance < best.distance:
                    best = NearestPair(*limit.bodies(pair), distance)
        return best

    def _longest_way(self, state: State) -> Array:
        """How far each joint still goes at most when it brakes, (n,), rad or m: simpler than the stop, and longer.

        The velocity grows by u at most until the acceleration a is turned back; then it takes A / jerk to brake fully,
        v² / 2A to stop, and two steps for what is not continuous. Where A is infinite, v sqrt(v / jerk) to stop.
        """
        box, size = self._box, np.abs(state.a)
        speed = np.abs(state.v) + size * (size * self._per_jerk + self._dt)
        late = size * self._per_jerk + box.delay + np.sqrt(speed * self._unlimited) + 3.0 * self._dt
        return np.asarray(speed * (late + 0.5 * speed * self._abilities.per_acceleration))

    def _continues(self, state: State, t: float) -> bool:
        last = self._last
        if not self._views or last is None or (self._timed and abs(t - self._t) > 1e-9):
            return False
        return state is last or bool((state.q == last.q).all())

    def _look(self, c: Configuration, t: float) -> None:
        """What is near at a configuration."""
        before: Sequence[DistanceView | None] = self._views or [None] * len(self._limits)
        self._views = [limit.view(c, view, t) for limit, view in zip(self._limits, before, strict=True)]


def _raise(least: Array, limit: StopLimit, view: DistanceView) -> None:
    """Set what each distance must be at least (P,): `at_least`, or where it is less now, that, or what it has been.

    It never falls from step to step, else distances that are too small could shrink by SLIP in each.
    """
    if core is not None:
        core.raise_least(least, limit.least, view, SLIP)
        return
    now = np.maximum(least[view.near], view.distance - SLIP)
    least[:] = limit.least
    least[view.near] = np.minimum(now, limit.least[view.near])


def _abilities(box: JointBox, dt: float) -> Abilities:
    return Abilities(box.delay + dt, 1.0 / box.acceleration)
