"""Bounds on the second derivative of joint torques in time: inverse dynamics with norms in place of vectors."""

from math import factorial

import numpy as np
import pinocchio as pin

from optiplan._core import core
from optiplan.arrays import Array, Flags, Index
from optiplan.robot.native_tree import tree_of

_ORDERS = 5  # derivatives 0 to 4 of the motion decide the second derivative of a torque
_FACTORIALS = np.array([float(factorial(k)) for k in range(_ORDERS)])


def product(x: Array, y: Array, orders: int) -> Array:
    """Leibniz' rule: bounds on |(x y)^(k)| / k! for k < orders, from those on x and y: sum_l x_l y_(k - l).

    Args:
        x: (orders or more, …) bounds |x^(k)| / k!.
        y: the same of y.
        orders: how many.
    """
    result = x[0] * y[:orders]
    for k in range(1, orders):
        result[k:] += x[k] * y[: orders - k]
    return np.asarray(result)


def rotated(turn: Array, rate: float, orders: int) -> Array:
    """Bounds z_k >= |z^(k)| / k!, k < orders, of what turns with omega: |z| = 1, |z'| <= rate |omega| |z|.

    (k + 1) z_(k + 1) = rate sum_l omega_l z_(k - l); `turn` (4, …) bounds |omega^(k)| / k!.
    """
    found = np.ones((orders, *turn.shape[1:]))
    for k in range(orders - 1):
        found[k + 1] = rate / (k + 1) * _coefficient(turn, found, k)
    return found


def _coefficient(x: Array, y: Array, k: int) -> Array:
    """Coefficient k of `product`."""
    return np.asarray((x[: k + 1] * y[k::-1]).sum(axis=0))


