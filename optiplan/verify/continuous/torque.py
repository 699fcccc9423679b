"""Joint torques stay within their limits at all times, proved from their values and a bound on their curvature."""

import numpy as np

from optiplan.arrays import Array, Flags, Index, parts_of
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.robot.batched.dynamics import inverse_dynamics
from optiplan.robot.loaded_robots import once_for_each
from optiplan.robot.mimic_joints import unfold
from optiplan.robot.robot import Robot
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.intervals import derivative_bounds
from optiplan.verify.continuous.torque_bounds import TorqueBounds
from optiplan.verify.report import Check, VerifyPolicy
from optiplan.verify.tolerances import TORQUE_ROUNDING

_MOST_FIRST = 20_000  # intervals of a long motion to begin with, beside one a piece
_CHUNK = 20_000  # intervals bounded at once, to limit memory
_TOGETHER = 8  # neighbouring intervals bounded as one at first, which costs an eighth and leaves few more open
_MOST_PARTS = 8  # into which an interval is divided at once
_MORE = 1.05  # parts than would do: within an interval torques may be larger than at its ends


@once_for_each
def bounds_of(robot: Robot) -> TorqueBounds:
    """The bounds of a robot."""
    plain = unfold(robot.model)
    return TorqueBounds(plain.model, plain.A, plain.b)


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

    def sagitta(self) -> Array:
        """How far |tau| may rise above its values at the ends, (K, n): width² / 8 max |tau''|, N·m (N).

        A function with |f''| <= B stays within B w² / 8 of the chord between its ends.
        """
        return np.asarray(self.width[:, None] ** 2 / 8.0 * self.curvature)

    def room(self, allowed: Array) -> Array:
        """What `sagitta` may be, (K, n): the limits (n,) less |tau| at both ends and rounding."""
        return np.asarray(allowed - np.abs(self.torque).max(axis=0) - TORQUE_ROUNDING * self.size)


class _Proof:
    """Torques of a trajectory, at times and over intervals."""

    def __init__(self, problem: Problem, trajectory: Trajectory, policy: VerifyPolicy) -> None:
        self._policy, self._robot, self._bounds = policy, problem.robot, bounds_of(problem.robot)
        self._trajectory = trajectory
        self.evaluated = 0
        self.peak, self.time = np.zeros(trajectory.n), np.zeros(trajectory.n)

    def first(self) -> _Spans:
        """Every piece in equal intervals, `torque_rate` a second, bounded some neighbours together."""
        h = self._trajectory.widths
        rate = min(self._policy.torque_rate, _MOST_FIRST / self._trajectory.duration)
        pieces, parts = np.arange(len(h)), np.maximum(np.ceil(h * rate), 1.0).astype(np.intp)
        (piece, within), last = parts_of(parts), np.cumsum(parts) - 1
        width = (h / parts)[piece]
        begin = within * width
        tau = self._torques(np.append(piece, pieces), np.append(begin, h))
        torque = _at_ends(tau[: len(piece)], tau[len(piece) :], last)
        first = within % _TOGETHER == 0
        group = np.cumsum(first) - 1
        size, curvature = self._bounded(piece[first], begin[first], width[first] * np.bincount(group))
        return _Spans(piece, begin, width, torque, size[group], curvature[group])

    def divided(self, spans: _Spans, allowed: Array) -> _Spans:
        """Every interval in as many equal parts, 2 to 8, as would prove it if the torque were as large as at its ends.

        What bounds the whole bounds its parts. Only those that ask for the most parts are bounded anew.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            share = _MORE * np.sqrt(spans.sagitta() / np.maximum(spans.room(allowed), 0.0)).max(axis=1)
        parts = np.clip(np.ceil(np.nan_to_num(share, nan=_MOST_PARTS)), 2.0, _MOST_PARTS).astype(np.intp)
        (owner, within), last = parts_of(parts), np.cumsum(parts) - 1
        piece, width = spans.piece[owner], (spans.width / parts)[owner]
        begin = spans.begin[owner] + within * width
        left, inner = spans.torque[0][owner], within > 0
        left[inner] = self._torques(piece[inner], begin[inner])
        size, curvature = spans.size[owner], spans.curvature[owner]
        loose = np.flatnonzero(parts[owner] == _MOST_PARTS)
        size[loose], curvature[loose] = self._bounded(piece[loose], begin[loose], width[loose])
        return _Spans(piece, begin, width, _at_ends(left, spans.torque[1], last), size, curvature)

    def _bounded(self, piece: Index, begin: Array, width: Array) -> Array:
        """What `TorqueBounds.over` says of K intervals: (2, K, n)."""
        found = np.empty((2, len(piece), self._trajectory.n))
        for k in range(0, len(piece), _CHUNK):
            part, half = slice(k, k + _CHUNK), 0.5 * width[k : k + _CHUNK, None]
            c = self._trajectory.coefficients[piece[part]]
            found[:, part] = self._bounds.over(derivative_bounds(c, begin[part, None] + half, half, 5))
        return found

    def _torques(self, piece: Index, local: Array) -> Array:
        """Return tau (K, n) at times `local` (K,) of pieces; the largest and its time are remembered."""
        tau = inverse_dynamics(self._robot, *self._trajectory.states_in(piece, local))
        if not len(tau):
            return tau
        self.evaluated += len(tau)
        size, columns = np.abs(tau), np.arange(tau.shape[1])
        at = size.argmax(axis=0)
        larger = size[at, columns] > self.peak
        self.peak = np.where(larger, size[at, columns], self.peak)
        self.time = np.where(larger, (self._trajectory.breakpoints[piece] + local)[at], self.time)
        return tau


def _at_ends(left: Array, final: Array, last: Index) -> Array:
    """Torques at both ends of parts, (2, K, n), from those at their beginnings and at the ends of the `last` ones.

    The end of a part is the beginning of the next.
    """
    right = np.empty_like(left)
    right[:-1] = left[1:]
    right[last] = final
    return np.stack([left, right])


def torque(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy) -> Check:
    """|tau(t)| <= limit (1 + tolerance) for the inverse dynamics tau of the motion at all times.

    On an interval of a piece |tau| is at most the larger value of its ends, plus width² / 8 times a bound on |tau''|;
    where that is too much, the interval is divided. The value reported is the largest met. Friction is not modelled,
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
        spans = spans.take(~np.asarray((spans.sagitta() <= spans.room(allowed)).all(axis=1)))  # NaN stays
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
        spans = proof.divided(spans, allowed)
    j = int(np.argmax(proof.peak / allowed))
    detail = f"{reason or 'proved at all times'}: {proof.evaluated} torques"
    return Check(
        name="torque",
        kind="continuous",
        passed=not reason,
        worst=float(proof.peak[j]),
        limit=float(allowed[j]),
        unit=problem.robot.unit("torque", j),
        time=float(proof.time[j]),
        place=problem.robot.joint_names[j],
        detail=detail,
        witness={"torques": proof.evaluated},
    )
