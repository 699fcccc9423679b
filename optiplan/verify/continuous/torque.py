"""Joint torques stay within their limits at all times, proved from their values and a bound on their curvature."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Flags, Index
from optiplan.problem.problem import Problem
from optiplan.robot.mimic_joints import unfold
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.intervals import derivative_bounds
from optiplan.verify.continuous.torque_bounds import TorqueBounds
from optiplan.verify.report import Check, VerifyPolicy

ROUNDING = 1e-12
"""Of inverse dynamics: a share of the sum of the sizes of all moments that add up to a torque."""
_MOST_FIRST = 20_000  # intervals of a long motion to begin with, beside one a piece
_CHUNK = 20_000  # intervals bounded at once, to limit memory


@dataclass(frozen=True, eq=False)
class _Spans:
    """K intervals, each within a piece, with the torques at both ends (2, K, n), N·m (N).

    `begin` and `width` (K,), s, in the time of the piece; `size` and `curvature` (K, n) as from `TorqueBounds.over`.
    """

    piece: Index
    begin: Array
    width: Array
    torque: Array
    size: Array
    curvature: Array

    def take(self, chosen: Flags) -> "_Spans":
        """The intervals chosen by (K,) flags."""
        torque, size, curvature = self.torque[:, chosen], self.size[chosen], self.curvature[chosen]
        return _Spans(self.piece[chosen], self.begin[chosen], self.width[chosen], torque, size, curvature)

    def largest(self) -> Array:
        """Upper bound of |tau| on each interval, (K, n): |tau| <= max at the ends + width² / 8 max |tau''| + rounding.

        A function with |f''| <= B stays within B w² / 8 of the chord between its ends.
        """
        return np.asarray(
            np.abs(self.torque).max(axis=0) + self.width[:, None] ** 2 / 8.0 * self.curvature + ROUNDING * self.size
        )


class _Proof:
    """Torques of a trajectory, at times and over intervals."""

    def __init__(self, problem: Problem, trajectory: Trajectory, policy: VerifyPolicy) -> None:
        self._model, self._policy = problem.robot.model, policy
        plain = unfold(self._model)
        self._data, self._bounds = self._model.createData(), TorqueBounds(plain.model, plain.A, plain.b)
        self._trajectory, self._pieces = trajectory, [trajectory.derivatives(order) for order in range(3)]
        self.evaluated = 0
        self.peak, self.time = np.zeros(trajectory.n), np.zeros(trajectory.n)

    def first(self) -> _Spans:
        """Every piece in equal intervals, `torque_rate` a second."""
        h = np.diff(self._trajectory.breakpoints)
        rate = min(self._policy.torque_rate, _MOST_FIRST / self._trajectory.duration)
        parts = np.maximum(np.ceil(h * rate), 1.0).astype(np.intp)
        piece = np.repeat(np.arange(len(h)), parts)
        within = np.arange(len(piece)) - np.repeat(np.cumsum(parts) - parts, parts)
        width = (h / parts)[piece]
        begin = within * width
        left = self._torques(piece, begin)
        ends = np.cumsum(parts) - 1
        right = np.empty_like(left)
        right[:-1] = left[1:]  # the end of an interval is the beginning of the next, but at the end of a piece
        right[ends] = self._torques(piece[ends], h)
        return self._spans(piece, begin, width, np.stack([left, right]))

    def halved(self, spans: _Spans) -> _Spans:
        """Both halves of every interval."""
        width = 0.5 * spans.width
        left, right = spans.torque
        middle = self._torques(spans.piece, spans.begin + width)
        torque = np.stack([np.concatenate([left, middle]), np.concatenate([middle, right])])
        begin = np.concatenate([spans.begin, spans.begin + width])
        return self._spans(np.tile(spans.piece, 2), begin, np.tile(width, 2), torque)

    def _spans(self, piece: Index, begin: Array, width: Array, torque: Array) -> _Spans:
        """Intervals with the bounds that hold on them."""
        size, curvature = np.empty((2, *torque.shape[1:]))
        for k in range(0, len(piece), _CHUNK):
            part, half = slice(k, k + _CHUNK), 0.5 * width[k : k + _CHUNK, None]
            c = self._trajectory.coefficients[piece[part]]
            size[part], curvature[part] = self._bounds.over(derivative_bounds(c, begin[part, None] + half, half, 5))
        return _Spans(piece, begin, width, torque, size, curvature)

    def _torques(self, piece: Index, local: Array) -> Array:
        """Return tau (K, n) at times `local` (K,) of pieces; the largest and its time are remembered."""
        state = []
        for c in self._pieces:
            value = c[piece, -1]
            for k in range(c.shape[1] - 2, -1, -1):
                value = value * local[:, None] + c[piece, k]
            state.append(value)
        rows = zip(*state, strict=True)
        tau = np.array([pin.rnea(self._model, self._data, *row).copy() for row in rows]).reshape(len(piece), -1)
        self.evaluated += len(tau)
        size, columns = np.abs(tau), np.arange(tau.shape[1])
        at = size.argmax(axis=0)
        larger = size[at, columns] > self.peak
        self.peak = np.where(larger, size[at, columns], self.peak)
        self.time = np.where(larger, (self._trajectory.breakpoints[piece] + local)[at], self.time)
        return tau


def torque(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy) -> Check:
    """|tau(t)| <= limit (1 + tolerance) for the inverse dynamics tau of the motion at all times.

    On an interval of a piece |tau| is at most the larger value of its ends, plus width² / 8 times a bound on |tau''|;
    where that is too much, the interval is halved. The value reported is the largest met. Friction is not modelled,
    and the inertia of attached objects is not known and counts as nothing.

    Holds at: all times, rounding included.
    """
    limits = problem.limits.torque
    if not np.isfinite(limits).any():
        return Check("torque", "unchecked", True, detail="the robot gives no torque limits")
    if not any(body.mass > 0.0 for body in problem.robot.model.inertias):
        return Check("torque", "unchecked", True, detail="the robot's file gives no masses")
    allowed = limits * (1.0 + policy.limit_tolerance)
    proof = _Proof(problem, trajectory, policy)
    spans, reason = proof.first(), ""
    while True:
        spans = spans.take(~np.asarray((spans.largest() <= allowed).all(axis=1)))  # NaN stays
        if (proof.peak > allowed).any():
            reason = "beyond its limit"
        elif not np.isfinite(spans.torque).all():
            reason = "not proved: numbers overflow"
        elif len(spans.piece) and spans.width.min() < 2.0 * policy.min_interval:
            reason = f"not proved on intervals of {policy.min_interval:g} s"
        elif proof.evaluated + len(spans.piece) > policy.max_queries:
            reason = f"not proved with {policy.max_queries} torques"
        if reason or not len(spans.piece):
            break
        spans = proof.halved(spans)
    j = int(np.argmax(proof.peak / allowed))
    detail = f"{reason or 'proved at all times'}: {proof.evaluated} torques"
    return Check(
        name="torque",
        kind="continuous",
        passed=not reason,
        worst=float(proof.peak[j]),
        limit=float(allowed[j]),
        unit="N·m",
        time=float(proof.time[j]),
        place=problem.robot.joint_names[j],
        detail=detail,
        witness={"torques": proof.evaluated},
    )
