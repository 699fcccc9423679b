"""Convex pieces that cover a mesh and reach beyond it by at most a given, measured distance."""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from optiplan.arrays import Array
from optiplan.geometry.meshes.box_surfaces import BOX_CORNERS
from optiplan.geometry.over_cover import MeshSolid, over_cover
from optiplan.records import dataclass

_STEP = 1e-4
"""m; triangles that differ by less along an axis belong to one flat step of the surface."""

_PLANE_TOLERANCE = 1e-7
"""m; corners nearer to a plane than this lie in it."""

_SAMPLE = 400
"""Triangles by which a cut is chosen, an even sample if there are more; the cut itself divides all."""

_LARGEST = 24
"""Faces of a hull whose middles are checked before the whole hull."""


@dataclass(frozen=True)
class PieceOptions:
    """Options of the decomposition into pieces.

    Attributes:
        over_cover: m, how far a piece may reach beyond the mesh.
        tolerance: m, accuracy of that measurement.
        places: planes tried along each axis of a piece: evenly spaced, and along steps of its surface.
        most: pieces; a mesh that needs more is not cut. 20 queries of two hulls cost as much as one of a mesh.
    """

    over_cover: float = 1e-3
    tolerance: float = 2e-4
    places: int = 6
    most: int = 16


@dataclass(frozen=True)
class ConvexPieces:
    """Convex pieces by their vertices, each (k, 3) in m, and how far (m) they reach beyond the mesh at most."""

    vertices: tuple[Array, ...]
    over_cover: float


@dataclass(frozen=True, eq=False)
class _Cell:
    """The part of a mesh within a box: triangles (k, 3, 3) clipped to it, the box (2, 3), and its hull.

    The hull contains the clipped triangles and the corners of the box that are inside the mesh. These include all
    extreme points of the intersection of solid and box, so the hull contains that intersection.
    """

    triangles: Array
    box: Array
    points: Array
    volume: float


def measured(solid: MeshSolid, bodies: Sequence[Array], tolerance: float = PieceOptions.tolerance) -> float:
    """Return how far (m) the hulls of points, (k, 3) each, reach beyond a mesh at most, to within a tolerance (m)."""
    hulls = [(points, _hull(points)) for points in bodies]
    return over_cover(solid, np.concatenate([points[hull.simplices] for points, hull in hulls]), tolerance)


def cut(solid: MeshSolid, options: PieceOptions = PieceOptions()) -> ConvexPieces | None:
    """Cut a mesh into convex pieces, each the hull of the part within a box; None where `options.most` is too few.

    A piece that reaches too far beyond the mesh is cut across one of three axes, by the plane that leaves the least
    volume in the hulls of both parts. Pieces whose common hull is within the bound are then joined again. All parts
    are cut once before any is cut again, so that a mesh that needs too many pieces is recognised early.

    Args:
        solid: the mesh.
        options: how finely it is cut.
    """
    corners = solid.triangles.reshape(-1, 3)
    box = np.array([corners.min(axis=0) - 1e-3, corners.max(axis=0) + 1e-3])
    first = _cell(solid.triangles, box, *_inner_corners(solid, box[None]))
    waiting: deque[tuple[str, _Cell]] = deque()
    done: dict[str, tuple[Array, float]] = {}
    fresh = [("", first)] if first else []
    while fresh or waiting:
        for name, cell in fresh:
            if _close(solid, cell.points, options):
                done[name] = cell.points, cell.volume
            else:
                waiting.append((name, cell))
        if len(done) + 2 * len(waiting) > 2 * options.most + 2:  # each waiting piece becomes at least two
            return None
        fresh = []
        if waiting:
            name, cell = waiting.popleft()
            halves = _best_cut(solid, cell, options.places)
            if halves is None:
                return None
            fresh = [(name + side, half) for side, half in zip("ba", halves, strict=True)]
    pieces = _join(solid, [done[name] for name in sorted(done)], options)
    if not 0 < len(pieces) <= options.most:
        return None
    return ConvexPieces(tuple(pieces), measured(solid, pieces, options.tolerance))


def _close(solid: MeshSolid, points: Array, options: PieceOptions) -> bool:
    """Return whether the hull of points is within the bound; its largest faces, which span hollows, come first."""
    faces = points[_hull(points).simplices]
    area = np.linalg.norm(np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]), axis=1)
    middles = faces[np.argsort(-area, kind="stable")[:_LARGEST]].mean(axis=1)
    if (~solid.inside(middles) & (solid.nearest(middles)[0] > options.over_cover)).any():
        return False
    return over_cover(solid, faces, options.tolerance, allowed=options.over_cover) <= options.over_cover


