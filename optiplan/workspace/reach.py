"""The reach of an arm: its shoulder, and the least and the largest distance of the tool from it."""

import numpy as np

from optiplan.arrays import Array
from optiplan.errors import OptiPlanError
from optiplan.kinematics.manipulability import ToolKinematics
from optiplan.records import dataclass
from optiplan.robot.robot import Robot

_STARTS, _REFINED = 4096, 12
_PARALLEL = 1e-6
_NO_REACH = 1e-9
"""m; rounding alone moves the tool so far."""


@dataclass(frozen=True, eq=False)
class Reach:
    """Distances of the origin of a frame from the shoulder, within the joint limits, collisions left aside.

    Attributes:
        shoulder: (3,) m, world.
        least: m; `largest`: m, the radius of the reach sphere.
    """

    shoulder: Array
    least: float
    largest: float


def sampling_range(robot: Robot) -> tuple[Array, Array]:
    """Lower and upper end (n,) of what is sampled: the joint limits, but no more than one turn, about their middle.

    A joint that turns without end is sampled from -pi to pi.

    Raises:
        OptiPlanError: a sliding joint without limits.
    """
    lower, upper = robot.limits.lower, robot.limits.upper
    endless = ~(np.isfinite(lower) & np.isfinite(upper))
    revolute = robot.revolute
    if (endless & ~revolute).any():
        names = ", ".join(np.array(robot.joint_names)[endless & ~revolute])
        raise OptiPlanError(
            f"{robot.name}: found sliding joints without limits: {names}; expected limits, or a group without them"
        )
    middle = np.zeros(robot.n)
    middle[~endless] = 0.5 * (lower[~endless] + upper[~endless])
    wide = revolute & (endless | (upper - lower > 2.0 * np.pi))
    return np.where(wide, middle - np.pi, lower), np.where(wide, middle + np.pi, upper)


def shoulder_point(robot: Robot) -> Array:
    """The point (3,), m, of the first revolute axis that is nearest to the next axis not parallel to it.

    Where all are parallel, as in a planar arm, it is the origin of the first. Taken at q = 0, moved into the limits.
    """
    lower, upper = sampling_range(robot)
    kinematics = robot.kinematics
    axes, points = kinematics.axes(kinematics.poses(np.clip(np.zeros((1, robot.n)), lower, upper)))
    turning = np.flatnonzero(kinematics.revolute > 0.5)
    if not len(turning):
        return np.asarray(points[0, 0])
    axis, origin = axes[0, turning[0]], points[0, turning[0]]
    for j in turning[1:]:
        normal = np.cross(axis, axes[0, j])
        if np.linalg.norm(normal) > _PARALLEL:
            along = np.cross(points[0, j] - origin, axes[0, j]) @ normal / (normal @ normal)
            return np.asarray(origin + along * axis)
    return np.asarray(origin)


def reach(robot: Robot, frame: str | None = None) -> Reach:
    """Least and largest distance of `frame` (the tool frame without it) from the shoulder.

    Descent of ±|p - s|² / 2, gradient ±J_v^T (p - s), from the best of random starts: not proved to be global.

    Raises:
        OptiPlanError: the frame stays at the shoulder, or a sliding joint has no limits.
    """
    from scipy.optimize import minimize

    tool, shoulder = ToolKinematics(robot, frame), shoulder_point(robot)
    lower, upper = sampling_range(robot)
    starts = np.random.default_rng(0).uniform(lower, upper, (_STARTS, robot.n))
    distance = np.linalg.norm(tool.evaluate(starts)[0][:, :3, 3] - shoulder, axis=1)
    order = np.argsort(distance)
    ends = []
    for sign, chosen in ((1.0, order[:_REFINED]), (-1.0, order[-_REFINED:])):

        def half_square(q: Array, sign: float = sign) -> tuple[float, Array]:
            X_WT, J = tool.evaluate(q[None])
            away = X_WT[0, :3, 3] - shoulder
            return sign * 0.5 * float(away @ away), sign * (J[0, :3].T @ away)

        options = {"ftol": 1e-16, "gtol": 1e-12, "maxiter": 500}
        limits = list(zip(lower, upper, strict=True))
        found = [minimize(half_square, starts[k], jac=True, bounds=limits, options=options).fun for k in chosen]
        ends.append(float(np.sqrt(max(2.0 * sign * min(found), 0.0))))
    if ends[1] < _NO_REACH:
        still = f"the frame {frame or robot.tool_frame} at the shoulder in every configuration"
        raise OptiPlanError(f"{robot.name}: found {still}; expected a frame away from the first axis")
    return Reach(shoulder, ends[0], ends[1])
