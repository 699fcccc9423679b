"""Torque limits of the planned joints."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.planners.trajopt.terms.term import Curve, Expressed, Instants, Mask, SoftRows
from optiplan.robot.batched.dynamics import inverse_dynamics
from optiplan.robot.mimic_joints import Unfolded, unfold
from optiplan.robot.robot import Robot

if TYPE_CHECKING:
    from optiplan.kinematics.symbolic.state import SymbolicState

TORQUE_SHARE, REST_SHARE = 0.6, 0.8
"""Torques above this share of their limit get a row; at rest, where a step changes them less, above the second one."""

HELD = 0.98
"""Share of the limits that torques at rest may take: slowing down does not help where they exceed them."""

TORQUE_PENALTY = 2.0
"""Price of a torque that exceeds its limit by the limit itself at one sample."""


class TorqueTerm:
    """Rows 1 -+ tau / limit, with pinocchio's analytic derivatives of inverse dynamics. Holds at: samples.

    Where gravity can exceed a limit, tau at rest has rows, too: a motion that its drives cannot hold still is not made
    feasible by slowing it down.
    """

    name = "torque"
    price, unit, negligible, decides = TORQUE_PENALTY, 1.0, 0.01, False

    def __init__(self, robot: Robot, limit: Array, still: Array | None = None) -> None:
        """Set the limits (n,), N·m or N; `still` (n,) of torques at rest, None or infinite: without rows.

        Along a curve, `HELD` of them is allowed at rest, and at least what its ends need.
        """
        self.limit, self._robot = limit, robot
        self.still = np.full(len(limit), np.inf) if still is None else still
        self._heavy = np.flatnonzero(np.isfinite(self.still))
        self._limited = np.flatnonzero(np.isfinite(limit))
        self._watched: Mask = np.zeros((0, len(self._limited)), dtype=bool)

    @cached_property
    def _plain(self) -> tuple[Unfolded, pin.Data]:
        """The model with each joint for itself: pinocchio's derivatives do not support mimic joints."""
        unfolded = unfold(self._robot.model)
        return unfolded, unfolded.model.createData()

    def begin(self, samples: Instants) -> None:
        """Forget what was learnt at other samples."""
        self._watched = np.zeros((len(samples.u), len(self._limited)), dtype=bool)

    def rows(self, curve: Curve) -> SoftRows:
        """Return rows 1 - |tau_j| / limit_j >= 0 of joints, samples above a share of the limit, or watched."""
        if not len(self._limited):
            return SoftRows.none(curve.variables)
        moving = self._shares(curve.motion, self.limit)
        exceeded: Mask = np.abs(moving) > 1.0
        near = (np.abs(moving) > TORQUE_SHARE) | self._watched
        rows = replace(self._rows_where(near, curve, curve.motion, moving, self.limit), exceeded=exceeded)
        if not len(self._heavy):
            return rows
        states, still = _at_rest(curve.motion[0]), self._holding(curve)
        shares = self._shares(states, still)
        return rows.beside(self._rows_where(np.abs(shares) > REST_SHARE, curve, states, shares, still, orders=1))

    def _shares(self, motion: Sequence[Array], limit: Array) -> Array:
        """Return the torques over their limits (N, L)."""
        return np.asarray(inverse_dynamics(self._robot, *motion)[:, self._limited] / limit[self._limited])

    def _rows_where(
        self, near: Mask, curve: Curve, motion: Sequence[Array], share: Array, limit: Array, orders: int = 3
    ) -> SoftRows:
        """Return the rows of those `near` of shares (N, L); with `orders` 1, at rest, they depend on q alone."""
        sample, which = np.nonzero(near)
        if not len(sample):
            return SoftRows.none(curve.variables)
        hot, back = np.unique(sample, return_inverse=True)
        joint = self._limited[which]
        scale = -np.sign(share[sample, which]) / limit[joint]
        by_q, by_v, by_a = (
            matrix[back, joint] * (scale[:, None] if order < orders else 0.0)
            for order, matrix in enumerate(self._derivatives([part[hot] for part in motion]))
        )
        return curve.rows(sample, 1.0 - np.abs(share[sample, which]), (by_q, by_v, by_a))

    def _holding(self, curve: Curve) -> Array:
        """Return the limits (n,) of torques at rest along a curve."""
        ends = np.abs(inverse_dynamics(self._robot, *_at_rest(curve.control[[0, -1]]))).max(axis=0)
        return np.asarray(np.maximum(HELD * self.still, ends))

    def residuals(self, curve: Curve) -> tuple[Array, tuple[Array, Array, Array]]:
        """Return the torques (N, n) at the samples, and their derivatives (N, n, n) by q, v and a."""
        by_q, by_v, by_a = self._derivatives(list(curve.motion))
        return inverse_dynamics(self._robot, *curve.motion), (by_q, by_v, by_a)

    def _derivatives(self, motion: list[Array]) -> list[Array]:
        """Return the derivatives of inverse dynamics by q, v and a, (H, n) each: three arrays (H, n, n)."""
        plain, data = self._plain
        A, b = plain.A, plain.b
        by_q, by_v, mass = (np.empty((len(motion[0]), len(A), len(A))) for _ in range(3))
        states = zip(motion[0] @ A.T + b, motion[1] @ A.T, motion[2] @ A.T, strict=True)
        for row, (q, v, a) in enumerate(states):
            pin.computeRNEADerivatives(plain.model, data, q, v, a)
            by_q[row], by_v[row], mass[row] = data.dtau_dq, data.dtau_dv, data.M
        upper = np.triu(mass)  # pinocchio fills the upper half of the mass matrix only
        mass = upper + np.triu(upper, 1).transpose(0, 2, 1)
        return [A.T @ matrix @ A for matrix in (by_q, by_v, mass)]

    def expressed(self) -> Expressed:
        """Return 1 - tau / limit and 1 + tau / limit of the limited joints, and those at rest, at all samples."""
        from optiplan.planners.path_constraints.parts import stacked

        heavy = self._heavy

        def build(k: "SymbolicState") -> Any:
            if not len(self._limited):
                return stacked()
            share = k.torque()[self._limited.tolist()] * k.constant(1.0 / self.limit[self._limited])
            if not len(heavy):
                return stacked(1.0 - share, 1.0 + share)
            still = k.torque(at_rest=True)[heavy.tolist()] * k.constant(1.0 / self.still[heavy])
            return stacked(1.0 - share, 1.0 + share, 1.0 - still, 1.0 + still)

        def least(curve: Curve) -> Array:
            spare = 1.0 - self._holding(curve)[heavy] / self.still[heavy]
            return np.tile(np.concatenate([np.zeros(2 * len(self._limited)), spare, spare]), (len(samples), 1))

        samples = np.arange(len(self._watched))
        kinds = ("torque", self._limited), ("torque at rest", heavy)
        labels = tuple(
            f"{side} {kind} of {self._robot.joint_names[j]}"
            for kind, joints in kinds
            for side in ("upper", "lower")
            for j in joints
        )
        return Expressed(build, samples, least, labels)

    def watch(self, rows: SoftRows) -> bool:
        """Add rows for the joints and samples whose torque is too large in `rows`; return whether any is new.

        A rejected step showed that they matter, although they were far from their limit where the step began.
        """
        if rows.exceeded is None or not (rows.exceeded & ~self._watched).any():
            return False
        self._watched |= rows.exceeded
        return True


def _at_rest(Q: Array) -> tuple[Array, Array, Array]:
    return Q, np.zeros_like(Q), np.zeros_like(Q)
