"""The motion of a robot with that of the obstacles that move around it, as more joints."""

from collections.abc import Sequence

import numpy as np

from optiplan.geometry.obstacle_motion import ObstacleMotion
from optiplan.trajectory.cut import coefficients_between
from optiplan.trajectory.trajectory import Trajectory


def with_obstacles(trajectory: Trajectory, motions: Sequence[ObstacleMotion]) -> Trajectory:
    """Return the motion of the robot's joints with those of the obstacles behind them, exactly; itself without any.

    Where an obstacle stops within a piece, that is divided there.
    """
    if not motions:
        return trajectory
    stops = {motion.until for motion in motions if 0.0 < motion.until < trajectory.duration}
    breakpoints = np.union1d(trajectory.breakpoints, sorted(stops))
    own = coefficients_between(trajectory, breakpoints)
    columns = [own, *(np.swapaxes(motion.from_times(breakpoints[:-1]), 1, 2) for motion in motions)]
    size = max(column.shape[1] for column in columns)
    padded = [np.pad(column, ((0, 0), (0, size - column.shape[1]), (0, 0))) for column in columns]
    names = [f"obstacle {k} {axis}" for k in range(len(motions)) for axis in "xyz"]
    return Trajectory((*trajectory.joint_names, *names), breakpoints, np.concatenate(padded, axis=2))
