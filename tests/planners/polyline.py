"""The proof of straight segments by the sweep of a whole curve: what quicker checks are held against."""

import numpy as np

from optiplan.collision.model import CollisionModel
from optiplan.planners.common.continuous_collision import Touch, first_contact
from optiplan.trajectory.trajectory import Trajectory


def polyline_contact(model: CollisionModel, waypoints: np.ndarray) -> Touch | None:
    """Earliest touch of the segments between waypoints (k, n); t is the segment's index plus the fraction of it."""
    coefficients = np.stack([waypoints[:-1], np.diff(waypoints, axis=0)], axis=1)
    path = Trajectory(model.robot.joint_names, np.arange(len(waypoints), dtype=float), coefficients)
    return first_contact(model, path)
