"""Polyhedra around round bodies, and triangles as files, STL and OBJ."""

from collections.abc import Collection

import numpy as np

from optiplan.arrays import Array
from optiplan.geometry.meshes.triangles import Triangles

SIDES = 32
"""Of the polygon around a circle."""


def stl_bytes(vertices: Array, triangles: Triangles) -> bytes:
    """A binary STL of vertices (k, 3), m, and triangles (m, 3)."""
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows = np.zeros(len(triangles), record)
    rows["corners"] = vertices[triangles]
    return bytes(80) + len(triangles).to_bytes(4, "little") + rows.tobytes()


def obj_text(vertices: Array, triangles: Triangles) -> str:
    """An OBJ of vertices (k, 3), m, to the last digit, and triangles (m, 3)."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles.tolist()]
    return "\n".join(lines) + "\n"


def mesh_file(name: str, form: str, taken: Collection[str]) -> str:
    """The path of a mesh, `form` with the name of its body for `{}`, numbered where another mesh has it."""
    plain = "".join(c if c.isalnum() or c in "-_" else "_" for c in name)
    numbered = (form.format(f"{plain}{k or ''}") for k in range(len(taken) + 1))
    return next(file for file in numbered if file not in taken)


def ellipsoid_hull(a: float, b: float, c: float) -> tuple[Array, Triangles]:
    """A polyhedron around the ellipsoid with half-axes a, b, c: an octahedron split three times, blown up.

    The unit ball touches it from inside: the vertices are on the sphere of radius 1 / r, with r the least distance of a
    facet of the polyhedron in the unit sphere from its centre. An affine map keeps what is inside inside.
    """
    corners = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    faces = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]]
    points = corners[np.array(faces)]
    for _ in range(3):
        p, q, r = points[:, 0], points[:, 1], points[:, 2]
        pq, qr, rp = p + q, q + r, r + p
        parts = [np.stack(part, axis=1) for part in ((p, pq, rp), (pq, q, qr), (rp, qr, r), (pq, qr, rp))]
        points = np.concatenate(parts)
        points /= np.linalg.norm(points, axis=2, keepdims=True)
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    inside = float(np.min(np.einsum("ij,ij->i", normals, points[:, 0])))
    flat = points.reshape(-1, 3) / inside * np.array([a, b, c])
    vertices, index = np.unique(flat.round(12), axis=0, return_inverse=True)
    return vertices, index.reshape(-1, 3)


def frustum_hull(bottom: float, top: float, height: float) -> tuple[Array, Triangles]:
    """A polyhedron around the cone or cylinder about z with these radii at -height / 2 and height / 2.

    Its polygons of n sides touch the circles from outside: their corners are at r / cos(π / n), 0.5 % further out.
    """
    angles = 2.0 * np.pi * np.arange(SIDES) / SIDES
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1) / np.cos(np.pi / SIDES)
    rings = [np.column_stack([r * circle, np.full(SIDES, z)]) for r, z in ((bottom, -0.5), (top, 0.5))]
    vertices = np.concatenate(rings) * np.array([1.0, 1.0, height])
    if top == 0.0:
        vertices = vertices[: SIDES + 1]
    faces = [(0, k + 1, k) for k in range(1, SIDES - 1)]
    for k in range(SIDES):
        after = (k + 1) % SIDES
        if top == 0.0:
            faces.append((k, after, SIDES))
        else:
            faces += [(k, after, SIDES + after), (k, SIDES + after, SIDES + k)]
    if top != 0.0:
        faces += [(SIDES, SIDES + k, SIDES + k + 1) for k in range(1, SIDES - 1)]
    return vertices, np.array(faces)
