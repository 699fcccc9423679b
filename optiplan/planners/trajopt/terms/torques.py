"""Torque limits of the planned joints."""

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

TORQUE_SHARE = 0.6
"""Torques above this share of their limit get a row."""

TORQUE_PENALTY = 2.0
"""Price of a torque that exceeds its limit by the limit itself at one sample."""


class TorqueTerm:
    """Rows 1 -+ tau / limit, with pinocchio's analytic derivatives of inverse dynamics. Holds at: samples."""

    name = "torque"
    price, unit, negligible, decides = TORQUE_PENALTY, 1.0, 0.01, False

    def __init__(self, robot: Robot, limit: Array) -> None:
        self.limit = limit
        self._robot = robot
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
        """Return rows 1 - |tau_j| / limit_j >= 0 of joints, samples above `TORQUE_SHARE` of the limit, or watched."""
        if not len(self._limited):
            return SoftRows.none(curve.variables)
        motion = curve.motion
        tau = inverse_dynamics(self._robot, *motion)
        share = tau[:, self._limited] / self.limit[self._limited]
        exceeded: Mask = np.abs(share) > 1.0
        sample, which = np.nonzero((np.abs(share) > TORQUE_SHARE) | self._watched)
        if not len(sample):
            return SoftRows.none(curve.variables, exceeded)
        hot, back = np.unique(sample, return_inverse=True)
        derivatives = self._derivatives([part[hot] for part in motion])
        sign, joint = np.sign(share[sample, which]), self._limited[which]
        scale = -sign / self.limit[joint]
        by_q, by_v, by_a = (matrix[back, joint] * scale[:, None] for matrix in derivatives)
        return curve.rows(sample, 1.0 - np.abs(share[sample, which]), (by_q, by_v, by_a), exceeded)

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
        """Return 1 - tau / limit and 1 + tau / limit of the limited joints, at all samples."""
        from optiplan.planners.path_constraints.parts import stacked

        def build(k: "SymbolicState") -> Any:
            if not len(self._limited):
                return stacked()
            share = k.torque()[self._limited.tolist()] * k.constant(1.0 / self.limit[self._limited])
            return stacked(1.0 - share, 1.0 + share)

        samples = np.arange(len(self._watched))
        names = [f"torque of {self._robot.joint_names[j]}" for j in self._limited]
        labels = (*(f"upper {name}" for name in names), *(f"lower {name}" for name in names))
        return Expressed(build, samples, lambda curve: np.zeros((len(samples), len(labels))), labels)

    def watch(self, rows: SoftRows) -> bool:
        """Add rows for the joints and samples whose torque is too large in `rows`; return whether any is new.

        A rejected step showed that they matter, although they were far from their limit where the step began.
        """
        if rows.exceeded is None or not (rows.exceeded & ~self._watched).any():
            return False
        self._watched |= rows.exceeded
        return True
