"""Bounds on the second derivative of joint torques in time: inverse dynamics with norms in place of vectors."""

from dataclasses import dataclass
from functools import cached_property
from math import comb

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array

_ORDERS = 5  # derivatives 0 to 4 of the motion decide the second derivative of a torque


def product(x: Array, y: Array, order: int) -> Array:
    """Leibniz' rule: sum_l C(order, l) |x^(l)| |y^(order - l)| >= |(x y)^(order)|; x, y (orders, K), result (K,)."""
    return np.asarray(sum(comb(order, k) * x[k] * y[order - k] for k in range(order + 1)))


@dataclass(frozen=True, eq=False)
class _Body:
    """Bounds of one body on K intervals, all in world axes: each (orders, K), from derivative 0 on.

    `turn`: angular velocity, up to its third derivative. `fixed`: a unit vector that the body carries, up to the
    fourth. `origin`: position of its joint, of which derivatives 2 to 4 count, m/s^k.
    """

    turn: Array
    origin: Array

    @cached_property
    def fixed(self) -> Array:
        """From z' = omega x z: |z^(k+1)| <= sum_l C(k, l) |omega^(k-l)| |z^(l)|."""
        found = np.ones((_ORDERS, self.turn.shape[1]))
        for k in range(_ORDERS - 1):
            found[k + 1] = product(self.turn, found, k)
        return found

    @cached_property
    def tensor(self) -> Array:
        """Return the bounds for a tensor of norm 1: T' = [omega] T - T [omega], up to the third derivative."""
        found = np.ones((_ORDERS - 1, self.turn.shape[1]))
        for k in range(_ORDERS - 2):
            found[k + 1] = 2.0 * product(self.turn, found, k)
        return found


class TorqueBounds:
    """Newton's and Euler's equations of a tree of revolute and prismatic joints, differentiated twice, in norms.

    With z_j the axis of joint j, o_j a point on it, c_i and H_i = I_i omega_i centre and angular momentum of body i,
        tau_j = z_j . n_j + armature_j q_j''      (revolute),      tau_j = z_j . f_j + armature_j q_j''  (prismatic),
        f_j = sum_i m_i (c_i'' - g),              n_j = sum_i (c_i - o_j) x m_i (c_i'' - g) + H_i'
    over the bodies i that joint j carries. Every vector is differentiated by Leibniz' rule, every product of vectors is
    no longer than the product of their lengths. Friction is not modelled.

    Joints of the model may follow those of the robot: q_model = A q + b, of which tau = A^T tau_model.
    """

    def __init__(self, model: pin.Model, A: Array | None = None, b: Array | None = None) -> None:
        self._A = np.eye(model.nv) if A is None else np.abs(A)
        self._b = np.zeros(model.nv) if b is None else np.abs(b)
        self._parents = [int(parent) for parent in model.parents]
        self._columns = [joint.idx_v for joint in model.joints]
        self._slides = [joint.shortname().startswith("JointModelP") for joint in model.joints]
        self._offset = [float(np.linalg.norm(M.translation)) for M in model.jointPlacements]
        self._mass = [float(body.mass) for body in model.inertias]
        self._lever = [float(np.linalg.norm(body.lever)) for body in model.inertias]
        self._inertia = [float(np.linalg.norm(body.inertia, 2)) for body in model.inertias]
        self._armature, self._gravity = np.array(model.armature), float(np.linalg.norm(model.gravity.linear))

    def over(self, motion: Array) -> tuple[Array, Array]:
        """Bounds over K intervals on the sum of all that adds up to tau_j, N·m (N), and on |tau_j''|: (K, n) each.

        Args:
            motion: (5, K, n) bounds on |q_j^(k)| over each interval, k from 0 to 4, rad/s^k or m/s^k.
        """
        motion = motion @ self._A.T
        motion[0] += self._b
        bodies = [_Body(np.zeros((4, motion.shape[1])), np.zeros((_ORDERS, motion.shape[1])))]
        for j in range(1, len(self._parents)):
            bodies.append(self._next(bodies[self._parents[j]], j, motion[:, :, self._columns[j]]))
        force = np.zeros((len(bodies), 3, motion.shape[1]))
        moment = np.zeros_like(force)
        size, curvature = np.empty((2, *motion.shape[1:]))
        for j in reversed(range(1, len(bodies))):
            column, before = self._columns[j], bodies[self._parents[j]]
            own_force, own_moment = self._own(bodies[j], j)
            force[j] += own_force
            moment[j] += own_moment
            carried = force[j] if self._slides[j] else moment[j]
            size[:, column] = carried[0] + self._armature[column] * motion[2, :, column]
            curvature[:, column] = product(before.fixed, carried, 2) + self._armature[column] * motion[4, :, column]
            self._hand_down(force, moment, (j, before), motion[:, :, column])
        return size @ self._A, curvature @ self._A

    def _next(self, before: _Body, j: int, q: Array) -> _Body:
        """Body j from the one that carries its joint, whose position, velocity … are bounded by q (5, K)."""
        origin = before.origin + self._offset[j] * before.fixed
        turn = before.turn
        if self._slides[j]:
            origin = origin + np.stack([product(before.fixed, q, k) for k in range(_ORDERS)])
        else:
            turn = turn + np.stack([product(before.fixed, q[1:], k) for k in range(_ORDERS - 1)])
        return _Body(turn, origin)

    def _own(self, body: _Body, j: int) -> tuple[Array, Array]:
        """Force, N, and moment about its joint, N·m, that accelerate body j, and two derivatives: (3, K) each."""
        arm = self._lever[j] * body.fixed
        force = self._mass[j] * (body.origin + arm)[2:]
        force[0] += self._mass[j] * self._gravity
        spin = [self._inertia[j] * product(body.tensor, body.turn, k) for k in range(1, 4)]
        return force, np.stack([product(arm, force, k) + spin[k] for k in range(3)])

    def _hand_down(self, force: Array, moment: Array, place: tuple[int, _Body], q: Array) -> None:
        """Add what joint j transmits to the body before it: f, and n + (o_j - o_before) x f."""
        j, before = place
        parent = self._parents[j]
        arm = self._offset[j] * before.fixed
        if self._slides[j]:
            arm = arm + np.stack([product(before.fixed, q, k) for k in range(_ORDERS)])
        force[parent] += force[j]
        moment[parent] += moment[j] + np.stack([product(arm, force[j], k) for k in range(3)])
