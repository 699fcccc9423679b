"""Proof that a tool follows a part of its path: its place, its axis and its speed, for all times.

On an interval of time, of width T, the place on the curve is taken to run evenly from s_a to s_b. The distance of the
tool from it, a vector, is at most T² / 8 |p''| + (s_b - s_a)² / 8 |c''| off the chord between its ends; or as far from
its middle as both can have travelled. Directions turn by no more than both turn from the middle on. The speed differs
from that of the middle by at most T / 2 |p''|. Steps of c, of c' and of directions between pieces of the curve are
added, c' times a quarter of the way. An interval on which a bound does not hold is halved.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from optiplan.arrays import Array, Flags, Index, parts_of
from optiplan.problem.seams.actions import SeamPart
from optiplan.robot.robot import Robot
from optiplan.trajectory import polynomial
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.frame_motion import FrameBounds, FrameMotion
from optiplan.verify.continuous.intervals import derivative_bounds, step_sizes
from optiplan.verify.continuous.motion_bounds import Boxes
from optiplan.verify.report import Check, VerifyPolicy
from optiplan.verify.seams.progress import PathProgress

_FIRST, _MOST_FIRST = 0.01, 40_000
"""s; intervals to begin with, and about how many at most."""

_CHUNK = 20_000
"""Intervals bounded at once."""

_ROUNDING = 1e-9
"""m, rad, or m/s."""


@dataclass(frozen=True, eq=False)
class _SeamSpans:
    """K intervals of time, each within a piece of the motion: `begin` and `width` (K,), s, in the piece's time."""

    piece: Index
    begin: Array
    width: Array

    @classmethod
    def of(cls, motion: Trajectory) -> "_SeamSpans":
        first = max(_FIRST, motion.duration / _MOST_FIRST)
        h = np.diff(motion.breakpoints)
        parts = np.maximum(1, np.ceil(h / first)).astype(np.intp)
        which, within = parts_of(parts)
        width = (h / parts)[which]
        return cls(which, within * width, width)

    def of_these(self, chosen: Flags | slice) -> "_SeamSpans":
        return _SeamSpans(self.piece[chosen], self.begin[chosen], self.width[chosen])

    def halved(self) -> "_SeamSpans":
        width = 0.5 * self.width
        begin = np.concatenate([self.begin, self.begin + width])
        return _SeamSpans(np.tile(self.piece, 2), begin, np.tile(width, 2))


@dataclass(frozen=True, eq=False)
class _State:
    """What is known on K intervals: tool and curve at begin, middle and end, and bounds between."""

    spans: _SeamSpans
    time: Array
    s: Array
    q: list[Array]
    bounds: FrameBounds


@dataclass(frozen=True, eq=False)
class _Deviation:
    """Largest deviation met on K intervals (K,), when, s, and an upper bound of it."""

    met: Array
    time: Array
    bound: Array


