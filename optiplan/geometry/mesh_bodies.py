"""Bodies of coal made of triangles, kept by content."""

from functools import lru_cache
from pathlib import Path

import coal
import numpy as np

from optiplan.arrays import Array
from optiplan.config.values import LARGEST_COORDINATE
from optiplan.geometry.convex_hulls import convex_hull
from optiplan.geometry.meshes.reading import known, open_mesh, read_mesh
from optiplan.geometry.meshes.triangles import Soup, Triangles


def mesh_body(path: Path, key: str, scale: tuple[float, float, float], convex: bool) -> coal.CollisionGeometry:
    """Bounding-volume hierarchy of the triangles of a file or, with `convex`, their convex hull.

    Args:
        path: of the file.
        key: digest of what the file has to hold, by `open_mesh`; empty: whatever it holds.
        scale: of its numbers.
        convex: whether the hull is wanted.

    Raises:
        ValueError: it cannot be read, holds NaN or infinity, or has no volume to hull.
    """
    soup = known(key) if key else None
    if soup is None:
        file = open_mesh(path)
        if key not in ("", file.key):
            raise ValueError(f"mesh {path} is not what it was when it was loaded")
        soup = read_mesh(file)
    try:
        return _built(soup, scale, convex)
    except ValueError as error:
        raise ValueError(f"mesh {path}: {error}") from error


@lru_cache(maxsize=256)
def _built(soup: Soup, scale: tuple[float, float, float], convex: bool) -> coal.CollisionGeometry:
    """Made once per content, scale and kind; coal geometry is never changed after it is made, so it is shared."""
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
