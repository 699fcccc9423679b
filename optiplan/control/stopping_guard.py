"""`StoppingGuard`: accepts a command only if the robot can stop from it, clear of everything."""

from collections.abc import Sequence

import numpy as np

from optiplan.arrays import Array
from optiplan.control.braking import stop_travel
from optiplan.control.braking_path import BrakingPath
from optiplan.control.configuration import Configuration
from optiplan.control.limits.base import LimitRows
from optiplan.control.limits.joint_box import JointBox
from optiplan.control.limits.stop_limits import StopLimit, View
from optiplan.control.state import State
from optiplan.control.step import NearestPair
from optiplan.robot.robot import Robot

SLIP = 1e-7
"""m; by how much a distance that is too small already may shrink in a step: what distances are exact to."""


class StoppingGuard:
    """What is near where the robot would stop, for one state; kept for the next step, which starts there.

    Attributes:
        state: the last accepted one.
        nearest: the nearest pair of bodies where the robot would stop.
    """

    def __init__(self, robot: Robot, limits: Sequence[StopLimit], box: JointBox, by_acceleration: bool) -> None:
        self._limits, self._box = tuple(limits), box
        self._shift = 0.5 if by_acceleration else 0.0
        self._path = BrakingPath(robot, by_acceleration)
        self._configuration = Configuration(robot)
        self._views: list[View | None] = [None] * len(self._limits)
        self._least: list[Array] = [np.zeros(0)] * len(self._limits)
        self._below: list[set[int]] = [set() for _ in self._limits]
        self._stop = np.zeros(robot.n)
        self.state: State | None = None

    def rows(
        self, c: Configuration, state: State, brake: Array, dt: float
    ) -> list[tuple[str, LimitRows]]:
        """Rows of all limits for a step from a state, in which `brake` (n,) are the velocities of braking."""
        if not self._limits:
            return []
        known = self._continues(state)
        if not known:
            self._look(state, brake, dt)
        reach = None
        found = []
        for k, limit in enumerate(self._limits):
            view = self._views[k]
            assert view is not None
            self._set_least(k, c, view, known)
            if len(view.near):
                if reach is None:
                    reach = self._reach(state, brake, dt)
                found.append((limit.name, limit.rows(view, reach, brake, dt)))
        return found

    def accepts(self, candidate: State, dt: float) -> bool:
        """Whether the robot stays clear from a state on, if it brakes there; then that is where the next step starts."""
        if not self._limits:
            self.state = candidate
            return True
        path = self._path
        path.start(candidate.q, candidate.v, candidate.a, self._box, dt)
        c = self._configuration
        c.update(path.end, candidate.v)
        views: list[View | None] = []
        for limit, before, least in zip(self._limits, self._views, self._least, strict=True):
            view = limit.view(c, before)
            if not limit.path_is_clear(path, view, least):
                return False
            views.append(view)
        self._views, self._stop, self.state = views, path.end, candidate
        return True

    def keep(self, state: State) -> None:
        """Brake to a state: the robot would stop where it would have before."""
        self.state = state

    @property
    def nearest(self) -> NearestPair | None:
        """The least distance in view."""
        best: NearestPair | None = None
        for limit, view in zip(self._limits, self._views, strict=True):
            if view is not None and len(view.near):
                k = int(view.distance.argmin())
                if best is None or view.distance[k] < best.distance:
                    a, _, b = limit.labels[int(view.near[k])].partition(" and ")
                    best = NearestPair(a, b, float(view.distance[k]))
        return best

    def _continues(self, state: State) -> bool:
        last = self.state
        return last is not None and self._views[0] is not None and (
            state is last
            or bool((state.q == last.q).all() and (state.v == last.v).all() and (state.a == last.a).all())
        )

    def _look(self, state: State, brake: Array, dt: float) -> None:
        """What is near where the robot would stop if it brakes now."""
        shift = self._shift * dt
        first = state.q + (shift * (state.v + brake) if shift else dt * brake)
        self._path.start(first, brake, (brake - state.v) / dt, self._box, dt)
        self._stop = self._path.end
        self._configuration.update(self._stop, state.v)
        both = zip(self._limits, self._views, strict=True)
        self._views = [limit.view(self._configuration, before) for limit, before in both]

    def _set_least(self, k: int, c: Configuration, view: View, known: bool) -> None:
        """What each distance must be at least: `at_least`, or what it is now where that is less."""
        limit = self._limits[k]
        least = np.full(len(limit.labels), limit.at_least)
        low = {int(p) for p in view.near[view.distance < limit.at_least]}
        suspects = low | self._below[k] if known else set(view.near.tolist())
        if suspects:
            which = np.array(sorted(suspects), dtype=np.intp)
            now = limit.distances(c, which)[0]
            stop = np.full(len(limit.labels), np.inf)
            stop[view.near] = view.distance
            least[which] = np.minimum(limit.at_least, np.minimum(now, stop[which]) - SLIP)
            self._below[k] = {int(p) for p in which[least[which] < limit.at_least]}
        self._least[k] = least

    def _reach(self, state: State, brake: Array, dt: float) -> Array:
        """How much farther each joint stops for each rad/s or m/s more at the end of the step, (n,), s.

        The slope from braking to the other end of the joint's bounds: exact at both.
        """
        box = self._box
        up = np.abs(box.high - brake) >= np.abs(box.low - brake)
        other = np.where(up, box.high, box.low)
        other = np.where(np.isfinite(other), other, brake + 1.0)
        away = other - brake
        accelerations = (other - state.v) / dt
        joints = zip(
            other.tolist(), accelerations.tolist(), box.acceleration.tolist(), box.change.tolist(), strict=True
        )
        stop = state.q + (self._shift * dt) * state.v + dt * other + [stop_travel(*joint, dt) for joint in joints]
        slope = np.divide(stop - self._stop, away, out=np.full(len(away), dt), where=np.abs(away) > 1e-9)
        return np.maximum(slope, dt)