class SeamProof:
    """The proof of one part of a path.

    Args:
        part: of the path.
        robot: with the tool.
        motion: while it is done.
        policy: of the verifier.
    """

    def __init__(self, part: SeamPart, robot: Robot, motion: Trajectory, policy: VerifyPolicy) -> None:
        self.part, self.motion, self.policy = part, motion, policy
        self.curve = part.path.curve
        self._frame = FrameMotion(robot, part.path.frame)
        self._progress = PathProgress(part, robot, motion)
        self._jump = step_sizes(motion, policy.jump_tolerance)
        self._pieces = [motion.derivatives(order) for order in range(2)]
        self._slow = part.path.slow_parts()

    def checks(self) -> Iterator[Check]:
        """Yield the checks of the tool's place, of its axis or rotation, and of its speed."""
        path = self.part.path
        yield self._check("path", "off the path", "m", path.position, self._off_path)
        turned = "axis off its direction" if self.curve.heading is None else "turned off its direction"
        yield self._check("path axis", turned, "rad", path.cone + path.orientation, self._turned)
        yield self._check("path speed", "off its speed", "m/s", path.within * path.speed, self._off_speed)

    def _check(self, name: str, words: str, unit: str, limit: float, value: Callable[[_State], _Deviation]) -> Check:
        allowed, policy = limit + _ROUNDING, self.policy
        spans, worst, when, evaluated, reason = _SeamSpans.of(self.motion), -np.inf, 0.0, 0, ""
        while len(spans.piece) and not reason:
            left = []
            for k in range(0, len(spans.piece), _CHUNK):
                own = spans.of_these(slice(k, k + _CHUNK))
                found = value(self._state(own))
                evaluated += len(own.piece)
                i = int(np.argmax(found.met))
                if found.met[i] > worst:
                    worst, when = float(found.met[i]), float(found.time[i])
                left.append(~np.asarray(found.bound <= allowed))  # NaN stays
            open_ = np.concatenate(left)
            if worst > allowed:
                reason = "beyond its limit"
            elif not np.isfinite(worst):
                reason = "not proved: numbers overflow"
            elif open_.any() and spans.width[open_].min() < 2.0 * policy.min_interval:
                reason = f"not proved on intervals of {policy.min_interval:g} s"
            elif evaluated > policy.max_queries:
                reason = f"not proved with {policy.max_queries} poses"
            spans = spans.of_these(open_).halved()
        place = f"{self.part.path.frame}: {words} at {float(self._progress(np.array([when]))[0]):.4g} m"
        detail = f"{reason or 'proved at all times'}: {evaluated} intervals"
        witness: dict[str, Any] = {"q": self.motion(when).tolist()}
        return Check(name, "continuous", not reason, worst, limit, unit, when, place, detail, witness)

    def _state(self, spans: _SeamSpans) -> _State:
        begin = self.motion.breakpoints[spans.piece] + spans.begin
        time = np.stack([begin, begin + 0.5 * spans.width, begin + spans.width])
        s = self._progress(time[[0, 2]].ravel()).reshape(2, -1)
        places = np.stack([s[0], 0.5 * (s[0] + s[1]), s[1]])
        q = [self._joints(spans, share, 0) for share in (0.0, 0.5, 1.0)]
        half = 0.5 * spans.width[:, None]
        c = self.motion.coefficients[spans.piece]
        speed, acceleration = derivative_bounds(c, spans.begin[:, None] + half, half, 3)[1:]
        jump, v = self._jump[spans.piece], self._joints(spans, 0.5, 1)
        boxes = Boxes(half[:, 0], q[1], v, speed * half + jump, speed, acceleration, jump)
        return _State(spans, time, places, q, self._frame.bounds(boxes))

    def _joints(self, spans: _SeamSpans, share: float, order: int) -> Array:
        local = (spans.begin + share * spans.width)[:, None]
        return polynomial.evaluate(np.swapaxes(self._pieces[order][spans.piece], 1, 2), local)

    def _off_path(self, state: _State) -> _Deviation:
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
        return _Deviation(off[which, columns], state.time[which, columns], np.minimum(chord, about))

    def _turned(self, state: _State) -> _Deviation:
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
        return _Deviation(angle, state.time[1], bound)

    def _off_speed(self, state: _State) -> _Deviation:
        asked = self.part.path.speed
        v = self._joints(state.spans, 0.5, 1)
        over = np.linalg.norm(self._frame.twists(state.q[1], v)[0], axis=1) - asked
        slow, free = np.zeros((2, len(over)), dtype=bool)
        for low, high in self._slow:
            slow |= (low <= state.s[0]) & (state.s[2] <= high)
            free |= (low <= state.s[1]) & (state.s[1] <= high)
        change = 0.5 * state.spans.width * state.bounds.curvature
        met = np.where(free, over, np.abs(over))
        return _Deviation(met, state.time[1], np.where(slow, over, np.abs(over)) + change)

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
