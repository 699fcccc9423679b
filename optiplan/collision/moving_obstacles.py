"""Moving obstacles as bodies on joints, which follow the joints of the robot.

Each obstacle has three sliding joints, along x, y and z of the world, and behind them one that turns, if it turns. Time
determines their positions, so the trajectory of the robot gets a column for each. The bounds and proofs for moving
links then apply to moving obstacles as well.
"""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.obstacle_motion import ObstacleMotion
from optiplan.geometry.scene import Obstacle

Carriers = dict[str, tuple[int, pin.SE3]]
"""By the name of an obstacle, the joint that carries it, and its pose there."""

_SLIDES = {"x": pin.JointModelPX, "y": pin.JointModelPY, "z": pin.JointModelPZ}


def with_obstacle_joints(model: pin.Model, moving: Sequence[Obstacle]) -> tuple[pin.Model, Carriers]:
    """Return the model with joints for obstacles, and what carries each."""
    if not moving:
        return model, {}
    extended, carriers = model.copy(), Carriers()
    for k, body in enumerate(moving):
        joint = 0
        for axis, slide in _SLIDES.items():
            joint = extended.addJoint(joint, slide(), pin.SE3.Identity(), f"obstacle {k} {axis}")
        X_JO, motion = body.X_WO, body.motion
        if motion is not None and motion.axis is not None:
            X_WJ = motion.joint_frame
            joint = extended.addJoint(joint, pin.JointModelRZ(), X_WJ, f"obstacle {k} turn")
            X_JO = X_WJ.actInv(body.X_WO)
        carriers[body.name] = joint, X_JO
    return extended, carriers


def displacements(motions: Sequence[ObstacleMotion], t: Array, order: int = 0) -> Array:
    """Return positions (N, K), m and rad, of the joints of obstacles at times t (N,), s, or derivatives of an order."""
    return np.concatenate([np.zeros((len(t), 0)), *(motion.at(t, order) for motion in motions)], axis=1)


def joint_count(motions: Sequence[ObstacleMotion]) -> int:
    """Return the number K of joints of obstacles."""
    return sum(motion.size for motion in motions)