def _best_cut(solid: MeshSolid, cell: _Cell, places: int) -> tuple[_Cell, _Cell] | None:
    """Return the two parts of a cell whose hulls have the least total volume; None where no plane cuts it."""
    rough = replace(cell, triangles=cell.triangles[:: len(cell.triangles) // _SAMPLE + 1])
    cuts = [(axis, place) for axis in range(3) for place in _places(rough, axis, places)]
    found = zip(cuts, _halves(solid, rough, cuts), strict=True)
    options = sorted((parts[0].volume + parts[1].volume, *chosen) for chosen, parts in found if parts is not None)
    for _, axis, place in options:
        parts = next(_halves(solid, cell, [(axis, place)]))
        if parts is not None:
            return parts
    return None


def _places(cell: _Cell, axis: int, count: int) -> list[float]:
    """Return candidate cuts across an axis: evenly spaced, and along the largest steps of the surface across it."""
    low, high = cell.points[:, axis].min(), cell.points[:, axis].max()
    even = np.linspace(low, high, count + 2)[1:-1]
    corners = cell.triangles
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    flat = np.ptp(corners[:, :, axis], axis=1) < _STEP
    at = corners[flat, 0, axis]
    _, first, which = np.unique(np.round(at / _STEP), return_index=True, return_inverse=True)
    largest = np.argsort(-np.bincount(which, weights=area[flat], minlength=len(first)))[:count]
    chosen = np.concatenate([even, at[first[largest]]])
    inner = chosen[(chosen > low + 2.0 * _STEP) & (chosen < high - 2.0 * _STEP)]
    return [float(place) for place in inner]


def _halves(solid: MeshSolid, cell: _Cell, cuts: Sequence[tuple[int, float]]) -> Iterator[tuple[_Cell, _Cell] | None]:
    """Yield the parts of a cell on both sides of each plane, given by axis and place; None where one side is empty."""
    boxes = np.tile(cell.box, (len(cuts), 2, 1, 1))  # (cuts, sides, 2, 3)
    for k, (axis, place) in enumerate(cuts):
        boxes[k, 0, 1, axis] = boxes[k, 1, 0, axis] = place
    inner = _inner_corners(solid, boxes.reshape(-1, 2, 3))
    for k, (axis, place) in enumerate(cuts):
        one, other = (
            _cell(_clipped(cell.triangles, axis, place, 1.0 - 2.0 * side), boxes[k, side], inner[2 * k + side])
            for side in (0, 1)
        )
        yield None if one is None or other is None else (one, other)


def _inner_corners(solid: MeshSolid, boxes: Array) -> list[Array]:
    corners = boxes[:, BOX_CORNERS, np.arange(3)]  # (b, 8, 3)
    inside = solid.inside(corners.reshape(-1, 3)).reshape(len(boxes), len(BOX_CORNERS))
    return [own[flags] for own, flags in zip(corners, inside, strict=True)]


def _cell(triangles: Array, box: Array, inner: Array) -> _Cell | None:
    """Return the cell of a box whose corners `inner` (k, 3) are inside the mesh; None for an empty one."""
    points = np.vstack([triangles.reshape(-1, 3), inner])
    if len(points) < 3:
        return None
    if len(points) == 3:  # qhull wants a fourth
        points = np.vstack([points, points.mean(axis=0)])
    hull = _hull(points)
    flat = len(hull.vertices) < 4 or hull.volume <= 0.0
    return _Cell(triangles, box, points if flat else points[hull.vertices], float(hull.volume))


def _clipped(triangles: Array, axis: int, place: float, sign: float) -> Array:
    """Return the parts of triangles (k, 3, 3) with sign * x <= sign * place along an axis, as triangles.

    A triangle within the plane belongs to the side opposite to its normal.
    """
    height = sign * (triangles[:, :, axis] - place)
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])[:, axis]
    within = (np.abs(height) <= _PLANE_TOLERANCE).all(axis=1) & (sign * normal >= 0.0)
    own = (height < -_PLANE_TOLERANCE).any(axis=1) | within
    triangles, height = triangles[own], height[own]
    above = height > _PLANE_TOLERANCE
    count = above.sum(axis=1)
    kept = [triangles[count == 0]]
    for many in (1, 2):  # corners above the plane: the odd one out comes first
        rows = np.flatnonzero(count == many)
        odd = np.argmax(above[rows] if many == 1 else ~above[rows], axis=1)
        order = (odd[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(triangles[rows], order[:, :, None], axis=1), 1, 0)
        ha, hb, hc = np.take_along_axis(height[rows], order, axis=1).T
        ab = a + (ha / (ha - hb))[:, None] * (b - a)
        ac = a + (ha / (ha - hc))[:, None] * (c - a)
        ab[:, axis] = ac[:, axis] = place
        if many == 2:
            kept.append(np.stack([a, ab, ac], axis=1))
        else:
            kept += [np.stack([ab, b, c], axis=1), np.stack([ab, c, ac], axis=1)]
    return np.concatenate(kept)


def _join(solid: MeshSolid, pieces: list[tuple[Array, float]], options: PieceOptions) -> list[Array]:
    """Join pieces (vertices, volume) two by two where their common hull is within the bound, the best fit first."""
    known, count = dict(enumerate(pieces)), len(pieces)
    common: dict[tuple[int, int], tuple[float, Array, float]] = {}  # added volume, vertices, volume
    fresh = set(combinations(sorted(known), 2))
    while True:
        for a, b in fresh:
            if _touch(known[a][0], known[b][0]):
                points = np.vstack([known[a][0], known[b][0]])
                hull = _hull(points)
                volume = float(hull.volume)
                common[a, b] = volume - known[a][1] - known[b][1], points[hull.vertices], volume
        if not common:
            return [points for points, _ in known.values()]
        pair = min(common, key=lambda pair: (common[pair][0], pair))
        _, points, volume = common.pop(pair)
        fresh = set()
        if _close(solid, points, options):
            common = {other: value for other, value in common.items() if not set(other) & set(pair)}
            for index in pair:
                del known[index]
            fresh = {(index, count) for index in known}
            known[count], count = (points, volume), count + 1


def _touch(a: Array, b: Array) -> bool:
    gap = np.maximum(a.min(axis=0) - b.max(axis=0), b.min(axis=0) - a.max(axis=0))
    return bool((gap <= 1e-6).all())


def _hull(points: Array) -> ConvexHull:
    """Return the convex hull of points (k, 3); points in one plane are perturbed by rounding errors."""
    try:
        return ConvexHull(points)
    except QhullError:
        return ConvexHull(points, qhull_options="QJ Pp")
