"""Proof of a quantity of a frame at all times: intervals are halved until a bound of it holds on each of them."""

from collections.abc import Callable

import numpy as np

from optiplan.arrays import Array, Flags, Index, parts_of
from optiplan.problem.constraints.base import WHOLE
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.frame_motion import FrameBounds, FrameMotion
from optiplan.verify.continuous.intervals import derivative_bounds, step_sizes
from optiplan.verify.continuous.motion_bounds import Boxes
from optiplan.verify.report import VerifyPolicy

_CHUNK = 20_000
"""Intervals bounded at once, to limit memory."""


@dataclass(frozen=True, eq=False)
class TimeParts:
    """K intervals of time, each within a piece: `begin` and `width` (K,), s, in the time of the piece."""

    piece: Index
    begin: Array
    width: Array

    @classmethod
    def of(cls, trajectory: Trajectory, first: float, most: int, during: tuple[float, float] = WHOLE) -> "TimeParts":
        """Return what lies in a part of the motion, in steps of `first`, s, or longer ones: about `most` in all."""
        first = max(first, trajectory.duration / most)
        low, high = (share * trajectory.duration for share in during)
        starts, h = trajectory.breakpoints[:-1], np.diff(trajectory.breakpoints)
        begin, end = np.clip(low - starts, 0.0, h), np.clip(high - starts, 0.0, h)
        inside = (end > begin) | ((low >= starts) & (high <= starts + h))
        piece, begin, length = np.flatnonzero(inside), begin[inside], (end - begin)[inside]
        parts = np.maximum(1, np.ceil(length / first)).astype(np.intp)
        which, within = parts_of(parts)
        width = (length / parts)[which]
        return cls(piece[which], begin[which] + within * width, width)

    def divided(self, open_: Flags, parts: int = 2) -> "TimeParts":
        """Return the intervals that are still open, each in equal parts."""
        piece, begin, width = self.piece[open_], self.begin[open_], self.width[open_] / parts
        begins = begin + np.arange(parts)[:, None] * width
        return TimeParts(np.tile(piece, parts), begins.ravel(), np.tile(width, parts))

    def chunks(self) -> "list[TimeParts]":
        """Return them in parts that fit into memory."""
        cuts = [slice(k, k + _CHUNK) for k in range(0, len(self.piece), _CHUNK)]
        return [TimeParts(self.piece[cut], self.begin[cut], self.width[cut]) for cut in cuts]


@dataclass(frozen=True, eq=False)
class Values:
    """Largest value met on K intervals (K,) with its time, s, and an upper bound of the value there.

    `least`: the bound in the middle with joints off the motion by the error, below which no shorter interval comes.
    """

    met: Array
    time: Array
    bound: Array
    least: Array


@dataclass(frozen=True)
class HalvingOutcome:
    """What a proof found: the largest value met, when, s, on how many intervals; why nothing is proved, or nothing."""

    worst: float
    time: float
    evaluated: int
    reason: str

    def words(self, after: str = "") -> str:
        """Return the outcome for people; `after` the number of intervals."""
        return f"{self.reason or 'proved at all times'}: {self.evaluated} intervals{after}"


class FrameProof:
    """The motion of a frame along a trajectory, and the halving of intervals until a quantity keeps its limit on each.

    Args:
        motion: of the frame.
        trajectory: of the joints.
        policy: of the verifier.
        error: (n,) rad or m: every configuration within it of the motion counts.
    """

    def __init__(
        self, motion: FrameMotion, trajectory: Trajectory, policy: VerifyPolicy, error: Array | float = 0.0
    ) -> None:
        self.motion, self.trajectory, self.policy = motion, trajectory, policy
        self._jump = step_sizes(trajectory, policy.jump_tolerance) + error
        self.tubed = bool(np.any(error))

    def state(self, spans: TimeParts, share: float, order: int = 0) -> Array:
        """Return q, or its derivative, at a share of each interval: (K, n)."""
        return self.trajectory.derivative_in(spans.piece, spans.begin + share * spans.width, order)

    def time(self, spans: TimeParts, share: float) -> Array:
        """Return times at a share of each interval (K,), s."""
        return np.asarray(self.trajectory.breakpoints[spans.piece] + spans.begin + share * spans.width)

    def rates(self, spans: TimeParts) -> Array:
        """Return bounds of the joints' speed and acceleration on the intervals: (2, K, n)."""
        half = 0.5 * spans.width[:, None]
        c = self.trajectory.coefficients[spans.piece]
        return derivative_bounds(c, spans.begin[:, None] + half, half, 3)[1:]

    def bounds(self, spans: TimeParts) -> FrameBounds:
        """Return the bounds of the frame's motion on the intervals."""
        half = 0.5 * spans.width[:, None]
        speed, acceleration = self.rates(spans)
        jump, q, v = self._jump[spans.piece], self.state(spans, 0.5), self.state(spans, 0.5, 1)
        return self.motion.bounds(Boxes(half[:, 0], q, v, speed * half + jump, speed, acceleration, jump))

    def prove(self, spans: TimeParts, values: Callable[[TimeParts], Values], limit: float) -> HalvingOutcome:
        """Prove that a quantity keeps its limit on intervals; it is not where that is exceeded, or cannot be proved."""
        policy = self.policy
        worst, beside, when, evaluated, reason = -np.inf, -np.inf, 0.0, 0, ""
        while len(spans.piece) and not reason:
            left = []
            for part in spans.chunks():
                found = values(part)
                evaluated += len(part.piece)
                k = int(np.argmax(found.met))
                if found.met[k] > worst:
                    worst, when = float(found.met[k]), float(found.time[k])
                left.append(~np.asarray(found.bound <= limit))  # NaN stays
                beside = max(beside, float(found.least.max()))
            open_ = np.concatenate(left)
            if worst > limit:
                reason = "beyond its limit"
            elif beside > limit:
                reason = "not proved within the tracking error"
            elif not np.isfinite(worst) or np.isnan(limit):
                reason = "not proved: no number, or numbers overflow"
            elif open_.any() and spans.width[open_].min() < 2.0 * policy.min_interval:
                reason = f"not proved on intervals of {policy.min_interval:g} s"
            elif evaluated > policy.max_queries:
                reason = f"not proved with {policy.max_queries} poses"
            spans = spans.divided(open_)
        if not evaluated:
            reason, worst = "nothing of the motion is in its part", np.nan
        return HalvingOutcome(worst, when, evaluated, reason)
