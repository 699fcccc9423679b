"""From the shapes of a scene to coal geometry."""

from functools import lru_cache

import coal
import numpy as np

from optiplan.arrays import Array
from optiplan.geometry.convex_hulls import convex_hull
from optiplan.geometry.meshes.reading import known, open_mesh, read_mesh
from optiplan.geometry.meshes.triangles import Soup, Triangles
from optiplan.geometry.scene import LARGEST_COORDINATE, Box, Capsule, Cylinder, HalfSpace, Mesh, Shape, Sphere

__all__ = ["build_geometry", "convex_hull"]


def build_geometry(shape: Shape) -> coal.CollisionGeometry:
    """Coal geometry of a shape, in the shape's own frame, m.

    Meshes become a bounding-volume hierarchy of their triangles or, with `convex`, their convex hull.

    Raises:
        ValueError: a mesh file that cannot be read, holds NaN or infinity, or has no volume to hull.
    """
    match shape:
        case Box(size):
            geometry = coal.Box(*size)
        case Sphere(radius):
            geometry = coal.Sphere(radius)
        case Cylinder(radius, length):
            geometry = coal.Cylinder(radius, length)
        case Capsule(radius, length):
            geometry = coal.Capsule(radius, length)
        case HalfSpace(normal, offset):
            geometry = coal.Halfspace(np.asarray(normal, float), float(offset))
        case Mesh():
            return _load_mesh(shape)
    geometry.computeLocalAABB()
    return geometry


def _load_mesh(shape: Mesh) -> coal.CollisionGeometry:
    soup = known(shape.key) if shape.key else None
    if soup is None:
        file = open_mesh(shape.file)
        if shape.key not in ("", file.key):
            raise ValueError(f"mesh {shape.file} is not what it was when it was loaded")
        soup = read_mesh(file)
    try:
        return _built(soup, shape.scale, shape.convex)
    except ValueError as error:
        raise ValueError(f"mesh {shape.file}: {error}") from error


@lru_cache(maxsize=256)
def _built(soup: Soup, scale: tuple[float, float, float], convex: bool) -> coal.CollisionGeometry:
    """Build geometry, once per content, scale and kind; it is never changed afterwards, so it is shared."""
    vertices = (soup.vertices @ soup.turn.T) * np.asarray(scale, float)
    if convex:
        check_reach(vertices)
        return convex_hull(vertices)
    return triangle_mesh(vertices, soup.triangles)


def check_reach(vertices: Array) -> None:
    """Refuse vertices (k, 3), m, that are too far away, or no numbers.

    Raises:
        ValueError: says so.
    """
    if not (np.abs(vertices) <= LARGEST_COORDINATE).all():  # written so that NaN is refused too
        raise ValueError(f"a vertex that is no number or beyond {LARGEST_COORDINATE:g} m")


def triangle_mesh(vertices: Array, triangles: Triangles) -> coal.BVHModelBase:
    """Bounding-volume hierarchy of triangles (m, 3), indices of vertices (k, 3) in m.

    Raises:
        ValueError: a vertex that is too far away.
    """
    check_reach(vertices)
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(triangles), len(vertices))
    mesh.addVertices(vertices)
    mesh.addTriangles(triangles)
    mesh.endModel()
    mesh.computeLocalAABB()
    return mesh
