"""`HalfSpaceLimit`: a point of the robot on one side of a plane."""

from typing import ClassVar

import numpy as np

from optiplan.arrays import Array, Index, number_argument
from optiplan.control.arguments import checked_direction, checked_number, checked_vector, frame_index
from optiplan.control.configuration import Configuration
from optiplan.control.limits.stop_limits import StopLimit
from optiplan.robot.robot import Robot


class HalfSpaceLimit(StopLimit):
    """normal · p >= offset for a point p of the robot, m, wherever it could stop: a virtual wall.

    Args:
        frame: name of the frame that the point belongs to.
        normal: into the allowed side, of any length > 0, axes of the world.
        offset: m along the unit normal.
        point: [x, y, z] in the frame, m.
        rate: 1/s; how quickly the distance to the wall may shrink, see `StopLimit`.

    Raises:
        InputError: a normal of length 0, values that are not finite.
    """

    name: ClassVar[str] = "half-space"

    def __init__(
        self, frame: str, normal: object, offset: float, point: object = (0.0, 0.0, 0.0), rate: float = 50.0
    ) -> None:
        self.frame = frame
        self.normal = checked_direction(self, "normal", normal, "a direction of the world")
        self.offset = number_argument("HalfSpaceLimit", "offset", offset, "a finite number, m")
        self.point = checked_vector(self, "point", point, 3)
        self.rate = checked_number(self, "rate", rate, 1e-3)
        self.at_least, self.influence = 0.0, np.inf

    def bind(self, robot: Robot) -> None:
        """Find the frame, and how far the joints move the point at most."""
        super().bind(robot)
        self._frame = frame_index(self, "frame", robot, self.frame)
        placed = robot.model.frames[self._frame]
        kinematics = robot.kinematics
        point_J = placed.placement.act(self.point)
        arms = kinematics.moment_arms(int(placed.parentJoint), point_J[None], robot.limits.stroke)
        self.arms = kinematics.planned_bound(arms[None])
        self.labels = (f"half-space of {self.frame}",)
        self.require_least()

    def distances(self, c: Configuration, which: Index) -> Array:
        """Normal · p - offset, m."""
        return np.array([self.normal @ self.mark(c) - self.offset])[: len(which)]

    def gradients(self, c: Configuration, which: Index) -> Array:
        """Normal · (J_v - [R p_F]× J_w)."""
        x, y, z = c.pose(self._frame).rotation @ self.point
        J = c.jacobian(self._frame)
        turn = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])  # -[R p_F]×
        return np.asarray((self.normal @ (J[:3] + turn @ J[3:]))[None][: len(which)])

    def mark(self, c: Configuration) -> Array:
        """The point in the world, (3,), m."""
        return np.asarray(c.pose(self._frame).act(self.point))

    def chords(self, first: Array, second: Array, which: Index) -> Array:
        """How far the point is moved, m."""
        return np.full(len(which), float(np.linalg.norm(second - first)))

    def between(self, d_0: Array, d_1: Array, chord: Array) -> Array:
        """From a plane, the less of both."""
        return np.minimum(d_0, d_1)
