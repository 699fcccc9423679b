"""Convex stand-ins for meshes: the hull, or several pieces that together contain the mesh."""

import coal
import numpy as np

from optiplan.arrays import Array


def vertices_of(mesh: coal.BVHModelBase) -> Array:
    """Vertices of a mesh, shape (k, 3), in m."""
    return np.asarray(mesh.vertices(), dtype=np.float64).reshape(-1, 3)


def hull_of(points: Array) -> coal.ConvexBase:
    """Convex hull of points of shape (k, 3), in m.

    Raises:
        RuntimeError: the points lie in one plane.
    """
    cloud = coal.StdVec_Vec3s()
    for point in np.unique(points, axis=0):
        cloud.append(point)
    return coal.Convex.convexHull(cloud, True, "Qt")
