"""Proof that a tool follows a part of its path: its place, its axis and its speed, for all times.

On an interval of time, of width T, the place on the curve is taken to run evenly from s_a to s_b. The distance of the
tool from it, a vector, is at most T² / 8 |p''| + (s_b - s_a)² / 8 |c''| off the chord between its ends; or as far from
its middle as both can have travelled. Directions turn by no more than both turn from the middle on. The speed differs
from that of the middle by at most T / 2 |p''|. Steps of c, of c' and of directions between pieces of the curve are
added, c' times a quarter of the way. An interval on which a bound does not hold is halved.
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.problem.seams.actions import SeamPart
from optiplan.records import dataclass
from optiplan.robot.robot import Robot
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.frame_motion import FrameBounds, FrameMotion
from optiplan.verify.halving import FrameProof, TimeParts, Values
from optiplan.verify.report import Check, VerifyPolicy
from optiplan.verify.seams.progress import PathProgress

_FIRST, _MOST_FIRST = 0.01, 40_000
"""s; intervals to begin with, and about how many at most."""

_ROUNDING = 1e-9
"""m, rad, or m/s."""


@dataclass(frozen=True, eq=False)
class _State:
    """What is known on K intervals: tool and curve at begin, middle and end, and bounds between."""

    spans: TimeParts
    time: Array
    s: Array
    q: list[Array]
    bounds: FrameBounds


class SeamProof:
    """The proof of one part of a path.

    Args:
        part: of the path.
        robot: with the tool.
        motion: while it is done.
        policy: of the verifier.
    """

    def __init__(self, part: SeamPart, robot: Robot, motion: Trajectory, policy: VerifyPolicy) -> None:
        self.part, self.motion = part, motion
        self.curve = part.path.curve
        self._frame = FrameMotion(robot, part.path.frame)
        self._proof = FrameProof(self._frame, motion, policy)
        self._progress = PathProgress(part, robot, motion)
        self._slow = part.path.slow_parts()

    def checks(self) -> Iterator[Check]:
        """Yield the checks of the tool's place, of its axis or rotation, and of its speed."""
        path = self.part.path
        yield self._check("path", "off the path", "m", path.position, self._off_path)
        turned = "axis off its direction" if self.curve.heading is None else "turned off its direction"
        yield self._check("path axis", turned, "rad", path.cone + path.orientation, self._turned)
        yield self._check("path speed", "off its speed", "m/s", path.within * path.speed, self._off_speed)

    def _check(self, name: str, words: str, unit: str, limit: float, value: Callable[[_State], Values]) -> Check:
        spans = TimeParts.of(self.motion, _FIRST, _MOST_FIRST)
        found = self._proof.prove(spans, lambda part: value(self._state(part)), limit + _ROUNDING)
        when, proved = found.time, not found.reason
        place = f"{self.part.path.frame}: {words} at {float(self._progress(np.array([when]))[0]):.4g} m"
        witness: dict[str, Any] = {"q": self.motion(when).tolist()}
        return Check(name, "continuous", proved, found.worst, limit, unit, when, place, found.words(), witness)

    def _state(self, spans: TimeParts) -> _State:
        time = np.stack([self._proof.time(spans, share) for share in (0.0, 0.5, 1.0)])
        s = self._progress(time[[0, 2]].ravel()).reshape(2, -1)
        places = np.stack([s[0], 0.5 * (s[0] + s[1]), s[1]])
        q = [self._proof.state(spans, share) for share in (0.0, 0.5, 1.0)]
        return _State(spans, time, places, q, self._proof.bounds(spans))

    def _off_path(self, state: _State) -> Values:
        off = np.stack(
            [
                np.linalg.norm(self._frame.poses(q)[:, :3, 3] - self.curve.points(s), axis=1)
                for q, s in zip(state.q, state.s, strict=True)
            ]
        )
        bounds, way = state.bounds, state.s[2] - state.s[0]
        bend = self._most(self.curve.bends, state.s)
        chord = np.maximum(off[0], off[2]) + 0.125 * (state.spans.width**2 * bounds.curvature + way**2 * bend)
        gaps = self._steps(self.curve.gaps, state.s)
        chord += 0.25 * way * self._steps(self.curve.kinks, state.s) + gaps + bounds.step
        for corner in self.curve.corners:
            chord[(state.s[0] < corner) & (corner < state.s[2])] = np.inf
        about = off[1] + bounds.travel + gaps + 0.5 * way * self._most(self.curve.rates, state.s)
        which, columns = off.argmax(axis=0), np.arange(off.shape[1])
        met = off[which, columns]
        return Values(met, state.time[which, columns], np.minimum(chord, about), met)

    def _turned(self, state: _State) -> Values:
        X = self._frame.poses(state.q[1])
        if self.curve.heading is None:
            chord = np.linalg.norm(X[:, :3, 2] - self.curve.directions(state.s[1]), axis=1)
        else:
            off = X[:, :3, :3] - self.curve.rotations(state.s[1])
            chord = np.linalg.norm(off.reshape(len(off), 9), axis=1) / np.sqrt(2.0)
        angle = 2.0 * np.arcsin(np.minimum(1.0, 0.5 * chord))
        way = 0.5 * (state.s[2] - state.s[0])
        turned = way * self._most(self.curve.turns, state.s) + self._steps(self.curve.flips, state.s)
        bound = angle + state.bounds.turn + turned
        return Values(angle, state.time[1], bound, angle)

    def _off_speed(self, state: _State) -> Values:
        asked = self.part.path.speed
        v = self._proof.state(state.spans, 0.5, 1)
        over = np.linalg.norm(self._frame.twists(state.q[1], v)[0], axis=1) - asked
        slow, free = np.zeros((2, len(over)), dtype=bool)
        for low, high in self._slow:
            slow |= (low <= state.s[0]) & (state.s[2] <= high)
            free |= (low <= state.s[1]) & (state.s[1] <= high)
        change = 0.5 * state.spans.width * state.bounds.curvature
        met = np.where(free, over, np.abs(over))
        return Values(met, state.time[1], np.where(slow, over, np.abs(over)) + change, met)

    def _steps(self, steps: Array, s: Array) -> Array:
        """Return the sum (K,) of the steps between pieces that each interval from s[0] to s[2] passes."""
        first, last = self.curve.piece(s[[0, 2]])
        total = np.concatenate([[0.0], np.cumsum(steps)])
        return np.asarray(total[last] - total[first])

    def _most(self, values: Array, s: Array) -> Array:
        """Return the largest of values (K,) of pieces that each interval from s[0] to s[2] touches."""
        first, last = self.curve.piece(s[0]), self.curve.piece(s[2])
        found = values[first]
        for k in range(1, int((last - first).max(initial=0)) + 1):
            found = np.maximum(found, values[np.minimum(first + k, last)])
        return np.asarray(found)
