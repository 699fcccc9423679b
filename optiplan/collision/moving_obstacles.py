"""Moving obstacles as bodies on sliding joints, which follow the joints of the robot.

Each obstacle has three joints, along x, y and z of the world. Time determines their positions, so the trajectory of the
robot gets a column for each. The bounds and proofs for moving links then apply to moving obstacles as well.
"""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.obstacle_motion import ObstacleMotion
from optiplan.geometry.scene import Obstacle

_SLIDES = {"x": pin.JointModelPX, "y": pin.JointModelPY, "z": pin.JointModelPZ}


def with_obstacle_joints(model: pin.Model, moving: Sequence[Obstacle]) -> tuple[pin.Model, dict[str, int]]:
    """Return the model with sliding joints for obstacles, and the joint that carries each by name."""
    if not moving:
        return model, {}
    extended, carriers = model.copy(), {}
    for k, body in enumerate(moving):
        joint = 0
        for axis, slide in _SLIDES.items():
            joint = extended.addJoint(joint, slide(), pin.SE3.Identity(), f"obstacle {k} {axis}")
        carriers[body.name] = joint
    return extended, carriers


def displacements(motions: Sequence[ObstacleMotion], t: Array, order: int = 0) -> Array:
    """Return positions (N, 3 m) of the joints of m obstacles at times t (N,), s, or derivatives of an order."""
    return np.concatenate([np.zeros((len(t), 0)), *(motion.at(t, order) for motion in motions)], axis=1)
