"""Analytic Jacobians of any frame of a robot, in roll-pitch-yaw angles or in a quaternion.

Source: B. Siciliano et al., Robotics: Modelling, Planning and Control, section 3.6; values from pinocchio.
"""

from typing import Literal

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.robot.frames import frame_pose, geometric_jacobian
from optiplan.robot.robot import Robot

Rates = Literal["rpy", "quaternion"]


def analytic_jacobian(robot: Robot, q: Array, frame: str, rates: Rates = "rpy") -> Array:
    """J with ẋ = J q̇, where x is the position of the frame in the world, m, and its orientation there.

    rpy: x = (p, roll, pitch, yaw), R_WF = Rz(yaw) Ry(pitch) Rx(roll), J (6, n); ẋ = [v; E⁻¹ w] with
    w = E (ṙ, ṗ, ẏ), E = [[cos y cos p, -sin y, 0], [sin y cos p, cos y, 0], [-sin p, 0, 1]].
    quaternion: x = (p, qx, qy, qz, qw), J (7, n); q̇ = ½ (w, 0) ⊗ q, that is q̇_xyz = ½ (qw w + w x q_xyz) and
    q̇w = -½ w · q_xyz, of either sign of q alike up to that sign: here qw >= 0.

    Raises:
        UnknownChoiceError: there is no such frame.
        ValueError: rates of roll and yaw do not exist where |pitch| = π/2 (within 1e-9 of it).
    """
    geometric = geometric_jacobian(robot, q, frame)
    rotation = frame_pose(robot, q, frame).rotation
    turning = _rpy_rates(rotation) if rates == "rpy" else _quaternion_rates(rotation)
    return np.vstack([geometric[:3], turning @ geometric[3:]])


def _rpy_rates(rotation: Array) -> Array:
    """E⁻¹, (3, 3): rates of roll, pitch and yaw from the angular velocity in the world."""
    _, pitch, yaw = pin.rpy.matrixToRpy(rotation)
    cp, sp, cy, sy = np.cos(pitch), np.sin(pitch), np.cos(yaw), np.sin(yaw)
    if abs(cp) < 1e-9:
        raise ValueError("roll and yaw have no rates where pitch is ±90°: take the quaternion")
    return np.array([[cy / cp, sy / cp, 0.0], [-sy, cy, 0.0], [cy * sp / cp, sy * sp / cp, 1.0]])


def _quaternion_rates(rotation: Array) -> Array:
    """G, (4, 3): rates of (qx, qy, qz, qw) from the angular velocity in the world."""
    x, y, z, w = _positive(pin.Quaternion(rotation).coeffs())
    return 0.5 * np.array([[w, z, -y], [-z, w, x], [y, -x, w], [-x, -y, -z]])


def _positive(quaternion: Array) -> Array:
    return -quaternion if quaternion[3] < 0.0 else quaternion
