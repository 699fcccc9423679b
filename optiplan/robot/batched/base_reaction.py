"""The wrench that the ground exerts on a robot's base, of many states at once, in NumPy."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, cross
from optiplan.robot.robot import Robot


def base_reaction(robot: Robot, Q: Array, V: Array, A: Array) -> Array:
    """Wrenches [F; M] (N, 6) of the ground on the base, about the world's origin, in world axes: N and N·m.

    F = sum_b m_b (a_b - g) and M = sum_b c_b × m_b (a_b - g) + I_b alpha_b + omega_b × I_b omega_b, over all bodies b,
    the base with what is fixed to it included; c_b and a_b are the place and the acceleration of the centre of mass.
    The payload of the robot's mounting is part of its bodies. At rest F = -m g.

    Args:
        robot: its links need masses; a base without one weighs nothing.
        Q: N configurations (N, n), rad or m.
        V: velocities (N, n), rad/s or m/s.
        A: accelerations (N, n), rad/s² or m/s².
    """
    model, kinematics = robot.model, robot.kinematics
    poses = kinematics.poses(Q)
    axes, points = kinematics.axes(poses)
    rates, changes = kinematics.joint_rates(V), kinematics.joint_rates(A)
    gravity = np.asarray(model.gravity.linear)
    count = len(Q)
    wrench = np.zeros((count, 6))
    fixed = model.inertias[0]
    if fixed.mass > 0.0:  # what no joint moves
        weight = -fixed.mass * gravity
        wrench += np.concatenate([weight, np.cross(np.asarray(fixed.lever), weight)])
    joints = model.njoints
    omega, alpha, place, linear = np.zeros((4, joints, count, 3))
    for j in range(1, joints):
        parent, z, p = model.parents[j], axes[:, j - 1], points[:, j - 1]
        rate, change = rates[:, j - 1, None], changes[:, j - 1, None]
        w, dw = omega[parent], alpha[parent]
        a = _acceleration(linear[parent], w, dw, p - place[parent])
        if kinematics.revolute[j - 1] > 0.5:
            w, dw = w + rate * z, dw + change * z + cross(w, rate * z)
        else:
            a = a + 2.0 * cross(w, rate * z) + change * z
        omega[j], alpha[j], place[j], linear[j] = w, dw, p, a
    moved = [j for j in range(1, joints) if model.inertias[j].mass > 0.0]
    if moved:
        bodies = [model.inertias[j] for j in moved]
        wrench += _of_bodies(bodies, poses.swapaxes(0, 1)[moved], (omega[moved], alpha[moved], linear[moved]), gravity)
    return wrench


def _of_bodies(bodies: Sequence[pin.Inertia], X_WJ: Array, motion: tuple[Array, Array, Array], gravity: Array) -> Array:
    """Wrenches (N, 6) that move B bodies with their joints' frames (B, N, 4, 4), about the world's origin, summed."""
    w, dw, a = motion
    R = np.ascontiguousarray(X_WJ[:, :, :3, :3])
    lever = np.array([np.asarray(body.lever) for body in bodies])
    inertia = np.array([np.asarray(body.inertia) for body in bodies])
    mass = np.array([float(body.mass) for body in bodies])
    arm = (R @ lever[:, None, :, None])[..., 0]
    force = mass[:, None, None] * (_acceleration(a, w, dw, arm) - gravity)
    I_W = R @ inertia[:, None] @ R.swapaxes(2, 3)
    spin = (I_W @ w[..., None])[..., 0]
    moment = cross(X_WJ[:, :, :3, 3] + arm, force) + (I_W @ dw[..., None])[..., 0] + cross(w, spin)
    return np.concatenate([force.sum(axis=0), moment.sum(axis=0)], axis=1)


def _acceleration(a: Array, w: Array, dw: Array, arm: Array) -> Array:
    """Accelerations (..., 3) of points fixed to a body, at `arm` from one whose acceleration is a."""
    return np.asarray(a + cross(dw, arm) + cross(w, cross(w, arm)))
