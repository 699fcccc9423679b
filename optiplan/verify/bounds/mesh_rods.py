"""Rods inside closed meshes."""

import coal
import numpy as np

from optiplan.arrays import Array
from optiplan.geometry.convex import mesh_triangles, mesh_vertices
from optiplan.geometry.enclosure import evenly_wound
from optiplan.geometry.over_cover import MeshSolid

STATIONS, ACROSS = 14, 7
"""Cuts across a mesh along its longest axis, and points along each side of a cut; the deepest counts."""

SPACING = 0.01
"""m, of points along a rod."""

THIN, MOST = 0.003, 12
"""m, least radius of a rod; most rods of a mesh."""


def mesh_rods(mesh: coal.BVHModelBase) -> list[tuple[Array, float]]:
    """Return rods inside the solid that a mesh encloses: ends (2, 3) and radius, m; the longest first.

    A ball about an inner point with the radius of its distance from the surface is inside. So is all that is within r
    of a segment whose points, `SPACING` apart at most, have distances of r + SPACING / 2 at least. A mesh with a hole
    has no inside: an obstacle gets there through the hole.
    """
    vertices, triangles = mesh_vertices(mesh), mesh_triangles(mesh)
    if not len(triangles) or not evenly_wound(vertices, triangles):
        return []
    solid = MeshSolid(vertices[triangles])
    nodes = _deepest(solid, vertices)
    found = []
    for i in range(len(nodes)):
        for j in range(i, len(nodes)):
            length = float(np.linalg.norm(nodes[j] - nodes[i]))
            points = nodes[i] + np.linspace(0.0, 1.0, int(length / SPACING) + 2)[:, None] * (nodes[j] - nodes[i])
            if not solid.inside(points).all():
                continue
            radius = float(solid.nearest(points)[0].min()) - 0.5 * SPACING
            if radius > THIN:
                found.append((np.vstack([nodes[i], nodes[j]]), radius))
    found.sort(key=lambda rod: -float(np.linalg.norm(rod[0][1] - rod[0][0]) + 2.0 * rod[1]))
    kept: list[tuple[Array, float]] = []
    for ends, radius in found:
        if len(kept) < MOST and not any(_within(ends, radius, other) for other in kept):
            kept.append((ends, radius))
    return kept


def _within(ends: Array, radius: float, other: tuple[Array, float]) -> bool:
    """Whether a rod is about the same as another, or a thinner part of it."""
    a, b = other[0]
    way = b - a
    share = np.clip((ends - a) @ way / max(float(way @ way), 1e-12), 0.0, 1.0)
    away = np.linalg.norm(a + share[:, None] * way - ends, axis=1).max()
    return bool(away + radius < other[1] + 0.004)


def _deepest(solid: MeshSolid, vertices: Array) -> Array:
    """The deepest points (S, 3), m, of cuts across the mesh, those without an inner point left out."""
    middle = vertices.mean(axis=0)
    axes = np.linalg.svd(vertices - middle, full_matrices=False)[2]
    own = (vertices - middle) @ axes.T
    low, high = own.min(axis=0), own.max(axis=0)
    inner = [np.linspace(a, b, n + 2)[1:-1] for a, b, n in zip(low, high, (STATIONS, ACROSS, ACROSS), strict=True)]
    found = []
    for along in inner[0]:
        y, z = np.meshgrid(inner[1], inner[2])
        points = middle + np.column_stack([np.full(y.size, along), y.ravel(), z.ravel()]) @ axes
        points = points[solid.inside(points)]
        if len(points):
            found.append(points[solid.nearest(points)[0].argmax()])
    return np.array(found).reshape(-1, 3)
