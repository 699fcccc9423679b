"""What the page draws of goals and vias: axes at poses, and the extent of regions."""

from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.problem.goals_and_vias import AllOfGoal, GoalEnd
from optiplan.problem.problem import PoseGoal, Problem, RegionGoal
from optiplan.problem.seams.actions import SeamPath
from optiplan.problem.task.steps import TargetTour
from optiplan.robot.frames import frame_pose

_ENDLESS = 0.5
"""m; what is drawn of a direction without bound, either way."""

_THIN = 0.004
"""m; thickness of a region that has none to speak of."""

_MARKS = 25
"""Poses that are drawn along a path."""

_RING = 0.06
"""m; radius of the ring about an axis that a frame turns about freely, where it does not stand off that axis."""


def targets(problem: Problem) -> tuple[list[float], ...]:
    """Return the poses that goals name, of targets of tours, along paths, and of vias.

    Of vias with joint values it is that of the tool.
    """
    robot = problem.robot
    ends = _parts(problem)
    poses = [end.X_WG for end in ends if isinstance(end, PoseGoal)]
    regions = [end for end in ends if isinstance(end, RegionGoal)]
    tours = [step.action for step in problem.task if isinstance(step.action, TargetTour)]
    for tour in tours:
        at = frame_pose(robot, problem.start, tour.carried_by) if tour.carried_by else pin.SE3.Identity()
        regions += [target.goal.moved(at) for target in tour.targets]
    poses += [end.pose(_middle(end)) for end in regions]
    poses += [X for step in problem.task if isinstance(step.action, SeamPath) for X in _along(step.action)]
    for via in problem.vias:
        at = via.at
        poses.append(at.X_WG if isinstance(at, PoseGoal) else frame_pose(robot, at.q, robot.tool_frame))
    return tuple(pin.SE3ToXYZQUAT(X).tolist() for X in poses)


def _along(path: SeamPath) -> list[pin.SE3]:
    """Return poses of the tool along a path, evenly."""
    s = np.linspace(0.0, path.curve.length, _MARKS)
    return [pin.SE3(R, p) for R, p in zip(path.curve.rotations(s), path.curve.points(s), strict=True)]


def regions(problem: Problem, reached: Array | None) -> tuple[dict[str, Any], ...]:
    """Return the goal regions: `{pose, size, ring}`, of a box and of a ring about its free axis.

    `ring` is `{pose, radius}`, about the z axis of its pose, or None. A direction without bound is drawn half a metre
    either way of where the frame is at `reached` (n,), or of the region's middle.
    """
    return tuple(_drawn(problem, end, reached) for end in _parts(problem) if isinstance(end, RegionGoal))


def _parts(problem: Problem) -> list[GoalEnd]:
    """Return the ends of the goal, those that hold at once one by one."""
    return [part for end in problem.goal for part in (end.parts if isinstance(end, AllOfGoal) else (end,))]


def _drawn(problem: Problem, end: RegionGoal, reached: Array | None) -> dict[str, Any]:
    there = _middle(end)
    if reached is not None:
        there = np.clip(end.coordinates(frame_pose(problem.robot, reached, end.frame)), end.low, end.high)
    low = np.where(np.isfinite(end.low), end.low, there - _ENDLESS)[:3]
    high = np.where(np.isfinite(end.high), end.high, there + _ENDLESS)[:3]
    box = end.X_WR * pin.SE3(np.eye(3), 0.5 * (low + high))
    ring = None
    if len(end.free) == 1:
        ring = _ring(end, end.X_WR * pin.SE3(np.eye(3), there[:3].copy()), end.free[0])
    size = np.maximum(high - low, _THIN)
    return {"pose": _numbers(box), "size": np.round(size, 9).tolist(), "ring": ring}


def _ring(end: RegionGoal, X: pin.SE3, axis: int) -> dict[str, Any]:
    """Return the circle that the frame's origin turns on about an axis of the region, a small one on the axis."""
    offset = np.array(end.X_RF.translation)
    along = offset[axis] * np.eye(3)[axis]
    radius = float(np.linalg.norm(offset - along))
    turned = np.roll(np.eye(3), -(axis + 1), axis=0).T  # its z axis is that axis, the others follow in turn
    pose = X * pin.SE3(turned, along)
    return {"pose": _numbers(pose), "radius": round(radius, 9) if radius > _THIN else _RING}


def _middle(end: RegionGoal) -> Array:
    both = np.isfinite(end.low) & np.isfinite(end.high)
    middle = 0.5 * (np.where(both, end.low, 0.0) + np.where(both, end.high, 0.0))
    return np.asarray(np.clip(middle, end.low, end.high))


def _numbers(X: pin.SE3) -> list[float]:
    return [round(float(x), 9) for x in pin.SE3ToXYZQUAT(X)]