class TorqueBounds:
    """Newton's and Euler's equations of a tree of revolute and prismatic joints, differentiated twice, in norms.

    With z_j the axis of joint j, o_j a point on it, c_i and H_i = I_i omega_i centre and angular momentum of body i,
        tau_j = z_j . n_j + armature_j q_j''      (revolute),      tau_j = z_j . f_j + armature_j q_j''  (prismatic),
        f_j = sum_i m_i (c_i'' - g),              n_j = sum_i (c_i - o_j) x m_i (c_i'' - g) + H_i'
    over the bodies i that joint j carries. Every vector is differentiated by Leibniz' rule, every product of vectors is
    no longer than the product of their lengths; a unit vector z and a tensor T that turn with omega obey z' = omega x z
    and T' = [omega] T - T [omega]. Friction is not modelled.

    Joints of the model may follow those of the robot: q_model = A q + b, of which tau = A^T tau_model.

    The core, where it is built, computes the same in a tenth of the time.
    """

    def __init__(self, model: pin.Model, A: Array | None = None, b: Array | None = None) -> None:
        A, b = np.eye(model.nv) if A is None else A, np.zeros(model.nv) if b is None else b
        self._A, self._b = np.abs(A), np.abs(b)
        armature = (self._A**2).T @ np.array(model.armature)  # a follower's turns with its multiplier
        self._native = None if core is None else core.TorqueBounds.of(tree_of(model, A, b), armature)
        self._parents = [int(parent) for parent in model.parents]
        # Of all joints, the world's included, in whose place stands any other: it transmits nothing.
        self._columns: Index = np.array([max(joint.idx_v, 0) for joint in model.joints], dtype=np.intp)
        self._slides: Flags = np.array([joint.shortname().startswith("JointModelP") for joint in model.joints])
        self._offset = np.array([float(np.linalg.norm(M.translation)) for M in model.jointPlacements])[:, None]
        self._mass = np.array([float(body.mass) for body in model.inertias])[:, None]
        self._lever = np.array([float(np.linalg.norm(body.lever)) for body in model.inertias])[:, None]
        self._inertia = np.array([float(np.linalg.norm(body.inertia, 2)) for body in model.inertias])[:, None]
        self._armature = np.array(model.armature)[self._columns, None]
        self._gravity = float(np.linalg.norm(model.gravity.linear))
        # Row j: what body j stands on, itself included; its transpose sums over what stands on a body.
        self._carried = np.eye(model.njoints)
        for j in range(1, model.njoints):
            self._carried[j] += self._carried[self._parents[j]]

    def over(self, motion: Array) -> tuple[Array, Array]:
        """Bounds over K intervals on the sum of all that adds up to tau_j, N·m (N), and on |tau_j''|: (K, n) each.

        Args:
            motion: (5, K, n) bounds on |q_j^(k)| over each interval, k from 0 to 4, rad/s^k or m/s^k.
        """
        if self._native is not None:
            return self._native.over(np.ascontiguousarray(motion))
        # From here on bounds are |x^(k)| / k!, so that Leibniz' rule has no factors.
        q = (motion @ self._A.T) / _FACTORIALS[:, None, None]
        q[0] += self._b
        q = q[:, :, self._columns].transpose(0, 2, 1)  # (5, B, K), of the joint before each body, but for the world's
        turn, fixed, origin = self._bodies(q)
        force, moment = self._own(turn, fixed, origin)
        axis = fixed[:3, self._parents]
        # What a joint transmits to the body before it: f, and n + (o_j - o_before) x f.
        arm = self._offset * axis
        if self._slides.any():
            arm[:, self._slides] += product(axis[:, self._slides], q[:, self._slides], 3)
        force = self._carried.T @ force
        moved = product(arm, force, 3)
        moment = self._carried.T @ (moment + moved) - moved
        carried = moment
        carried[:, self._slides] = force[:, self._slides]
        size = carried[0] + 2.0 * self._armature * q[2]
        second = axis[0] * carried[2] + axis[1] * carried[1] + axis[2] * carried[0]
        curvature = 2.0 * second + 24.0 * self._armature * q[4]
        A = self._A[self._columns[1:]]
        return size[1:].T @ A, curvature[1:].T @ A

    def _bodies(self, q: Array) -> tuple[Array, Array, Array]:
        """Bounds of all B bodies in world axes, from those of the joints before them, q (5, B, K).

        Returns:
            Angular velocity (4, B, K), rad/s; a unit vector that the body carries (5, B, K); position of its joint, of
            which derivatives 2 to 4 count (5, B, K), m.
        """
        turn, fixed = np.empty((_ORDERS - 1, *q.shape[1:])), np.ones_like(q)
        rates = q[1:] * np.arange(1.0, _ORDERS)[:, None, None]  # of joint velocities
        rates[:, 0] = rates[:, self._slides] = 0.0  # of those that turn
        axis = np.ones_like(q)
        for k in range(_ORDERS - 1):  # of a product only lower orders count
            turn[k] = self._carried @ _coefficient(axis, rates, k)
            fixed[k + 1] = _coefficient(turn, fixed, k) / (k + 1)
            axis[k + 1] = fixed[k + 1, self._parents]
        origin = self._offset * axis
        if self._slides.any():
            origin[:, self._slides] += product(axis[:, self._slides], q[:, self._slides], _ORDERS)
        origin[:, 0] = 0.0
        return turn, fixed, self._carried @ origin

    def _own(self, turn: Array, fixed: Array, origin: Array) -> tuple[Array, Array]:
        """Force, N, and moment about its joint, N·m, that accelerate each body, and two derivatives: (3, B, K) each."""
        arm = self._lever * fixed
        second = np.array([2.0, 6.0, 12.0])[:, None, None]  # (k + 2)! / k!
        force = self._mass * second * (origin + arm)[2:]
        force[0] += self._mass * self._gravity
        spin = product(rotated(turn, 2.0, _ORDERS - 1), turn, _ORDERS - 1)[1:]
        spin *= np.arange(1.0, _ORDERS - 1)[:, None, None] * self._inertia
        moment = product(arm, force, 3) + spin
        force[:, 0], moment[:, 0] = 0.0, 0.0  # of the world
        return force, moment
