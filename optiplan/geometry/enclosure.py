"""Points enclosed by a triangle mesh, whatever the winding of its triangles.

The surface is divided into pieces connected by edges. There are three kinds of pieces:

* closed and wound alike: every edge is passed as often in one direction as in the other. The winding number w counts:
  +1 for a solid, -1 for an inverted solid or the wall of a hollow;
* closed and not wound alike: triangles of both senses, or every triangle twice, once in each sense. Its winding number
  counts after its triangles are wound alike;
* open, or with edges of three triangles. Together, these pieces enclose every point without a way out on a grid of
  `CELLS` cells: a bin is open, a solid with cracks is closed.

A body is enclosed if the sum of w over the pieces of the first kind is not 0, or if a piece of another kind encloses
it. A sum of 0 of +1 and -1 is a hollow only if one piece lies within the other: overlapping solids enclose.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from optiplan.arrays import Array
from optiplan.geometry.meshes.triangles import Triangles
from optiplan.records import dataclass

CELLS = 64
"""Cells of the grid along the longest edge of a mesh; openings narrower than four cells count as closed."""

NESTED = 500
"""Vertices of a hollow that are tested for being within the solid around it."""

_BLOCK = 2_000_000
"""Samples of triangles at a time, to bound memory."""


@dataclass(frozen=True, eq=False)
class _Piece:
    """A connected part of a surface: corners (m, 3, 3); `sense`: whether its winding was meaningful in the mesh."""

    corners: Array
    sense: bool

    def within(self, other: "_Piece") -> bool:
        """Return whether this closed piece lies inside another: by boxes, then by winding numbers of its vertices."""
        mine, theirs = self.corners.reshape(-1, 3), other.corners.reshape(-1, 3)
        if not ((mine.min(axis=0) >= theirs.min(axis=0)) & (mine.max(axis=0) <= theirs.max(axis=0))).all():
            return False
        chosen = np.unique(mine, axis=0)
        chosen = chosen[:: len(chosen) // NESTED + 1]
        return all(abs(winding_number(other.corners, vertex)) > 0.5 for vertex in chosen)


class Enclosure:
    """Test whether points are enclosed by a mesh.

    Args:
        vertices: (k, 3), m.
        triangles: (m, 3) indices of vertices.
    """

    def __init__(self, vertices: Array, triangles: Triangles) -> None:
        distinct, corners = _merged(vertices, triangles)
        faces, senses = _distinct_faces(_with_area(corners))
        self._closed: list[_Piece] = []
        open_: list[Array] = []
        self._torn = False  # an open piece that is no two-sided sheet, such as that between two adjacent boxes
        for chosen, sense in ((faces[senses != 0], True), (faces[senses == 0], False)):
            for piece, even in _connected(chosen):
                wound = piece if even else _wound(piece)
                if wound is None:
                    open_.append(distinct[piece])
                    self._torn |= sense
                else:
                    self._closed.append(_Piece(distinct[wound], sense and even))
        self._open = np.concatenate([np.empty((0, 3, 3)), *open_])
        flat = [piece.corners.reshape(-1, 3) for piece in self._closed]
        self._low = np.array([points.min(axis=0) for points in flat]).reshape(-1, 3)
        self._high = np.array([points.max(axis=0) for points in flat]).reshape(-1, 3)

    def holds(self, points: Array) -> bool:
        """Return whether a connected body that does not touch the surface is enclosed; points (k, 3) of the body, m."""
        near = ((points[0] >= self._low) & (points[0] <= self._high)).all(axis=1)
        pieces = [self._closed[k] for k in np.flatnonzero(near)]
        around = [(piece, round(winding_number(piece.corners, points[0]))) for piece in pieces]
        around = [(piece, winding) for piece, winding in around if winding]
        if any(not piece.sense for piece, _ in around) or sum(winding for _, winding in around) != 0:
            return True
        ordered = sorted((piece for piece, _ in around), key=lambda piece: float(np.ptp(piece.corners, (0, 1)).max()))
        if not all(inner.within(outer) for inner, outer in pairwise(ordered)):
            return True
        return not _way_out(self._open, points)

    def solids(self) -> list[tuple[Array, float]] | None:
        """Return the corners (m, 3, 3) of each closed piece, and the sign, 1 or -1, of its volume.

        With that sign, a solid has a positive volume and the wall of a hollow a negative one; that of a two-sided sheet
        is 0. A piece is such a wall if the winding number is 0 within it and not around it. None if any other piece is
        open.
        """
        if self._torn:
            return None
        volumes = [float(np.linalg.det(piece.corners - piece.corners[0, 0]).sum()) for piece in self._closed]
        windings = [float(np.sign(volumes[k])) if piece.sense else 0.0 for k, piece in enumerate(self._closed)]
        found: list[tuple[Array, float]] = []
        for k, (piece, volume) in enumerate(zip(self._closed, volumes, strict=True)):
            around = sum(windings[j] for j in self._around(k)) if -windings[k] in windings else 0.0
            hollow = around != 0.0 and around + windings[k] == 0.0
            found.append((piece.corners, 1.0 if hollow == (volume < 0.0) else -1.0))
        return found

    def _around(self, k: int) -> list[int]:
        """Return the closed pieces that piece k lies within."""
        boxes = ((self._low[k] >= self._low) & (self._high[k] <= self._high)).all(axis=1)
        return [j for j in np.flatnonzero(boxes).tolist() if j != k and self._closed[k].within(self._closed[j])]


def evenly_wound(vertices: Array, triangles: Triangles) -> bool:
    """Return whether triangles pass every edge as often in one direction as in the other: then nothing gets in."""
    return not _Edges.of(_with_area(_merged(vertices, triangles)[1])).uneven().any()


def winding_number(triangles: Array, point: Array) -> float:
    """Return the winding number of triangles (k, 3, 3) about a point (3,): 0 outside a closed surface, 1 or -1 inside.

    Sum of solid angles over 4 pi, with tan(angle / 2) = a . (b x c) / (abc + (a . b) c + (b . c) a + (c . a) b).
    Source: van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30 (1983).
    """
    a, b, c = np.moveaxis(triangles - point, 1, 0)
    x, y, z = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = np.einsum("ki,ki->k", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ki,ki->k", u, v) for u, v in ((a, b), (b, c), (c, a)))
    angle = 2.0 * np.arctan2(volume, x * y * z + ab * z + bc * x + ca * y)
    return float(angle.sum() / (4.0 * np.pi))


def connected_parts(vertices: Array, triangles: Triangles) -> list[Array]:
    """Return the vertices (k, 3) of every part of a mesh that is connected by vertices."""
    distinct, corners = _merged(vertices, triangles)
    part = _components(len(distinct), corners[:, [0, 1]].ravel(), corners[:, [1, 2]].ravel())
    used = np.unique(corners)
    order = used[np.argsort(part[used], kind="stable")]
    return np.split(distinct[order], np.flatnonzero(np.diff(part[order])) + 1)


def _merged(vertices: Array, triangles: Triangles) -> tuple[Array, Triangles]:
    """Merge vertices (k, 3) at the same place: return those that are left, and triangles (m, 3) of them."""
    distinct, same = np.unique(vertices + 0.0, axis=0, return_inverse=True)  # -0.0 is the same place as 0.0
    return distinct, same.reshape(-1)[triangles]


def _with_area(corners: Triangles) -> Triangles:
    """Triangles (m, 3) whose corners are three."""
    a, b, c = corners.T
    chosen: Triangles = corners[(a != b) & (b != c) & (c != a)]
    return chosen


def _components(count: int, first: npt.NDArray[np.int64], second: npt.NDArray[np.int64]) -> npt.NDArray[np.int32]:
    """Return the component (count,) of each node of the graph whose edges join `first` (m,) and `second` (m,)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(first)), (first, second)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int32)


