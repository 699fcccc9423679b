"""Shapes of coal as shapes of the native core."""

from collections import OrderedDict
from typing import TYPE_CHECKING

import coal
import numpy as np

from optiplan._core import core
from optiplan.arrays import Array, Index
from optiplan.cache import digest
from optiplan.geometry.convex import mesh_triangles, mesh_vertices

if TYPE_CHECKING:
    from optiplan._core._core_base import Shape

_KEPT = 512
"""Hulls and meshes kept in memory: the index of their vertices takes milliseconds to make."""

_made: "OrderedDict[str, Shape]" = OrderedDict()


def native_shape(body: coal.CollisionGeometry) -> "Shape | None":
    """The same shape for the core; None of a kind that it does not know."""
    match body:
        case coal.Sphere():
            return core.Shape.sphere(body.radius)
        case coal.Capsule():
            return core.Shape.capsule(body.radius, body.halfLength)
        case coal.Cylinder():
            return core.Shape.cylinder(body.radius, body.halfLength)
        case coal.Box():
            return core.Shape.box(np.array(body.halfSide))
        case coal.Halfspace():
            return core.Shape.half_space(np.array(body.n), body.d)
        case coal.ConvexBase():
            return _hull(np.array(body.points()))
        case coal.BVHModelBase():
            return _mesh(mesh_vertices(body), mesh_triangles(body))
    return None


def _hull(points: Array) -> "Shape":
    key = digest([points.tobytes()])
    return _made[key] if key in _made else _keep(key, core.Shape.convex_hull(points))


def _mesh(vertices: Array, triangles: Index) -> "Shape":
    corners = np.ascontiguousarray(triangles, dtype=np.int64)
    key = digest([vertices.tobytes(), corners.tobytes()])
    return _made[key] if key in _made else _keep(key, core.Shape.triangles(vertices, corners))


def _keep(key: str, shape: "Shape") -> "Shape":
    _made[key] = shape
    if len(_made) > _KEPT:
        _made.popitem(last=False)
    return shape
