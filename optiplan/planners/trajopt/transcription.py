"""Cost and constraint violations of a curve at its samples, and their derivatives by the control points."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from optiplan.arrays import Array, Index
from optiplan.collision.model import CollisionModel, Contacts
from optiplan.planners.trajopt.bspline_basis import FIXED, SplineBasis
from optiplan.problem.problem import Problem
from optiplan.robot.mimic_joints import unfold

if TYPE_CHECKING:
    import scipy.sparse as sp

CUTOFF = 0.04
"""Pairs nearer than this, m, get a row in the quadratic program."""

TORQUE_SHARE = 0.6
"""Torques above this share of their limit get a row."""


Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class SoftRows:
    """Linearised inequalities g_k + dg_k >= 0 at samples of the curve, one slack a sample.

    Attributes:
        sample: (K,) sample of each row.
        value: (K,) g_k: m for contacts, share of the limit for torques.
        by_control: (K, M n) derivative with respect to the free control points, one control point after another.
        by_duration: (K,) derivative with respect to T.
        exceeded: (N, limited joints) where torque is above its limit, for rows of torques.
    """

    sample: npt.NDArray[np.intp]
    value: Array
    by_control: Array
    by_duration: Array
    exceeded: Mask | None = None

    @classmethod
    def none(cls, free: int, exceeded: Mask | None = None) -> "SoftRows":
        """Return no rows, for `free` = M n variables."""
        return cls(np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros((0, free)), np.zeros(0), exceeded)

    def only(self, kept: Mask) -> "SoftRows":
        """Return the rows selected by `kept` (K,)."""
        if kept.all():
            return self
        return replace(
            self,
            sample=self.sample[kept],
            value=self.value[kept],
            by_control=self.by_control[kept],
            by_duration=self.by_duration[kept],
        )

    def violation(self) -> float:
        """Return the sum over the samples of the worst violation of each."""
        if not len(self.value):
            return 0.0
        worst = np.zeros(int(self.sample.max()) + 1)
        np.maximum.at(worst, self.sample, -self.value)
        return float(worst.sum())


_KEPT = 0.6
"""Share of a pair's clearance at an end that is aimed at near this end, where the pair is nearer than the margin."""


@dataclass(frozen=True, eq=False)
class Margins:
    """Desired clearance along the curve (soft), for each pair at most what its ends allow.

    For a pair nearer than the margin at one end, the margin rises linearly to the clearance at the other end; for one
    near at both ends it stays as small.

    Attributes:
        middle: m, of pairs that are far apart at both ends.
        start: (P,) clearance of each pair at the start, m, as far as it is known: at least `CUTOFF` beyond that.
        end: (P,) the same at the end.
    """

    middle: float
    start: Array
    end: Array

    @classmethod
    def between(cls, model: CollisionModel, ends: Array, middle: float) -> "Margins":
        """Return the margins of a curve between two configurations, `ends` (2, n)."""
        clearance = np.full((2, len(model.pairs)), CUTOFF)
        found = model.near(ends, CUTOFF)
        clearance[found.rows, found.pairs] = np.maximum(found.distance, 0.0)
        return cls(middle, clearance[0], clearance[1])

    def at(self, u: Array, pairs: npt.NDArray[np.intp]) -> Array:
        """Return margins (K,), m, of pairs (K,) at fractions u (K,) of the duration."""
        ends = (1.0 - u) * self.start[pairs] + u * self.end[pairs]
        return np.minimum(self.middle, _KEPT * ends)


class JerkCost(NamedTuple):
    """Cost and its derivatives: `hessian` (M n, M n) sparse and `gradient` (M n,) by the free control points."""

    cost: float
    hessian: "sp.csc_matrix"
    gradient: Array
    by_duration: float