def _distinct_faces(corners: Triangles) -> tuple[Triangles, npt.NDArray[np.int64]]:
    """Return every triangle once, and its sense: the sign of the sum of the windings at its place."""
    least = corners.argmin(axis=1)[:, None]
    turned = np.take_along_axis(corners, (least + np.arange(3)) % 3, axis=1)
    back = turned[:, 1] > turned[:, 2]
    faces, which = np.unique(np.sort(corners, axis=1), axis=0, return_inverse=True)
    senses = np.bincount(which.reshape(-1), np.where(back, -1, 1), len(faces)).astype(np.int64)
    faces[senses < 0] = faces[senses < 0][:, [0, 2, 1]]
    return faces, np.sign(senses)


@dataclass(frozen=True, eq=False)
class _Edges:
    """The sides of faces, ordered by edge: the face, the direction (1 or -1), the number of the edge."""

    face: npt.NDArray[np.int64]
    direction: npt.NDArray[np.int64]
    edge: npt.NDArray[np.int64]

    @classmethod
    def of(cls, faces: Triangles) -> "_Edges":
        """Return the sides of faces (m, 3)."""
        sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        _, edge = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
        order = np.argsort(edge.reshape(-1), kind="stable")
        direction = np.where(sides[:, 0] < sides[:, 1], 1, -1)
        return cls(np.tile(np.arange(len(faces)), 3)[order], direction[order], edge.reshape(-1)[order])

    def neighbours(self) -> npt.NDArray[np.bool_]:
        """Return which sides have the same edge as the next side."""
        return np.asarray(self.edge[1:] == self.edge[:-1])

    def uneven(self) -> npt.NDArray[np.bool_]:
        """Return which sides have an edge that is passed more often in one direction than in the other."""
        return np.asarray(np.bincount(self.edge, self.direction)[self.edge] != 0)


