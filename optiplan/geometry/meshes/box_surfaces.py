"""Corners of boxes, and surfaces of many boxes as triangles."""

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.geometry.meshes.triangles import Triangles

BOX_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
"""Corners (8, 3) of the unit cube: which end of a box each has along each axis."""

_FACES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
"""Corners of the faces -x, +x, -y, +y, -z, +z, counter-clockwise from outside."""


def box_corners(half: Array) -> Array:
    """Return the corners (..., 8, 3) of boxes about the origin, with axes along x, y, z, by their half edges (..., 3).

    They are in the order of `BOX_CORNERS`.
    """
    return (2.0 * BOX_CORNERS - 1.0) * half[..., None, :]


def surface_of_boxes(low: Array, high: Array) -> tuple[Array, Triangles]:
    """Return vertices (8 k, 3) and triangles (12 k, 3) of k boxes along the axes, with corners low and high (k, 3)."""
    vertices = low[:, None] + BOX_CORNERS * (high - low)[:, None]
    faces = (8 * np.arange(len(low))[:, None, None] + _FACES).reshape(-1, 4)
    return vertices.reshape(-1, 3), _halved(faces)


def surface_of_cells(low: Index, edge: Index) -> tuple[Index, Triangles]:
    """Return vertices and triangles of disjoint cubes on a grid, without common faces of two cubes of one size.

    The result is the boundary of their union: every edge is passed as often in one direction as in the other.

    Args:
        low: (k, 3) lowest corners.
        edge: (k,) their edges.
    """
    corners = low[:, None] + BOX_CORNERS * edge[:, None, None]  # (k, 8, 3)
    faces = corners[:, _FACES]  # (k, 6, 4, 3)
    middle = faces.sum(axis=2)  # four times the middle of each face, which identifies it
    names = np.concatenate([middle, np.repeat(edge[:, None, None], 6, axis=1)], axis=2).reshape(-1, 4)
    _, which, many = np.unique(names, axis=0, return_inverse=True, return_counts=True)
    single = faces.reshape(-1, 4, 3)[many[which.reshape(-1)] == 1]
    vertices, index = np.unique(single.reshape(-1, 3), axis=0, return_inverse=True)
    return vertices, _halved(index.reshape(-1, 4))


def _halved(faces: Index) -> Triangles:
    return np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]]).astype(np.int64)
