"""What a motion asks of the ground under the base: force, moment, and where the zero-moment point goes."""

from collections.abc import Sequence

import numpy as np

from optiplan.geometry.support_polygon import zero_moment_points
from optiplan.records import dataclass
from optiplan.robot.batched.base_reaction import base_reaction
from optiplan.robot.robot import Robot
from optiplan.trajectory.trajectory import Trajectory

_SAMPLES = 200
"""Instants of each part of a motion, its ends included."""


@dataclass(frozen=True)
class BaseLoad:
    """The load on the base along a motion, sampled.

    Attributes:
        force: largest |F|, N.
        moment: largest |M| about the origin of the base, N·m.
        zero_moment_point: least and largest x, then y, m, in the world, at the height of the base's origin; None where
            the ground would have to pull.
    """

    force: float
    moment: float
    zero_moment_point: tuple[tuple[float, float], tuple[float, float]] | None


def base_load(parts: Sequence[tuple[Robot, Trajectory]]) -> BaseLoad | None:
    """Return the load over parts of a motion, each with the robot and what it carries then; None without masses.

    Holds at: 200 instants of each part, evenly.
    """
    wrenches = []
    for robot, motion in parts:
        if not robot.has_inertia:
            return None
        states = motion.states(np.linspace(0.0, motion.duration, _SAMPLES))
        wrench = base_reaction(robot, *states)
        origin = robot.mounting.X_WB.translation
        wrench[:, 3:] -= np.cross(origin, wrench[:, :3])
        wrenches.append(wrench)
    if not wrenches:
        return None
    origin, wrench = parts[0][0].mounting.X_WB.translation, np.concatenate(wrenches)
    points = zero_moment_points(wrench, 0.0) + origin[:2]
    pulled = bool((wrench[:, 2] <= 0.0).any())
    (x, y), (X, Y) = (points.min(axis=0).tolist(), points.max(axis=0).tolist())
    force, moment = (float(np.linalg.norm(wrench[:, part], axis=1).max()) for part in (slice(3), slice(3, 6)))
    return BaseLoad(force, moment, None if pulled else ((x, X), (y, Y)))