def _connected(faces: Triangles) -> Iterator[tuple[Triangles, bool]]:
    """Yield faces connected by edges, and whether each edge is passed as often in one direction as in the other."""
    if len(faces) == 0:
        return
    edges = _Edges.of(faces)
    near = edges.neighbours()
    part = _components(len(faces), edges.face[:-1][near], edges.face[1:][near])
    even = np.ones(int(part.max()) + 1, bool)
    even[part[edges.face[edges.uneven()]]] = False
    order = np.argsort(part, kind="stable")
    pieces = np.split(faces[order], np.flatnonzero(np.diff(part[order])) + 1)
    yield from zip(pieces, even.tolist(), strict=True)


def _wound(faces: Triangles) -> Triangles | None:
    """Return the faces of a closed piece, wound alike; None for an open piece."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order

    edges = _Edges.of(faces)
    if (np.bincount(edges.edge) != 2).any():
        return None
    first, second = edges.face[0::2], edges.face[1::2]
    against = edges.direction[0::2] == edges.direction[1::2]
    shape = (len(faces),) * 2
    graph = coo_array((np.ones(len(first)), (first, second)), shape=shape)
    order, above = breadth_first_order(graph, 0, directed=False)
    differ = {(int(f), int(g)): bool(x) for f, g, x in zip(first, second, against, strict=True)}
    flipped = np.zeros(len(faces), bool)
    for face in order[1:].tolist():
        parent = int(above[face])
        flipped[face] = flipped[parent] ^ differ.get((face, parent), differ.get((parent, face), False))
    wound = np.where(flipped[:, None], faces[:, [0, 2, 1]], faces)
    return None if _Edges.of(wound).uneven().any() else wound


def _way_out(corners: Array, points: Array) -> bool:
    """Return whether a grid connects one of points (k, 3) with the outside of triangles (m, 3, 3)."""
    flat = corners.reshape(-1, 3)
    if len(flat) == 0 or not ((points >= flat.min(axis=0)) & (points <= flat.max(axis=0))).all(axis=1).all():
        return True
    from scipy import ndimage

    cell = float(np.ptp(flat, axis=0).max()) / CELLS
    origin = flat.min(axis=0) - 3.0 * cell
    full = np.zeros(tuple(np.ceil(np.ptp(flat, axis=0) / cell).astype(int) + 7), bool)
    for samples in _sampled(corners, cell):
        full[tuple(((samples - origin) / cell).astype(int).T)] = True
    # No point of a triangle is farther than a cell from a sample, so cells that no sample is in or next to are free.
    full = ndimage.binary_dilation(full, np.ones((3, 3, 3)))
    regions, _ = ndimage.label(~full)
    outside = regions == regions[0, 0, 0]
    for point in points:
        at = ((point - origin) / cell).astype(int)
        if outside[tuple(at)]:
            return True
        low = np.maximum(at - 4, 0)
        near = np.argwhere(outside[tuple(slice(a, b) for a, b in zip(low, at + 5, strict=True))]) + low
        if len(near) and _sees(corners, point, origin + (near + 0.5) * cell):
            return True
    return False


def _sampled(corners: Array, cell: float) -> Iterator[Array]:
    """Yield samples of triangles, (k, 3): every point of a triangle is within a cell of a sample."""
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    pieces = np.maximum(np.ceil(longest / cell), 1).astype(int)
    for count in np.unique(pieces):
        i, j = np.array([(i, j) for i in range(count + 1) for j in range(count + 1 - i)]).T / count
        weights = np.stack([1.0 - i - j, i, j], axis=1)
        for block in np.array_split(corners[pieces == count], len(corners) * len(weights) // _BLOCK + 1):
            yield np.einsum("wc,mcx->mwx", weights, block).reshape(-1, 3)


def _sees(corners: Array, point: Array, ends: Array) -> bool:
    """Return whether a straight line from a point to one of ends (k, 3) crosses no triangle (m, 3, 3)."""
    chosen = ends[np.argsort(np.linalg.norm(ends - point, axis=1))[:32]]
    return any(not _crosses(corners, point, end - point) for end in chosen)


def _crosses(corners: Array, start: Array, along: Array) -> bool:
    """Return whether start + s along, 0 <= s <= 1, meets a triangle: Möller, Trumbore, J. Graphics Tools 2 (1997)."""
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(along, v)
    size = np.einsum("mi,mi->m", u, normal)
    flat = np.abs(size) < 1e-300
    scale = 1.0 / np.where(flat, 1.0, size)
    offset = start - corners[:, 0]
    a = scale * np.einsum("mi,mi->m", offset, normal)
    turned = np.cross(offset, u)
    b, s = scale * (turned @ along), scale * np.einsum("mi,mi->m", v, turned)
    slack = 1e-9
    met = (a >= -slack) & (b >= -slack) & (a + b <= 1.0 + slack) & (s >= -slack) & (s <= 1.0 + slack)
    return bool((met & ~flat).any())
