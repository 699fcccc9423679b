"""Convex hulls within the limits of coal: flat hulls are thickened, hulls with too many neighbours get fewer faces."""

from typing import Any

import coal
import numpy as np

from optiplan import cache
from optiplan.arrays import Array, Index
from optiplan.geometry.over_cover import MeshSolid
from optiplan.records import dataclass

FLAT = 1e-5
"""m; thickness added to flat meshes on either side."""

_VERSION = b"1"
"""Change it when `covering_hull` returns something else, so that cached hulls are made again."""

_LEAST_RATIO = 1e-6
"""Thickness, as a share of the extent, below which qhull's rounding decides which points are corners."""

_MOST_NEIGHBOURS = 255
"""coal counts the neighbours of a vertex in eight bits and writes beyond its memory if there are more."""

_FACES = 200
"""Faces of a simplified hull: no corner has more neighbours than there are faces, so coal can count them."""


@dataclass(frozen=True, eq=False)
class Hull:
    """A convex body that covers points: vertices (k, 3) in m, triangles (f, 3), counter-clockwise from outside.

    `over_cover` (m) is how far it reaches beyond the hull of the points at most; 0 for the hull itself.
    """

    vertices: Array
    triangles: Index
    over_cover: float = 0.0

    @classmethod
    def of_bytes(cls, content: bytes) -> "Hull":
        """Return the hull that `to_bytes` wrote."""
        (count, faces), rest = np.frombuffer(content[:16], np.int64), content[16:]
        corners = np.frombuffer(rest[: 24 * count], np.float64).reshape(-1, 3).copy()
        triangles = np.frombuffer(rest[24 * count : 24 * (count + faces)], np.int64).reshape(-1, 3).astype(np.intp)
        return cls(corners, triangles, float(np.frombuffer(rest[-8:], np.float64)[0]))

    def to_bytes(self) -> bytes:
        """Return the hull as bytes: the numbers of vertices and triangles, both arrays, `over_cover`."""
        sizes = np.array([len(self.vertices), len(self.triangles)], np.int64)
        parts = sizes, self.vertices.astype(np.float64), self.triangles.astype(np.int64), np.array([self.over_cover])
        return b"".join(np.ascontiguousarray(part).tobytes() for part in parts)

    def build(self) -> coal.ConvexBase:
        """Build the geometry of coal, by way of a mesh, which takes its numbers as arrays: in a third of the time."""
        mesh = coal.BVHModelOBBRSS()
        mesh.beginModel(len(self.triangles), len(self.vertices))
        mesh.addVertices(self.vertices)
        mesh.addTriangles(self.triangles)
        mesh.buildConvexRepresentation(True)
        body = mesh.convex
        body.computeLocalAABB()
        return body


def convex_hull(vertices: Array) -> coal.ConvexBase:
    """Return `covering_hull` of points (k, 3), m, as geometry of coal; cached on disk.

    Raises:
        ValueError: fewer than four points, all in one plane, or not finite.
    """
    return kept_hull(vertices).build()


def covering_hull(vertices: Array) -> Hull:
    """Return the hull of points (k, 3), m, or a convex body around it where coal cannot build the hull.

    Points thinner than a millionth of their extent are thickened by `FLAT` or by that millionth. A hull with a corner
    of more than 255 neighbours is replaced by `_FACES` of its supporting half-spaces.

    Raises:
        ValueError: fewer than four points, all in one plane, or not finite.
    """
    from scipy.spatial import ConvexHull, QhullError

    distinct = np.unique(np.asarray(vertices, float).reshape(-1, 3), axis=0)
    if not np.isfinite(distinct).all():
        raise ValueError("no convex hull of points that are not finite")
    spread = np.linalg.svd(distinct - distinct.mean(axis=0), compute_uv=False) if len(distinct) > 3 else np.zeros(3)
    if spread[-1] <= 1e-9 * spread[0] or spread[0] == 0.0:
        raise ValueError(f"no convex hull: {len(distinct)} distinct points lie in one plane")
    if spread[-1] <= _LEAST_RATIO * spread[0]:
        return thickened_hull(distinct)
    try:
        return _within_limits(ConvexHull(distinct, qhull_options="Qt"))
    except QhullError:
        return thickened_hull(distinct)