class Transcription:
    """Constraints and cost as functions of control points C (K, n) and duration T, at chosen samples of u.

    Collision rows: d + grad d . (B dC) - margin, from coal's witness points, exact shapes. Torque rows:
    1 -+ tau / limit, with pinocchio's analytic derivatives of inverse dynamics. Holds at: samples; contacts between
    them are found by continuous collision checking, which adds samples.
    """

    def __init__(self, problem: Problem, model: CollisionModel, basis: SplineBasis, margins: Margins) -> None:
        self.basis, self.model, self.margins = basis, model, margins
        self.limits = problem.limits
        self.rates = problem.limits.rates
        self.objective = problem.objective
        self._pin = problem.robot.model
        self._data = self._pin.createData()
        self._plain = unfold(self._pin)  # pinocchio's derivatives do not support mimic joints
        self._plain_data = self._plain.model.createData()
        self._limited = np.flatnonzero(np.isfinite(problem.limits.torque))
        self.u = np.zeros(0)

    def set_samples(self, u: Array) -> None:
        """Set the instants, as fractions of the duration, at which contacts and torques are evaluated."""
        self.u = np.unique(u)
        self.at = [self.basis.at(self.u, order) for order in range(3)]
        self._watched: Mask = np.zeros((len(self.u), len(self._limited)), dtype=bool)

    def contacts(self, control: Array) -> SoftRows:
        """Return the rows of all pairs nearer than the cutoff."""
        sample, value, gradient = self.near(self.at[0] @ control)
        return SoftRows(sample, value, self._spread(gradient, self.at[0][sample]), np.zeros(len(value)))

    def near(self, Q: Array) -> tuple[Index, Array, Array]:
        """Sample (K,), clearance beyond the margin (K,), m, its gradient (K, n), of pairs near at Q (N, n)."""
        found = _pushed_one_way(self.model.near(Q, CUTOFF))
        value = found.distance - self.margins.at(self.u[found.rows], found.pairs)
        return found.rows, value, self.model.gradients(Q, found)

    def jerk_cost(self, control: Array, duration: float) -> JerkCost:
        """Return the cost w * (integral of squared jerk) = w T^-5 C' H C, with w from the objective."""
        import scipy.sparse as sp

        joints, free = control.shape[1], self.basis.free
        if self.objective.jerk == 0.0:
            moving = (self.basis.size - 2 * FIXED) * joints
            return JerkCost(0.0, sp.csc_matrix((moving, moving)), np.zeros(moving), 0.0)
        scale = self.objective.jerk * duration**-5
        push = self.basis.jerk_gram @ control
        cost = scale * float(np.sum(control * push))
        hessian = sp.kron(2.0 * scale * self.basis.jerk_gram[free, free], sp.eye(joints), format="csc")
        return JerkCost(cost, hessian, 2.0 * scale * push[free].ravel(), -5.0 * cost / duration)

    def torques(self, control: Array, duration: float) -> SoftRows:
        """Return rows 1 - |tau_j| / limit_j >= 0 of joints, samples above `TORQUE_SHARE` of the limit, or watched."""
        free = (self.basis.size - 2 * FIXED) * control.shape[1]
        if not len(self._limited):
            return SoftRows.none(free)
        motion = [matrix @ control / duration**order for order, matrix in enumerate(self.at)]
        tau = np.array([pin.rnea(self._pin, self._data, q, v, a) for q, v, a in zip(*motion, strict=True)])
        share = tau[:, self._limited] / self.limits.torque[self._limited]
        exceeded: Mask = np.abs(share) > 1.0
        sample, which = np.nonzero((np.abs(share) > TORQUE_SHARE) | self._watched)
        if not len(sample):
            return SoftRows.none(free, exceeded)
        hot, back = np.unique(sample, return_inverse=True)
        derivatives = self._torque_derivatives([part[hot] for part in motion])
        sign, joint = np.sign(share[sample, which]), self._limited[which]
        scale = -sign / self.limits.torque[joint]
        rows = [matrix[back, joint] * scale[:, None] for matrix in derivatives]  # by q, v, a: (R, n) each
        by_control = sum(
            self._spread(row, matrix[sample] / duration**order)
            for order, (row, matrix) in enumerate(zip(rows, self.at, strict=True))
        )
        by_duration = -np.einsum("rj,rj->r", rows[1], motion[1][sample])
        by_duration -= 2.0 * np.einsum("rj,rj->r", rows[2], motion[2][sample])
        value = 1.0 - np.abs(share[sample, which])
        return SoftRows(sample, value, np.asarray(by_control), by_duration / duration, exceeded)

    def _torque_derivatives(self, motion: list[Array]) -> list[Array]:
        """Return the derivatives of inverse dynamics by q, v and a, (H, n) each: three arrays (H, n, n)."""
        A, b, data = self._plain.A, self._plain.b, self._plain_data
        by_q, by_v, mass = (np.empty((len(motion[0]), len(A), len(A))) for _ in range(3))
        states = zip(motion[0] @ A.T + b, motion[1] @ A.T, motion[2] @ A.T, strict=True)
        for row, (q, v, a) in enumerate(states):
            pin.computeRNEADerivatives(self._plain.model, data, q, v, a)
            by_q[row], by_v[row], mass[row] = data.dtau_dq, data.dtau_dv, data.M
        upper = np.triu(mass)  # pinocchio fills the upper half of the mass matrix only
        mass = upper + np.triu(upper, 1).transpose(0, 2, 1)
        return [A.T @ matrix @ A for matrix in (by_q, by_v, mass)]

    def watch(self, torques: SoftRows) -> bool:
        """Add rows for the joints and samples whose torque is too large in `torques`; return whether any is new.

        A rejected step showed that they matter, although they were far from their limit where the step began.
        """
        if torques.exceeded is None or not (torques.exceeded & ~self._watched).any():
            return False
        self._watched |= torques.exceeded
        return True

    def _spread(self, gradient: Array, basis: Array) -> Array:
        """Chain rule q = B C: from d/dq (K, n) to d/dC of the free control points, one after another (K, M n)."""
        product = basis[:, self.basis.free, None] * gradient[:, None, :]
        return np.asarray(product.reshape(len(gradient), product.shape[1] * product.shape[2]))


def _pushed_one_way(contacts: Contacts) -> Contacts:
    """Give a pair that penetrates at consecutive samples the mean of its normals at all of them.

    In deep penetration the nearest way out changes sides from sample to sample, and pushing a
    curve both ways at once leaves it in place. Where bodies are apart the normals are unchanged.
    """
    inside = np.flatnonzero(contacts.distance < 0.0)
    inside = inside[np.lexsort((contacts.rows[inside], contacts.pairs[inside]))]
    pairs, rows = contacts.pairs[inside], contacts.rows[inside]
    breaks = np.flatnonzero((np.diff(pairs) != 0) | (np.diff(rows) > 1)) + 1
    normals = contacts.normals.copy()
    for run in np.split(inside, breaks):
        mean = normals[run].sum(axis=0)
        length = float(np.linalg.norm(mean))
        if length > 0.0:
            normals[run] = mean / length
    return replace(contacts, normals=normals)
