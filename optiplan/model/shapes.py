"""From the shapes of a scene to coal geometry."""

from functools import lru_cache

import coal
import numpy as np

from optiplan.arrays import Array
from optiplan.model.scene import Box, Capsule, Cylinder, HalfSpace, Mesh, Shape, Sphere


def build_geometry(shape: Shape) -> coal.CollisionGeometry:
    """Coal geometry of a shape, in the shape's own frame, m.

    Meshes become a bounding-volume hierarchy of their triangles or, with `convex`, their convex hull.

    Raises:
        ValueError: a mesh file that cannot be read or has no volume to hull.
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


@lru_cache(maxsize=256)
def _load_mesh(shape: Mesh) -> coal.CollisionGeometry:
    """Read once per file, scale and kind; coal geometry is never changed after loading, so it is shared."""
    try:
        mesh = coal.MeshLoader(coal.BV_OBBRSS).load(str(shape.file), np.asarray(shape.scale, float))
    except Exception as error:  # assimp raises whatever it likes
        raise ValueError(f"cannot read mesh {shape.file}: {error}") from error
    geometry = convex_hull(np.asarray(mesh.vertices())) if shape.convex else mesh
    geometry.computeLocalAABB()
    return geometry


def convex_hull(vertices: Array) -> coal.ConvexBase:
    """Convex hull of points of shape (k, 3), m.

    Raises:
        ValueError: fewer than four points, or all in one plane.
    """
    distinct = np.unique(np.asarray(vertices, float).reshape(-1, 3), axis=0)
    spread = np.linalg.svd(distinct - distinct.mean(axis=0), compute_uv=False) if len(distinct) > 3 else np.zeros(3)
    if spread[-1] <= 1e-9 * spread[0] or spread[0] == 0.0:  # qhull ends the process on flat input
        raise ValueError(f"no convex hull: {len(distinct)} distinct points lie in one plane")
    points = coal.StdVec_Vec3s()
    for vertex in distinct:
        points.append(vertex)
    hull = coal.Convex.convexHull(points, True, "Qt")
    hull.computeLocalAABB()
    return hull