def plain_hull(points: Array) -> Hull:
    """Return the hull of points (k, 3), m, as qhull finds it: also where coal cannot build it.

    Raises:
        QhullError: fewer than four points, or all in one plane.
    """
    from scipy.spatial import ConvexHull

    return _outward(ConvexHull(points))


def kept_hull(vertices: Array) -> Hull:
    """Return `covering_hull` of points (k, 3), m, cached on disk: for the shapes of robots and scenes.

    Raises:
        ValueError: as `covering_hull`.
    """
    points = np.ascontiguousarray(vertices, dtype=np.float64).reshape(-1, 3)
    name = f"hulls/{cache.digest([_VERSION, points.tobytes()])}"
    return Hull.of_bytes(cache.kept(name, lambda: covering_hull(points).to_bytes()))


def solid_hull(points: Array) -> Hull:
    """Return `kept_hull` of points (k, 3), m, or `thickened_hull` of points in a plane."""
    try:
        return kept_hull(points)
    except ValueError:
        return thickened_hull(points)


def thickened_hull(points: Array) -> Hull:
    """Return the hull of octahedra of radius `FLAT`, or a millionth of the extent, about points (k, 3), m."""
    from scipy.spatial import ConvexHull

    by = max(FLAT, 2.0 * _LEAST_RATIO * float(np.ptp(points, axis=0).max(initial=0.0)))
    corners = by * np.concatenate([np.eye(3), -np.eye(3)])
    hull = _within_limits(ConvexHull((points[:, None] + corners).reshape(-1, 3), qhull_options="Qt"))
    return Hull(hull.vertices, hull.triangles, hull.over_cover + by)


def _within_limits(hull: Any) -> Hull:
    """Return the hull, or a body of fewer faces around it if a corner has more neighbours than coal can count."""
    from scipy.spatial import ConvexHull

    plain = _outward(hull)
    edges = np.unique(np.sort(plain.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    if np.bincount(edges.ravel()).max() <= _MOST_NEIGHBOURS:
        return plain
    around = _outward(ConvexHull(_supporting(plain.vertices, hull.equations), qhull_options="Qt"))
    beyond = MeshSolid(plain.vertices[plain.triangles]).nearest(around.vertices)[0]
    return Hull(around.vertices, around.triangles, float(beyond.max()))


def _supporting(vertices: Array, faces: Array) -> Array:
    """Return the corners (k, 3), m, of the intersection of `_FACES` supporting half-spaces of vertices (v, 3).

    Their normals are those of a box about the body, then those of its faces (f, 4), each time the farthest from all
    normals chosen before.
    """
    from scipy.spatial import HalfspaceIntersection

    centre = vertices.mean(axis=0)
    _, _, axes = np.linalg.svd(vertices - centre, full_matrices=False)
    normals = np.concatenate([axes, -axes, np.empty((_FACES - 6, 3))])
    nearest = (faces[:, :3] @ normals[:6].T).max(axis=1)
    for k in range(6, _FACES):
        normals[k] = faces[np.argmin(nearest), :3]
        nearest = np.maximum(nearest, faces[:, :3] @ normals[k])
    normals = np.unique(normals, axis=0)
    support = (normals @ (vertices - centre).T).max(axis=1)
    scale = float(np.abs(support).max())
    halves = np.column_stack([normals, -(support + 1e-12 * scale)])
    return np.asarray(HalfspaceIntersection(halves, np.zeros(3)).intersections + centre, dtype=np.float64)


def _outward(hull: Any) -> Hull:
    """Return the corners and triangles of a hull, the triangles counter-clockwise from outside."""
    used, where = np.unique(hull.simplices, return_inverse=True)
    vertices, corners = hull.points[used], np.asarray(where, dtype=np.intp).reshape(-1, 3)
    a, b, c = np.moveaxis(vertices[corners], 1, 0)
    inward = np.einsum("fi,fi->f", np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    corners[inward] = corners[inward][:, ::-1]
    return Hull(vertices, corners)
