"""Bodies of coal made of triangles, kept by content."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import coal
import numpy as np

from optiplan.arrays import Array
from optiplan.config.values import LARGEST_COORDINATE
from optiplan.geometry.convex_hulls import convex_hull
from optiplan.geometry.meshes.box_surfaces import surface_of_boxes
from optiplan.geometry.meshes.reading import Kind, known, open_mesh, read_mesh
from optiplan.geometry.meshes.triangles import MOST_TRIANGLES, Soup, Triangles


@dataclass(frozen=True)
class Source:
    """A file of a body: `key` is the digest of what it has to hold, by `open_mesh`; empty: whatever it holds."""

    path: Path
    key: str
    kind: Kind

    def soup(self) -> Soup:
        """What the file holds.

        Raises:
            ValueError: it cannot be read, or is not what it was.
        """
        soup = known(self.key) if self.key else None
        if soup is None:
            file = open_mesh(self.path, self.kind)
            if self.key not in ("", file.key):
                raise ValueError(f"{self.kind} {self.path} is not what it was when it was loaded")
            soup = read_mesh(file)
        return soup


def mesh_body(source: Source, scale: tuple[float, float, float], convex: bool) -> coal.CollisionGeometry:
    """Bounding-volume hierarchy of the triangles of a file or, with `convex`, their convex hull.

    Args:
        source: the file.
        scale: of its numbers.
        convex: whether the hull is wanted.

    Raises:
        ValueError: it cannot be read, holds NaN or infinity, or has no volume to hull.
    """
    soup = source.soup()
    try:
        return _built(soup, scale, convex)
    except ValueError as error:
        raise ValueError(f"{source.kind} {source.path}: {error}") from error


def cloud_body(source: Source, radius: float) -> coal.CollisionGeometry:
    """Bounding-volume hierarchy of boxes that hold all points within `radius`, m, of the points of a file.

    The points are gathered in cells with edges of `radius`; of each cell, the least box along the axes that holds the
    balls of its points. So nothing is closer to a point than it seems, and a box reaches at most 0.74 radius + (what
    the points of one cell are apart) beyond the balls.

    Raises:
        ValueError: it cannot be read, or there are too many cells.
    """
    points = source.soup()
    try:
        return _gathered(points, radius)
    except ValueError as error:
        raise ValueError(f"{source.kind} {source.path}: {error}") from error


@lru_cache(maxsize=64)
def _gathered(soup: Soup, radius: float) -> coal.CollisionGeometry:
    points = soup.vertices
    check_reach(points)
    cells = np.floor(points / radius)
    order = np.lexsort(cells.T)
    begins = np.flatnonzero(np.concatenate([[True], (np.diff(cells[order], axis=0) != 0.0).any(axis=1)]))
    if 12 * len(begins) > MOST_TRIANGLES:
        raise ValueError(
            f"its points fill {len(begins)} cells of {radius:g} m, at most {MOST_TRIANGLES // 12} are kept: "
            "a larger radius makes fewer"
        )
    low = np.minimum.reduceat(points[order], begins) - radius
    high = np.maximum.reduceat(points[order], begins) + radius
    return triangle_mesh(*surface_of_boxes(low, high))


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
