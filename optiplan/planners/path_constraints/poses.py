"""Constraints of where frames are, as inequalities: one function for each kind of statement."""

from collections.abc import Callable
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.kinematics.symbolic.state import SymbolicState
from optiplan.planners.path_constraints.inequality import Inequality
from optiplan.planners.path_constraints.parts import (
    ANGLE,
    LENGTH,
    NARROW,
    both_sides,
    held_to,
    stacked,
    turned_within,
    within_ball,
    within_box,
)
from optiplan.problem.constraints.base import circle_of
from optiplan.problem.constraints.points import OnArc, OnCircle, OnLine, OnPlane, PositionBox
from optiplan.problem.constraints.poses import FixedOrientation, LookAt, OnScrew, OrientationCone, RelativePose

_ACROSS, _BEYOND = 0.8, 0.6
"""Shares of a tolerance to the side of a segment and beyond its ends: 0.8² + 0.6² = 1."""


def _cone(one: OrientationCone) -> list[Inequality]:
    """Axis a within an angle w of d: (a · d - cos w) / sin w, or each coordinate of a - d where w is small."""
    within = min(one.within, np.pi)

    def wide(k: SymbolicState) -> Any:
        axis = k.pose(one.frame).R @ k.constant(one.axis)
        return (axis.T @ k.constant(one.toward) - k.constant(np.cos(within))) / k.constant(max(np.sin(within), 0.1))

    def narrow(k: SymbolicState) -> Any:
        return within_box(k, k.pose(one.frame).R @ k.constant(one.axis) - k.constant(one.toward), within)

    return [held_to("orientation", narrow if within < NARROW else wide, within, ANGLE)]


def _fixed(one: FixedOrientation) -> list[Inequality]:
    def build(k: SymbolicState) -> Any:
        return turned_within(k, k.constant(np.asarray(one.R_WF).T) @ k.pose(one.frame).R, one.within)

    return [held_to("fixed orientation", build, min(one.within, np.pi), ANGLE)]


def _position(one: PositionBox) -> list[Inequality]:
    X, half = one.X_WC, 0.5 * np.asarray(one.size)

    def build(k: SymbolicState) -> Any:
        local = k.constant(X.rotation.T) @ (k.pose(one.frame).p - k.constant(X.translation))
        return both_sides(k, local, half)

    return [held_to("position", build, float(half.min()), LENGTH)]


def _plane(one: OnPlane) -> list[Inequality]:
    def build(k: SymbolicState) -> Any:
        height = k.constant(one.normal).T @ k.pose(one.frame).p - k.constant(one.offset)
        return both_sides(k, height, one.within)

    return [held_to("plane", build, one.within, LENGTH)]


def _line(one: OnLine) -> list[Inequality]:
    """Across the line within the tolerance in two directions, and along it between its ends."""
    along = one.end - one.start
    length = float(np.linalg.norm(along))
    direction = along / length if length > 0.0 else np.array([1.0, 0.0, 0.0])
    sides = np.linalg.svd(direction[None])[2][1:]

    def build(k: SymbolicState) -> Any:
        p = k.pose(one.frame).p - k.constant(one.start)
        across, s = k.constant(sides) @ p, k.constant(direction).T @ p
        within, beyond = k.constant(_ACROSS * one.within / np.sqrt(2.0)), k.constant(_BEYOND * one.within)
        return stacked(within - across, within + across, s + beyond, k.constant(length) + beyond - s)

    return [held_to("line", build, _BEYOND * one.within, LENGTH)]


def _circle(one: OnCircle) -> list[Inequality]:
    def build(k: SymbolicState) -> Any:
        return within_box(k, _off_circle(k, k.pose(one.frame).p, one.centre, one.normal, one.radius), one.within)

    return [held_to("circle", build, one.within / np.sqrt(2.0), LENGTH)]


