"""Antipodal grasps of boxes and cylinders: two parallel fingers on opposite faces.

A gripper G comes along its axis z and closes along its axis y; its origin, the TCP, is between the fingertips. On a box
the fingers close on two opposite faces, on a cylinder across its diameter or on its ends.

Source: V.-D. Nguyen, "Constructing force-closure grasps", IJRR 1988: two contacts with friction hold where the line
between them is within both friction cones; here it is along both normals.
"""

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.shape import Shape
from optiplan.geometry.shapes import Box, Cylinder

DEEPEST = 0.03
"""m: how far the TCP goes below the surface at most where no depth is stated."""

_ALONG = (0.0, 0.5, -0.5)
"""Shares of half a length at which fingers close along it, the middle first."""

_SHORT = 0.02
"""m: a shorter body is grasped in its middle alone."""


def graspable(shape: Shape) -> bool:
    """Return whether there are grasps of shapes of this kind."""
    return isinstance(shape, Box | Cylinder)


def least_width(shape: Shape) -> float:
    """Return how far apart fingers have to be at least, m."""
    if isinstance(shape, Box):
        return float(min(shape.size))
    assert isinstance(shape, Cylinder)
    return float(min(2.0 * shape.radius, shape.length))


def grasps(shape: Shape, opening: float, depth: float | None = None, turns: int = 8) -> list[pin.SE3]:
    """Return the poses X_OG of a gripper in the frame of a box or cylinder, those in its middle first.

    Args:
        shape: of the object.
        opening: greatest distance between the fingers, m; wider sides are not grasped.
        depth: of the TCP below the surface that it comes through, m; None: to the middle, at most 30 mm.
        turns: directions about the axis of a cylinder.
    """
    found = list(
        _of_box(shape, opening, depth) if isinstance(shape, Box) else _of_cylinder(shape, opening, depth, turns)
    )
    return sorted(found, key=lambda X: round(float(np.linalg.norm(X.translation)), 9))


def _of_box(box: Box, opening: float, depth: float | None) -> Iterator[pin.SE3]:
    half, axes = 0.5 * np.array(box.size), np.eye(3)
    for closing in range(3):
        if 2.0 * half[closing] > opening:
            continue
        for coming in (k for k in range(3) if k != closing):
            (across,) = {0, 1, 2} - {closing, coming}
            for side, flip, share in _combined(half[across]):
                place = side * _reach(half[coming], depth) * axes[coming] + share * half[across] * axes[across]
                yield _gripper(-side * axes[coming], flip * axes[closing], place)


def _of_cylinder(shape: Shape, opening: float, depth: float | None, turns: int) -> Iterator[pin.SE3]:
    assert isinstance(shape, Cylinder)
    radius, half, up = shape.radius, 0.5 * shape.length, np.eye(3)[2]
    for angle in 2.0 * np.pi * np.arange(turns) / turns:
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        beside = np.array([-np.sin(angle), np.cos(angle), 0.0])
        if 2.0 * radius <= opening:
            for flip in (1.0, -1.0):
                for share in _ALONG if 2.0 * half > _SHORT else (0.0,):
                    place = _reach(radius, depth) * out + share * half * up
                    yield _gripper(-out, flip * beside, place)
            for side in (1.0, -1.0):
                yield _gripper(-side * up, beside, side * _reach(half, depth) * up)
        if 2.0 * half <= opening:
            for flip in (1.0, -1.0):
                yield _gripper(-out, flip * up, _reach(radius, depth) * out)


def _combined(half: float) -> Iterator[tuple[float, float, float]]:
    for side in (1.0, -1.0):
        for flip in (1.0, -1.0):
            for share in _ALONG if 2.0 * half > _SHORT else (0.0,):
                yield side, flip, share


def _reach(half: float, depth: float | None) -> float:
    """Return how far from the middle the TCP is, m."""
    return float(half - min(half, DEEPEST if depth is None else depth))


def _gripper(coming: Array, closing: Array, place: Array) -> pin.SE3:
    """Return the pose of a gripper that comes along one direction and closes along another, (3,) each."""
    return pin.SE3(np.column_stack([np.cross(closing, coming), closing, coming]), place)


def gripper_in_frame(along: Array, closing: Array) -> pin.SE3:
    """Return X_FG of a gripper whose frame F comes along one of its directions and closes along another, (3,) each."""
    return _gripper(along, closing, np.zeros(3))
