"""The wrench that the ground exerts on a robot's base, of many states at once."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.robot.batched.dynamics import torques_of
from optiplan.robot.loaded_robots import once_for_each
from optiplan.robot.mimic_joints import unfold
from optiplan.robot.robot import Robot

HOLDING = 6
"""Joints that hold the base."""


class HeldRobot(NamedTuple):
    """A robot whose base six more joints hold, which stand still.

    Three slide along the world's axes and three turn about them, all at the origin, so that their forces and torques
    are the wrench of the ground about the origin, in world axes.

    Attributes:
        model: without joints that follow others; the six come first.
        A: (6 + J, 6 + n), b: (6 + J,): its joints are at A q + b.
    """

    model: pin.Model
    A: Array
    b: Array

    def joints(self, Q: Array, V: Array, A: Array) -> tuple[Array, Array, Array]:
        """Return the states (N, 6 + J) of its joints for those of the robot, (N, n)."""
        coupling = self.A[:, HOLDING:].T
        return Q @ coupling + self.b, V @ coupling, A @ coupling


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
    held = held_robot(robot)
    return torques_of(held.model, *held.joints(Q, V, A))[:, :HOLDING]


@once_for_each
def held_robot(robot: Robot) -> HeldRobot:
    """Return the robot held by six joints."""
    plain = unfold(robot.model)
    A = np.eye(HOLDING + len(plain.A), HOLDING + plain.A.shape[1])
    A[HOLDING:, HOLDING:] = plain.A
    return HeldRobot(_held_by_six(plain.model), A, np.concatenate([np.zeros(HOLDING), plain.b]))


def _held_by_six(model: pin.Model) -> pin.Model:
    held = pin.Model()
    held.gravity = model.gravity
    parent = 0
    for kind in ("PX", "PY", "PZ", "RX", "RY", "RZ"):
        parent = held.addJoint(parent, getattr(pin, f"JointModel{kind}")(), pin.SE3.Identity(), f"held {kind}")
    held.appendBodyToJoint(parent, model.inertias[0], pin.SE3.Identity())
    place = {0: parent}
    for j in range(1, model.njoints):
        joint = model.joints[j]
        place[j] = held.addJoint(place[model.parents[j]], joint, model.jointPlacements[j], str(model.names[j]))
        held.appendBodyToJoint(place[j], model.inertias[j], pin.SE3.Identity())
    return held