def _arc(one: OnArc) -> list[Inequality]:
    """Near the circle, and on the arc's side of it: the angle from its middle is no more than half of it."""
    centre, normal, radius, angle = circle_of(one.start, one.through, one.end)
    x = (one.start - centre) / radius
    middle = np.cos(0.5 * angle) * x + np.sin(0.5 * angle) * np.cross(normal, x)
    across = np.cross(normal, middle)

    def build(k: SymbolicState) -> Any:
        p = k.pose(one.frame).p
        near = within_box(k, _off_circle(k, p, centre, normal, radius), _ACROSS * one.within)
        local = p - k.constant(centre)
        turned = k.atan2(k.constant(across).T @ local, k.constant(middle).T @ local)
        allowed = k.constant(0.5 * angle * radius + _BEYOND * one.within)
        return stacked(near, allowed - k.constant(radius) * turned, allowed + k.constant(radius) * turned)

    return [held_to("arc", build, _BEYOND * one.within, LENGTH)]


def _off_circle(k: SymbolicState, p: Any, centre: Array, normal: Array, radius: float) -> Any:
    """How far a point is from a circle: (radially, along its axis)."""
    local, axis = p - k.constant(centre), k.constant(normal)
    height = axis.T @ local
    return stacked(k.norm(local - height * axis) - k.constant(radius), height)


def _screw(one: OnScrew) -> list[Inequality]:
    """The frame turns about the axis alone and slides along it by the pitch, modulo whole turns."""
    R, p = np.asarray(one.X_WF.rotation), np.asarray(one.X_WF.translation) - one.point
    sides = np.linalg.svd(one.axis[None])[2][1:]

    def turned(k: SymbolicState) -> Any:
        D = k.pose(one.frame).R @ k.constant(R.T)
        return within_box(k, k.constant(sides) @ (D @ k.constant(one.axis)), one.orientation)

    def slid(k: SymbolicState) -> Any:
        X, axis = k.pose(one.frame), k.constant(one.axis)
        D = X.R @ k.constant(R.T)
        skew = stacked(D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1])
        turn = stacked(D[0, 0] + D[1, 1] + D[2, 2] - axis.T @ D @ axis, axis.T @ skew)
        cosine, sine = (turn[i] / k.norm(turn) for i in range(2))
        along, across = k.constant(one.axis * (one.axis @ p)), k.constant(np.cross(one.axis, p))
        off = X.p - k.constant(one.point) - along - cosine * (k.constant(p) - along) - sine * across
        shift = axis.T @ off
        if one.pitch != 0.0:
            left = shift / k.constant(one.pitch) - k.atan2(turn[1], turn[0])
            shift = k.constant(one.pitch) * k.atan2(k.sin(left), k.cos(left))
        return within_box(k, stacked(k.constant(sides) @ off, shift), one.position)

    return [
        held_to("screw", slid, one.position / np.sqrt(3.0), LENGTH),
        held_to("screw", turned, one.orientation / np.sqrt(2.0), ANGLE),
    ]


def _look(one: LookAt) -> list[Inequality]:
    """Axis a and ray r to the target: (a · r / |r| - cos w) / sin w."""

    def build(k: SymbolicState) -> Any:
        X = k.pose(one.frame)
        ray, axis = k.constant(one.target) - X.p, X.R @ k.constant(one.axis)
        if one.within < NARROW:
            return within_box(k, ray / k.norm(ray) - axis, one.within)
        return (axis.T @ ray / k.norm(ray) - k.constant(np.cos(one.within))) / k.constant(np.sin(one.within))

    return [held_to("look at", build, one.within, ANGLE)]


def _relative(one: RelativePose) -> list[Inequality]:
    p, R = one.X_TF.translation, one.X_TF.rotation

    def off(k: SymbolicState) -> Any:
        return within_ball(k, k.relative_pose(one.frame, one.to).p - k.constant(p), one.position)

    def turned(k: SymbolicState) -> Any:
        return turned_within(k, k.constant(R.T) @ k.relative_pose(one.frame, one.to).R, one.orientation)

    return [
        held_to("relative pose", off, one.position, LENGTH),
        held_to("relative pose", turned, min(one.orientation, np.pi), ANGLE),
    ]


KINDS: dict[type[Any], Callable[[Any], list[Inequality]]] = {
    OrientationCone: _cone,
    FixedOrientation: _fixed,
    PositionBox: _position,
    OnPlane: _plane,
    OnLine: _line,
    OnCircle: _circle,
    OnArc: _arc,
    OnScrew: _screw,
    LookAt: _look,
    RelativePose: _relative,
}
"""The inequalities of each kind of statement."""
