"""Obstacles that move on stated trajectories, as bodies on sliding joints of their own behind those of the robot.

Each has three, along x, y and z of the world. A motion of the robot in time says where they are, so that it can be
given columns for them; then whatever bounds or proves the motion of links does so for obstacles, too.
"""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.obstacle_motion import ObstacleMotion
from optiplan.geometry.scene import Obstacle

_SLIDES = {"x": pin.JointModelPX, "y": pin.JointModelPY, "z": pin.JointModelPZ}


def with_obstacle_joints(model: pin.Model, moving: Sequence[Obstacle]) -> tuple[pin.Model, dict[str, int]]:
    """Return the model with sliding joints for obstacles, and the joint that carries each; itself without obstacles."""
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
    """Positions (N, 3 m) of the joints of m obstacles at times t (N,), s, or derivatives of an order."""
    return np.concatenate([np.zeros((len(t), 0)), *(motion.at(t, order) for motion in motions)], axis=1)
