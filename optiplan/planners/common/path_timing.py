"""Time a collision-free path of straight segments, rounding its corners as far as the obstacles allow."""

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.common.tolerances import NO_MOTION
from optiplan.robot.robot import Limits, Robot
from optiplan.trajectory.timing.stops import stop_at_corners
from optiplan.trajectory.timing.torque_scaling import torque_scale
from optiplan.trajectory.trajectory import Trajectory

_SHRINK = 0.5
_SHARPEST = 0.01  # share of half a segment: smallest corner that is rounded


def timed_path(model: CollisionModel, waypoints: Array, limits: Limits, budget: Budget) -> Trajectory | None:
    """Return the faster of the motion through rounded corners and the one that stops at every corner.

    Args:
        model: of the robot in its scene.
        waypoints: (k, n), rad or m; the straight segments between them are free.
        limits: of the n joints.
        budget: once it is over, the motion with stops is returned.

    Returns:
        A trajectory within all limits that is free at all times because the path is; None where gravity alone requires
        more torque than allowed.
    """
    robot = model.robot
    stops = stopping(robot, limits, waypoints)
    distinct = (np.abs(np.diff(waypoints, axis=0)) > NO_MOTION).any(axis=1)  # between others no corner has room
    if stops is None or not distinct.any():
        return stops
    corners = waypoints[np.concatenate([[True], distinct])]
    corners[-1] = waypoints[-1]
    blended = _blend(model, corners, limits, budget)
    return stops if blended is None or blended.duration > stops.duration else blended


def stopping(robot: Robot, limits: Limits, waypoints: Array) -> Trajectory | None:
    """Return the motion along straight segments (k, n) that stops at every corner; None where gravity is too much."""
    return within_torque(robot, limits, stop_at_corners(waypoints, limits, robot.joint_names))


def within_torque(robot: Robot, limits: Limits, trajectory: Trajectory) -> Trajectory | None:
    """Return the trajectory, slowed down where its torques require it; None where gravity alone exceeds the limits."""
    slower = torque_scale(robot, limits.torque, trajectory)
    if slower == 1.0:
        return trajectory
    return trajectory.scaled(trajectory.duration * slower) if np.isfinite(slower) else None


def _blend(model: CollisionModel, waypoints: Array, limits: Limits, budget: Budget) -> Trajectory | None:
    from optiplan.trajectory.paths.corners import blend_path
    from optiplan.trajectory.timing.time_path import TimingOptions, time_path

    fractions = np.ones(len(waypoints) - 2)
    while not budget.over and fractions.min(initial=1.0) > _SHARPEST:
        path = blend_path(waypoints, fractions, limits, model.robot.joint_names)
        touch = first_contact(model, path, lambda: budget.over)
        if touch is None:
            return time_path(path, model.robot, limits, TimingOptions(stop=lambda: budget.over))
        if not len(fractions):
            return None
        corner = int(np.argmin(np.linalg.norm((waypoints[1:-1] - touch.q) / limits.velocity, axis=1)))
        fractions[corner] *= _SHRINK
    return None
