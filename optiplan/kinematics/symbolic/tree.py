"""The joint tree of a pinocchio model as CasADi expressions: poses, Jacobians, inverse dynamics.

Motions are pairs (linear, angular) and forces pairs (force, moment), in the axes and at the origin of a joint's frame,
as in pinocchio. Source of the recursions: Featherstone, Rigid Body Dynamics Algorithms, 2008, tables 5.1 and 2.8.
"""

from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.kinematics.symbolic.compiled import load_casadi
from optiplan.records import dataclass

KINDS = {
    "JointModelR": "revolute",
    "JointModelRUB": "continuous",
    "JointModelP": "prismatic",
    "JointModelRevoluteUnaligned": "revolute",
    "JointModelRevoluteUnboundedUnaligned": "continuous",
    "JointModelPrismaticUnaligned": "prismatic",
    "JointModelPlanar": "planar",
}
"""Pinocchio's joint models, the axis letter apart, and what they are here."""

_NOISE = 1e-15  # a rotation by pi/2 leaves 6e-17 where a zero is meant; a zero makes the expression shorter

Expression = Any
"""A CasADi SX matrix; CasADi ships no types."""
Placement = tuple[Expression, Expression]


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint and the body behind it.

    X_PJ, the placement in the parent joint's frame, is (R, p); `screws` (6, nv) are the constant columns
    (linear, angular) of its motion subspace in its own frame; `q` and `v` are its places in the configuration and in
    the velocity; `mass` in kg, `lever` (3,) of the centre of mass in m, `inertia` (3, 3) about it in kg m²; `armature`
    (nv,) in kg m² or kg.
    """

    kind: str
    parent: int
    R: Array
    p: Array
    screws: Array
    q: slice
    v: slice
    mass: float
    lever: Array
    inertia: Array
    armature: Array


def read_tree(model: pin.Model) -> tuple[Joint, ...]:
    """The joints of a model, from base to tips; the world, which pinocchio counts as joint 0, is left out.

    Raises:
        ValueError: a joint that is not revolute, continuous, prismatic or planar.
    """
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    return tuple(_read_joint(model, data, index) for index in range(1, model.njoints))


def _read_joint(model: pin.Model, data: pin.Data, index: int) -> Joint:
    joint, placement, body = model.joints[index], model.jointPlacements[index], model.inertias[index]
    kind = KINDS.get(joint.shortname()) or KINDS.get(joint.shortname().rstrip("XYZ"))
    if kind is None:
        valid = ", ".join(sorted(set(KINDS.values())))
        raise ValueError(f"joint '{model.names[index]}' is a {joint.shortname()}; the symbolic twin knows {valid}")
    v = slice(joint.idx_v, joint.idx_v + joint.nv)
    return Joint(
        kind=kind,
        parent=int(model.parents[index]),
        R=_clean(placement.rotation),
        p=_clean(placement.translation),
        screws=_clean(data.oMi[index].toActionMatrixInverse() @ data.J.reshape(6, -1)[:, v]),
        q=slice(joint.idx_q, joint.idx_q + joint.nq),
        v=v,
        mass=float(body.mass),
        lever=np.array(body.lever),
        inertia=np.array(body.inertia),
        armature=np.array(model.armature[v]),
    )


def joint_transforms(tree: tuple[Joint, ...], q: Expression) -> list[Placement]:
    """X_PJ(q) of each joint in its parent, as (R, p)."""
    return [_transform(joint, q[joint.q]) for joint in tree]


def world_poses(tree: tuple[Joint, ...], q: Expression) -> list[Placement]:
    """X_WJ of the world (first) and of each joint, as (R, p): X_WJ = X_WP X_PJ(q)."""
    casadi = load_casadi()
    poses: list[Placement] = [(casadi.SX.eye(3), casadi.SX.zeros(3))]
    for joint, (R, p) in zip(tree, joint_transforms(tree, q), strict=True):
        R_WP, p_WP = poses[joint.parent]
        poses.append((R_WP @ R, p_WP + R_WP @ p))
    return poses


def symbolic_frame_pose(poses: list[Placement], frame: pin.Frame) -> Placement:
    """X_WF of a frame fixed to a joint, as (R, p)."""
    R, p = poses[frame.parentJoint]
    return R @ _clean(frame.placement.rotation), p + R @ _clean(frame.placement.translation)


def frame_jacobian(tree: tuple[Joint, ...], poses: list[Placement], joint: int, p_F: Expression) -> Expression:
    """J (6, nv) of a point p_F (3,) fixed to `joint`: rows are its linear velocity and the angular one, in world axes.

    The column of a unit screw (l, w) given in the frame of joint j is (R l + R w x (p_F - p_j), R w), R = R_Wj.
    """
    casadi = load_casadi()
    J = casadi.SX.zeros(6, sum(item.screws.shape[1] for item in tree))
    while joint > 0:
        R, p = poses[joint]
        for column, screw in zip(range(J.shape[1])[tree[joint - 1].v], tree[joint - 1].screws.T, strict=True):
            turn = R @ screw[3:]
            J[:3, column] = R @ screw[:3] + casadi.cross(turn, p_F - p)
            J[3:, column] = turn
        joint = tree[joint - 1].parent
    return J


def centre_of_mass(tree: tuple[Joint, ...], poses: list[Placement]) -> Expression:
    """p_WC (3,) = sum of m_i p_i / sum of m_i."""
    moment = sum(joint.mass * (p + R @ joint.lever) for joint, (R, p) in zip(tree, poses[1:], strict=True))
    return moment / sum(joint.mass for joint in tree)


def symbolic_inverse_dynamics(
    tree: tuple[Joint, ...], q: Expression, v: Expression, a: Expression, gravity: Array
) -> Expression:
    """Joint torques and forces tau (nv,) = M(q) a + C(q, v) v + g(q), by the recursive Newton–Euler algorithm.

    `gravity` (3,) is the linear acceleration of free fall in the world, m/s². As in pinocchio, armature counts and
    friction does not.
    """
    return symbolic_forces(tree, q, v, a, gravity)[0]


def symbolic_forces(
    tree: tuple[Joint, ...], q: Expression, v: Expression, a: Expression, gravity: Array
) -> tuple[Expression, Expression]:
    """Return tau (nv,) as `symbolic_inverse_dynamics`, and the wrench [F; M] (6,) that moves all bodies of the joints.

    The wrench is about the world's origin, in world axes, N and N·m.
    """
    casadi = load_casadi()
    still = casadi.SX.zeros(3)
    transforms = joint_transforms(tree, q)
    velocities: list[Placement] = [(still, still)]
    accelerations: list[Placement] = [(casadi.SX(-_clean(gravity)), still)]
    forces: list[Placement] = [(still, still)]
    for joint, X in zip(tree, transforms, strict=True):
        own = _split(joint.screws @ v[joint.v])
        velocity = _add(_to_child(X, velocities[joint.parent]), own)
        drift = casadi.cross(velocity[1], own[0]) + casadi.cross(velocity[0], own[1]), casadi.cross(velocity[1], own[1])
        push = _split(joint.screws @ a[joint.v])
        acceleration = _add(_add(_to_child(X, accelerations[joint.parent]), push), drift)
        forces.append(_add(_momentum(joint, acceleration), _cross_force(velocity, _momentum(joint, velocity))))
        velocities.append(velocity)
        accelerations.append(acceleration)
    tau = casadi.SX.zeros(v.shape[0])
    for index in range(len(tree), 0, -1):
        joint, X = tree[index - 1], transforms[index - 1]
        tau[joint.v] = joint.screws.T @ casadi.vertcat(*forces[index]) + joint.armature * a[joint.v]
        forces[joint.parent] = _add(forces[joint.parent], _force_to_parent(X, forces[index]))
    return tau, casadi.vertcat(*forces[0])


def tangent(tree: tuple[Joint, ...], q: Expression, nv: int) -> Expression:
    """G (nq, nv) with dq/dt = G(q) v: the identity, but for joints that keep their angle as (cos, sin)."""
    casadi = load_casadi()
    G = casadi.SX.zeros(q.shape[0], nv)
    for joint in tree:
        if joint.kind in ("revolute", "prismatic"):
            G[joint.q, joint.v] = 1.0
            continue
        cosine, sine = q[joint.q][-2], q[joint.q][-1]
        turn = casadi.vertcat(-sine, cosine)
        if joint.kind == "continuous":
            G[joint.q, joint.v] = turn
        else:
            G[joint.q, joint.v] = casadi.diagcat(casadi.horzcat(casadi.vertcat(cosine, sine), turn), turn)
    return G


def determinant(A: Expression) -> Expression:
    """Determinant of a square matrix without division, from the minors of its first rows: k 2^(k-1) products."""
    size = A.shape[0]
    minors: dict[int, Expression] = {0: load_casadi().SX(1.0)}
    for row in range(size):
        grown: dict[int, Expression] = {}
        for columns, minor in minors.items():
            for j in range(size):
                if not columns >> j & 1:
                    sign = -1.0 if (columns >> j).bit_count() % 2 else 1.0
                    term = sign * A[row, j] * minor
                    grown[columns | 1 << j] = grown[columns | 1 << j] + term if columns | 1 << j in grown else term
        minors = grown
    return minors[(1 << size) - 1]


def _transform(joint: Joint, q: Expression) -> Placement:
    """X_PJ(q) = X_PJ(0) exp([S] q), as (R, p)."""
    casadi = load_casadi()
    if joint.kind == "prismatic":
        return casadi.SX(joint.R), joint.p + joint.R @ (joint.screws[:3, 0] * q)
    if joint.kind == "revolute":
        cosine, sine = casadi.cos(q), casadi.sin(q)
    else:
        cosine, sine = q[-2], q[-1]
    axis = joint.screws[3:, -1]
    outer = np.outer(axis, axis)
    turn = sine * pin.skew(axis) + cosine * _clean(np.eye(3) - outer) + outer
    p = joint.p + joint.R @ casadi.vertcat(q[0], q[1], 0.0) if joint.kind == "planar" else casadi.SX(joint.p)
    return joint.R @ turn, p


def _to_child(X: Placement, motion: Placement) -> Placement:
    """A motion of the parent's frame, seen from the child's: (R^T (l + w x p), R^T w)."""
    R, p = X
    return R.T @ (motion[0] + load_casadi().cross(motion[1], p)), R.T @ motion[1]


def _force_to_parent(X: Placement, force: Placement) -> Placement:
    """A force of the child's frame, seen from the parent's: (R f, R n + p x R f)."""
    R, p = X
    push = R @ force[0]
    return push, R @ force[1] + load_casadi().cross(p, push)


def _momentum(joint: Joint, motion: Placement) -> Placement:
    """I (l, w) = (f, I_C w + c x f) with f = m (l - c x w)."""
    casadi = load_casadi()
    lever = casadi.SX(_clean(joint.lever))
    push = joint.mass * (motion[0] - casadi.cross(lever, motion[1]))
    return push, _clean(joint.inertia) @ motion[1] + casadi.cross(lever, push)


def _cross_force(motion: Placement, force: Placement) -> Placement:
    """(l, w) x* (f, n) = (w x f, w x n + l x f)."""
    casadi = load_casadi()
    return casadi.cross(motion[1], force[0]), casadi.cross(motion[1], force[1]) + casadi.cross(motion[0], force[0])


def _add(a: Placement, b: Placement) -> Placement:
    return a[0] + b[0], a[1] + b[1]


def _split(vector: Expression) -> Placement:
    return vector[:3], vector[3:]


def _clean(values: Array) -> Array:
    values = np.array(values)
    return np.where(np.abs(values) < _NOISE, 0.0, values)
