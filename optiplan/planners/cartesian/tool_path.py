"""Tool paths X_WF(s), s from 0 to 1: straight lines, arcs, circles and screws are one family of curves.

The orientation turns evenly about a fixed axis, and so does the direction of the velocity, about an axis of its own:

    R(s) = exp([w] s) R(0),   p'(s) = exp([a] s) u,

with u the velocity at the start, a the rate at which the velocity turns and w the rate at which the tool turns. A line
has a = 0, an arc has a perpendicular to u, a screw has a = w. Nothing is divided by an angle, so that curves with a
little rotation need no case of their own.
"""

from functools import cached_property
from typing import Protocol

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.problem.constraints.base import circle_of
from optiplan.records import dataclass

_STRAIGHT = 1e-9  # rad: smaller rotations have no axis
_IN_LINE = 1e-5  # as a sine: rounding of three points in line, an arc with a radius of kilometres


class FollowedPath(Protocol):
    """Poses of a frame F in the world W over s from 0 to 1, twice continuously differentiable."""

    def pose(self, s: float) -> pin.SE3:
        """X_WF(s)."""

    def twist(self, s: float) -> Array:
        """dX/ds (6,): p'(s), m, and the angular velocity, rad, in world axes."""

    def twist_rate(self, s: float) -> Array:
        """d/ds of `twist`, (6,)."""


@dataclass(frozen=True, eq=False)
class ToolPath:
    """Poses of a frame F in the world W over s from 0 to 1; its rates are per unit of s.

    Attributes:
        start: X_WF(0).
        velocity: u (3,), m, of the origin of F at the start, in world axes.
        bending: a (3,), rad, rotation rate of that velocity.
        turning: w (3,), rad, angular velocity of F.
    """

    start: pin.SE3
    velocity: Array
    bending: Array
    turning: Array

    def pose(self, s: float) -> pin.SE3:
        """X_WF(s): p(s) is p(0) and the translation of exp(s (u, a)), the integral of p' above."""
        moved = pin.exp6(pin.Motion(s * self.velocity, s * self.bending)).translation
        return pin.SE3(pin.exp3(s * self.turning) @ self.start.rotation, self.start.translation + moved)

    def twist(self, s: float) -> Array:
        """dX/ds (6,): p'(s), m, and the angular velocity w, rad, in world axes."""
        return np.concatenate([pin.exp3(s * self.bending) @ self.velocity, self.turning])

    def twist_rate(self, s: float) -> Array:
        """d/ds of `twist`, (6,): a x p'(s), m, and zero."""
        return np.concatenate([np.cross(self.bending, self.twist(s)[:3]), np.zeros(3)])

    @property
    def end(self) -> pin.SE3:
        """X_WF(1)."""
        return self.pose(1.0)

    @cached_property
    def length(self) -> float:
        """|u|, m: the way of the origin of F."""
        return float(np.linalg.norm(self.velocity))

    @cached_property
    def angle(self) -> float:
        """|w|, rad: the way that F turns."""
        return float(np.linalg.norm(self.turning))


def line(start: pin.SE3, end: pin.SE3) -> ToolPath:
    """Straight, turning evenly about one fixed axis by pi at most (the same as slerp of quaternions)."""
    turning = pin.log3(end.rotation @ start.rotation.T)
    return ToolPath(start, end.translation - start.translation, np.zeros(3), turning)


def screw(start: pin.SE3, end: pin.SE3, turns: int = 0) -> ToolPath:
    """X(s) = X(0) exp(s log(X(0)^-1 X(1))): turning about one axis while sliding along it; both evenly.

    Args:
        start: X_WF(0).
        end: X_WF(1).
        turns: whole turns about the same axis on top; the slide along it stays that between the two poses.
    """
    twist = pin.log6(start.actInv(end))
    turning = start.rotation @ twist.angular
    path = ToolPath(start, start.rotation @ twist.linear, turning, turning)
    if turns == 0 or path.angle < _STRAIGHT:
        return path
    axis = path.turning / path.angle
    slide = axis * (axis @ path.velocity)
    more = (path.angle + 2.0 * np.pi * turns) / path.angle
    return ToolPath(start, slide + more * (path.velocity - slide), more * path.bending, more * path.turning)


def screw_about(start: pin.SE3, axis: Array, point: Array, angle: float, slide: float) -> ToolPath:
    """Turning by `angle`, rad, about the unit vector `axis` through `point`, m, sliding by `slide`, m, along it."""
    velocity = angle * np.cross(axis, start.translation - point) + slide * axis
    return ToolPath(start, velocity, angle * axis, angle * axis)


def circle(start: pin.SE3, centre: Array, rotation: Array, turning: Array) -> ToolPath:
    """Around the axis through `centre` by the rotation vector `rotation`, rad, while F itself turns by `turning`, rad.

    The part of p(0) - centre along the axis does not count: the circle passes through the start.
    """
    return ToolPath(start, np.cross(rotation, start.translation - centre), rotation, turning)


def arc(start: pin.SE3, end: pin.SE3, centre: Array, rotation: Array) -> ToolPath:
    """`circle` that ends at the pose `end`, whose orientation is reached along the shortest way.

    The centre and the rotation lead from one position to the other.
    """
    return circle(start, centre, rotation, line(start, end).turning)


def circle_through(a: Array, b: Array, c: Array) -> tuple[Array, Array] | None:
    """Centre (3,) and rotation vector (3,), rad, of the arc from point a by way of b to c; None if they are in line.

    The rotation from a to c is about n, by an angle in (0, 2 pi).
    """
    u, v = b - a, c - a
    if np.linalg.norm(np.cross(u, v)) <= _IN_LINE * np.linalg.norm(u) * np.linalg.norm(v):
        return None
    centre, axis, _, angle = circle_of(a, b, c)
    return centre, angle * axis


def angle_about(axis: Array, a: Array, b: Array) -> float:
    """Angle in (-pi, pi] by which a turns into b about the unit vector `axis`, rad; parts along the axis left aside."""
    return float(np.arctan2(axis @ np.cross(a, b), a @ b - (axis @ a) * (axis @ b)))
