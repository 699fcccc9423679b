"""The motion of a robot with that of the obstacles that move around it, as more joints."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from optiplan.geometry.obstacle_motion import ObstacleMotion
from optiplan.trajectory.trajectory import Trajectory


def with_obstacles(trajectory: Trajectory, motions: Sequence[ObstacleMotion]) -> Trajectory:
    """Return the motion of the robot's joints with those of the obstacles behind them, exactly; itself without any.

    Where an obstacle stops within a piece, that is divided there.
    """
    if not motions:
        return trajectory
    stops = [motion.until for motion in motions if 0.0 < motion.until < trajectory.duration]
    edges = np.unique(np.concatenate([trajectory.breakpoints, stops]))
    parts = [trajectory.part(a, b).coefficients[0] for a, b in pairwise(edges)]
    rows = []
    for part, t in zip(parts, edges[:-1], strict=True):
        columns = [part, *(motion.from_time(float(t)).T for motion in motions)]
        size = max(len(column) for column in columns)
        rows.append(np.hstack([np.pad(column, ((0, size - len(column)), (0, 0))) for column in columns]))
    names = [f"obstacle {k} {axis}" for k in range(len(motions)) for axis in "xyz"]
    return Trajectory((*trajectory.joint_names, *names), edges, np.array(rows))
