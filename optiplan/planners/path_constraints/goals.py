"""Goals as inequalities, for a motion whose end is anywhere in one."""

from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.poses import pose_error
from optiplan.kinematics.symbolic.state import SymbolicState
from optiplan.planners.path_constraints.inequality import Inequality
from optiplan.planners.path_constraints.parts import ANGLE, LENGTH, TINY, held_to, stacked, turned_within, within_ball
from optiplan.problem.goals_and_vias import PoseGoal
from optiplan.problem.regions.region import RegionGoal

_OF_GOAL = 0.9
"""Share of a goal's tolerance that a free end may use."""


def goal_inequalities(goal: PoseGoal | RegionGoal) -> list[Inequality]:
    """Return the expressions that hold a goal at the end of a motion: position, and orientation where that counts."""
    found = _region(goal.inner(_OF_GOAL)) if isinstance(goal, RegionGoal) else _pose(goal)
    return [one._replace(during=(1.0, 1.0), reserve=0.0) for one in found]


def in_goal(goal: PoseGoal | RegionGoal, X_WF: pin.SE3) -> bool:
    """Return whether a pose of the goal's frame is in the goal."""
    if isinstance(goal, RegionGoal):
        return goal.contains(X_WF)
    position, angle = pose_error(X_WF, goal.X_WG)
    return bool(position <= goal.position and angle <= goal.orientation)


def _region(goal: RegionGoal) -> list[Inequality]:
    """Each coordinate of the region above its lower and below its upper bound."""
    to_region, back = goal.X_WR.inverse(), goal.X_RF.inverse()

    def along(k: SymbolicState) -> Any:
        X = k.pose(goal.frame)
        p = X.p + X.R @ k.constant(back.translation)
        return _between(
            k, k.constant(to_region.rotation) @ p + k.constant(to_region.translation), goal.low[:3], goal.high[:3]
        )

    def about(k: SymbolicState) -> Any:
        R = k.constant(to_region.rotation) @ k.pose(goal.frame).R @ k.constant(back.rotation)
        return _between(k, _vector(R) if not goal.free else _tilt(R, goal.free[0]), goal.low[3:], goal.high[3:])

    parts = ((along, slice(0, 3), LENGTH), (about, slice(3, 6), ANGLE))
    widths = goal.high - goal.low
    narrow = [float(np.min(widths[part])) for _, part, _ in parts]
    return [
        held_to("goal", build, 0.5 * width, unit)
        for (build, _, unit), width in zip(parts, narrow, strict=True)
        if np.isfinite(width)
    ]


def _between(k: SymbolicState, c: Any, low: Array, high: Array) -> Any:
    rows = [c[j] - k.constant(low[j]) for j in range(3) if np.isfinite(low[j])]
    rows += [k.constant(high[j]) - c[j] for j in range(3) if np.isfinite(high[j])]
    return stacked(*rows)


def _vector(R: Any) -> Any:
    """Return log(R), rad, of a rotation by less than a half turn, by its quaternion."""
    import casadi

    w = 0.5 * casadi.sqrt(casadi.fmax(1.0 + R[0, 0] + R[1, 1] + R[2, 2], TINY))
    v = stacked(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]) / (4.0 * w)
    sine = casadi.sqrt(v.T @ v + TINY)
    return 2.0 * casadi.atan2(sine, w) / sine * v


def _tilt(R: Any, axis: int) -> Any:
    """Return the vector, rad, of the shortest rotation that takes an axis where R takes it."""
    import casadi

    a, e = R[:, axis], np.eye(3)[axis]
    across = casadi.cross(casadi.DM(e), a)
    sine = casadi.sqrt(across.T @ across + TINY)
    return casadi.atan2(sine, a[axis]) / sine * across


def _pose(goal: PoseGoal) -> list[Inequality]:
    X = goal.X_WG
    position, orientation = _OF_GOAL * goal.position, _OF_GOAL * goal.orientation

    def off(k: SymbolicState) -> Any:
        return within_ball(k, k.pose(goal.frame).p - k.constant(X.translation), position)

    def turned(k: SymbolicState) -> Any:
        return turned_within(k, k.constant(X.rotation.T) @ k.pose(goal.frame).R, orientation)

    found = [held_to("goal", off, position, LENGTH)]
    return found + ([held_to("goal", turned, orientation, ANGLE)] if goal.orientation < np.pi else [])
