"""Triangles of any body, round ones too, for pictures that are drawn without a browser."""

import coal
import numpy as np

from optiplan.arrays import Array
from optiplan.geometry.shape import Shape
from optiplan.geometry.shapes import Box, Capsule, Cylinder, Sphere, shape_of_body
from optiplan.viewer.surfaces import Surface, bounded, bvh_surface, hull_surface

ROUND = 24
"""Corners of a circle."""


def body_triangles(body: coal.CollisionGeometry) -> Surface:
    """Triangles of a body of coal in its own frame, m; bodies of a kind that is not known by their bounding box."""
    shape = shape_of_body(body)
    points = None if shape is None else _corners(shape)
    if points is not None:
        return hull_surface(points)
    match body:
        case coal.ConvexBase():
            return hull_surface(np.asarray(body.points(), dtype=float))
        case coal.BVHModelBase():
            return bounded(bvh_surface(body))
    body.computeLocalAABB()
    box = body.aabb_local
    return hull_surface(_box(box.max_ - box.min_) + 0.5 * (box.min_ + box.max_))


def _corners(shape: Shape) -> Array | None:
    """Points (k, 3), m, whose convex hull is the shape, or nearly; None where the shape has none of its own."""
    match shape:
        case Box():
            return _box(np.array(shape.size))
        case Sphere():
            return shape.radius * _ball()
        case Cylinder():
            ends = np.array([[0.0, 0.0, -0.5 * shape.length], [0.0, 0.0, 0.5 * shape.length]])
            return np.concatenate([shape.radius * _circle() + end for end in ends])
        case Capsule():
            ball, half = shape.radius * _ball(), np.array([0.0, 0.0, 0.5 * shape.length])
            return np.concatenate([ball - half, ball + half])
    picture = shape.picture()
    return None if picture is None or isinstance(picture, dict) else picture


def _box(size: Array) -> Array:
    signs = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    return signs * size


def _circle() -> Array:
    turn = np.linspace(0.0, 2.0 * np.pi, ROUND, endpoint=False)
    return np.column_stack([np.cos(turn), np.sin(turn), np.zeros(ROUND)])


def _ball() -> Array:
    rise = np.linspace(-0.5 * np.pi, 0.5 * np.pi, ROUND // 2 + 1)[1:-1]
    rings = [np.cos(angle) * _circle() + [0.0, 0.0, np.sin(angle)] for angle in rise]
    return np.concatenate([*rings, [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]])
