"""Upper bound of the distance by which a convex body reaches beyond the mesh that it covers."""

from functools import cached_property

import coal
import numpy as np

from optiplan.arrays import Array, Flags, Index, parts_of
from optiplan.geometry.coal_queries import coal_mesh

_GRIDS = (256, 128, 64, 32)
"""Columns along each axis into which triangles are sorted: the most that leave as few entries as are allowed."""

_ENTRIES, _LEAST, _MOST = 30, 100_000, 3_000_000
"""Entries in columns, one for each that a triangle overlaps: allowed for a triangle, and for all together."""

_TILT = np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))[0]
"""A rotation after which no edge of a technical part is parallel to the test lines."""

_GIVE_UP = 200_000
"""Triangles evaluated before the remaining ones count with their bound."""


class MeshSolid:
    """The solid that triangles enclose, as a set of points with a distance.

    A point belongs to it if it is on a triangle, or if the triangles wind around it. They do if a line from the point,
    to both sides, crosses the surface outwards and inwards a different number of times.
    """

    def __init__(self, triangles: Array) -> None:
        """Take triangles (k, 3, 3), in m."""
        self.triangles = triangles
        self._surface = coal_mesh(triangles.reshape(-1, 3))

    def nearest(self, points: Array) -> tuple[Array, Index]:
        """Return the distance (p,), m, of points (p, 3) from the surface, and the nearest triangle."""
        ball, still, placed = coal.Sphere(0.0), coal.Transform3s(), coal.Transform3s()
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        distance, owner = np.empty(len(points)), np.empty(len(points), dtype=np.intp)
        for k, point in enumerate(points):
            result.clear()
            placed.setTranslation(point)
            coal.distance(self._surface, still, ball, placed, request, result)
            owner[k] = result.b1
        for part in np.array_split(np.arange(len(points)), len(points) // 10_000 + 1):
            distance[part] = _to_triangles(points[part], self.triangles[owner[part]])
        return distance, owner

    def inside(self, points: Array) -> Flags:
        """Return whether the triangles enclose points (p, 3): (p,)."""
        return self._columns.enclosed(points @ _TILT)

    @cached_property
    def _columns(self) -> "_Columns":
        return _Columns(self.triangles @ _TILT)


class _Columns:
    """Triangles (k, 3, 3) by the columns, along the last axis, of a grid that overlap their boxes."""

    def __init__(self, triangles: Array) -> None:
        a, b, c = np.moveaxis(triangles, 1, 0)
        # Side of the edge from one corner to the next, times the height of the third, sums to area times height.
        self._edges = [(u[:, :2], (v - u)[:, :2], w[:, 2]) for u, v, w in ((a, b, c), (b, c, a), (c, a, b))]
        self._areas = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        low, high = triangles[:, :, :2].min(axis=1), triangles[:, :, :2].max(axis=1)
        self._origin = low.min(axis=0)
        extent = np.maximum(high.max(axis=0) - self._origin, 1e-12)
        allowed = min(max(_ENTRIES * len(triangles), _LEAST), _MOST)
        for self._grid in _GRIDS:
            self._pitch = extent / self._grid
            first, last = self._column(low), self._column(high)
            wide, many = last[:, 0] - first[:, 0] + 1, (last - first + 1).prod(axis=1)
            if many.sum() <= allowed:
                break
        triangle, place = parts_of(many)
        column = (
            (first[triangle, 0] + place % wide[triangle]) * self._grid + first[triangle, 1] + place // wide[triangle]
        )
        self._triangles = triangle[np.argsort(column, kind="stable")]
        self._start = np.concatenate([[0], np.cumsum(np.bincount(column, minlength=self._grid**2))])

    def enclosed(self, points: Array) -> Flags:
        """Return whether up and down crossings differ on both sides of points (p, 3) along the last axis."""
        point, triangle = self._candidates(points[:, :2])
        within = np.ones((2, len(point)), dtype=bool)
        volume = np.zeros(len(point))
        for start, edge, height in self._edges:
            at, along = points[point, :2] - start[triangle], edge[triangle]
            side = along[:, 0] * at[:, 1] - along[:, 1] * at[:, 0]
            within[0] &= side > 0.0
            within[1] &= side < 0.0
            volume += side * height[triangle]
        sign = within[0].astype(np.int64) - within[1]
        above = sign * volume > sign * points[point, 2] * self._areas[triangle]
        up = np.bincount(point[above], weights=sign[above], minlength=len(points))
        down = np.bincount(point[~above], weights=sign[~above], minlength=len(points))
        return np.asarray((up != 0.0) & (down != 0.0))

    def _candidates(self, points: Array) -> tuple[Index, Index]:
        """Return pairs of points (p, 2) and triangles of the point's column, point by point."""
        column = self._column(points) @ np.array([self._grid, 1])
        count = self._start[column + 1] - self._start[column]
        point, place = parts_of(count)
        return point, self._triangles[self._start[column][point] + place]

    def _column(self, points: Array) -> Index:
        columns: Index = np.clip(((points - self._origin) / self._pitch).astype(np.intp), 0, self._grid - 1)
        return columns


def over_cover(solid: MeshSolid, faces: Array, tolerance: float, allowed: float | None = None) -> float:
    """Return an upper bound, m, of the distance of a body's surface from the mesh, where it is outside the mesh.

    The surface is cut into smaller and smaller triangles. On one with corners v_i, centroid c and radius r about it,
        distance <= min(d(c) + r, max_i d(v_i, t)),
    where t is the triangle of the mesh nearest to c: the distance from one triangle is convex. A triangle is inside if
    its centroid is inside the mesh and farther than r from the surface.

    Holds at: all points of the surface.

    Args:
        solid: the mesh.
        faces: (f, 3, 3) triangles of the body's surface, m.
        tolerance: m; the bound is at most this much above the distance of some point.
        allowed: m; bounds below it are not improved, and the search ends at a point beyond it.
    """
    best, bound, rest, looked = 0.0, 0.0, 0.0, 0
    floor, ceiling = (0.0, np.inf) if allowed is None else (allowed, allowed)
    while len(faces) and best <= ceiling and looked < _GIVE_UP:
        looked += len(faces)
        centre = faces.mean(axis=1)
        radius = np.linalg.norm(faces - centre[:, None], axis=2).max(axis=1)
        distance, owner = solid.nearest(centre)
        upper = distance + radius
        least = max(floor, best + tolerance)
        loose = np.flatnonzero(upper > least)
        corners = [_to_triangles(faces[loose, i], solid.triangles[owner[loose]]) for i in range(3)]
        upper[loose] = np.minimum(upper[loose], np.max(corners, axis=0, initial=0.0))
        loose = loose[upper[loose] > least]
        inside = solid.inside(centre[loose])
        upper[loose[inside & (distance[loose] > radius[loose])]] = 0.0
        best = max(best, float(distance[loose[~inside]].max(initial=0.0)))
        still = upper > max(floor, best + tolerance)
        bound = max(bound, float(upper[~still].max(initial=0.0)))
        faces, rest = halves(faces[still]), float(upper[still].max(initial=0.0))
    return max(best, bound, rest)


def halves(triangles: Array) -> Array:
    """Return both halves of each triangle (k, 3, 3), cut across its longest edge: (2 k, 3, 3)."""
    edges = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)  # edge i: from corner i to i + 1
    order = (edges.argmax(axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(triangles, order[:, :, None], axis=1), 1, 0)
    middle = 0.5 * (a + b)
    return np.stack([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)], axis=1).reshape(-1, 3, 3)


def _to_triangles(points: Array, triangles: Array) -> Array:
    """Return the distance (p,), m, of point k from triangle k: points (p, 3), triangles (p, 3, 3)."""
    edge = np.roll(triangles, -1, axis=1) - triangles  # (p, 3, 3), from each corner to the next
    offset = points[:, None] - triangles
    length = np.einsum("pij,pij->pi", edge, edge)
    along = np.einsum("pij,pij->pi", offset, edge) / np.where(length > 0.0, length, 1.0)
    to_edges = np.linalg.norm(offset - np.clip(along, 0.0, 1.0)[..., None] * edge, axis=2).min(axis=1)
    normal = np.cross(edge[:, 0], edge[:, 1])
    area = np.linalg.norm(normal, axis=1)
    side = np.einsum("pij,pij->pi", np.cross(edge, offset), normal[:, None])
    above = (side >= 0.0).all(axis=1) & (area > 0.0)
    height = np.abs(np.einsum("pj,pj->p", offset[:, 0], normal)) / np.where(area > 0.0, area, 1.0)
    return np.asarray(np.where(above, np.minimum(height, to_edges), to_edges))
