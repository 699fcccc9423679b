"""Convex covers of meshes: the hull, or several pieces that together contain the mesh, with measured excess."""

import io
import json
import logging
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, NamedTuple

import coal
import numpy as np
import numpy.typing as npt

from optiplan import cache
from optiplan.arrays import Array
from optiplan.geometry.convex_hulls import FLAT, Hull, kept_hull, solid_hull, thickened_hull
from optiplan.geometry.meshes.mesh_parts import parts_of_mesh
from optiplan.geometry.meshes.triangles import Soup, Triangles
from optiplan.geometry.over_cover import MeshSolid
from optiplan.records import dataclass

COVER_VERSION = 1
"""Increase it when covers change for the same mesh, so that cached ones are made again."""

WITHIN = 1e-3
"""m; the default cover of a mesh reaches at most this far beyond it, else the mesh itself is taken."""

log = logging.getLogger(__name__)

_hulls: cache.MostRecent[coal.ConvexBase] = cache.MostRecent(256)
"""Hulls of meshes by content."""


@dataclass(frozen=True)
class CoacdOptions:
    """Options of the decomposition; the first seven go to CoACD, which scales every mesh to [-1, 1].

    `longest_edge` (m): triangles across a cut are divided to this size before each is assigned to a piece. The hull is
    taken instead if the pieces fill more than the share `enough` of its volume.
    """

    threshold: float = 0.08
    preprocess_resolution: int = 15
    resolution: int = 400
    mcts_iterations: int = 20
    mcts_nodes: int = 5
    mcts_max_depth: int = 1
    max_convex_hull: int = 16
    longest_edge: float = 0.003
    enough: float = 0.88


class CoacdPieces(NamedTuple):
    """Convex pieces by their vertices, each (k, 3) in m; `growth` (m): how far they were grown to contain the mesh."""

    vertices: tuple[Array, ...]
    growth: float


def mesh_vertices(mesh: coal.BVHModelBase) -> Array:
    """Return the vertices of a mesh, (k, 3), m."""
    return np.array(mesh.vertices(), dtype=np.float64).reshape(-1, 3)


def mesh_triangles(mesh: coal.BVHModelBase) -> Triangles:
    """Return the triangles of a mesh, (m, 3) indices of vertices."""
    corners = (mesh.tri_indices(i) for i in range(mesh.num_tris))
    return np.array([(t[0], t[1], t[2]) for t in corners], dtype=np.int64).reshape(-1, 3)


def soup_of(mesh: coal.BVHModelBase) -> Soup:
    """Return the vertices, m, and the triangles of a mesh."""
    return Soup(mesh_vertices(mesh), mesh_triangles(mesh))


def hull_of_mesh(mesh: coal.BVHModelBase) -> coal.ConvexBase:
    """Return the hull of a mesh, made once for each content; a flat mesh is thickened.

    The hulls' distance bounds that of the meshes from below and costs a twentieth of it.
    """
    vertices = mesh_vertices(mesh)
    return _hulls.get(cache.digest([vertices.tobytes()]), lambda: solid_hull(vertices).build())


def is_flat(shape: coal.CollisionGeometry) -> bool:
    """Return whether this is a mesh within a millionth of its extent of a plane."""
    if not isinstance(shape, coal.BVHModelBase):
        return False
    spread = np.linalg.eigvalsh(np.cov(mesh_vertices(shape).T))
    return bool(spread[0] <= 1e-12 * spread[-1])


def hull_of(points: Array) -> coal.ConvexBase:
    """Return the convex hull of points (k, 3), m, as geometry of coal; see `body_of`."""
    return body_of(points).build()


def body_of(points: Array) -> Hull:
    """Return the convex hull of points (k, 3), m; points in one plane or on one line are first thickened by `FLAT`.

    Raises:
        ValueError: no points, or points that are not finite.
    """
    if len(points) == 0 or not np.isfinite(points).all():
        raise ValueError("a mesh without finite vertices")
    return thickened_hull(points) if _in_a_plane(points) else kept_hull(points)


def _in_a_plane(points: Array) -> bool:
    return len(points) < 4 or bool(np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[-1] <= FLAT)


class Cover(NamedTuple):
    """Default cover of a mesh: its hull, convex pieces, or the mesh itself.

    Attributes:
        kind: hull, convex_pieces or mesh.
        pieces: vertices (k, 3) of each convex body, m; none for the mesh itself.
        over_cover: m, how far they reach beyond the mesh at most.
        hull: m, how far the hull reaches beyond the mesh at most.
    """

    kind: str
    pieces: tuple[Array, ...]
    over_cover: float
    hull: float


def cover_of(mesh: Soup) -> Cover:
    """Return the hull of a mesh if it is within `WITHIN` of it, else such pieces, else the mesh; cached on disk."""
    vertices, triangles = mesh.vertices, mesh.triangles

    def make() -> bytes:
        made = _cover(vertices, triangles)
        pieces = made.pieces if made.kind == "convex_pieces" else ()
        return _pack(pieces, figures=[made.over_cover, made.hull], kind=made.kind)

    with np.load(io.BytesIO(cache.kept(cover_name(vertices, triangles), make))) as data:
        kind, (beyond, hull) = str(data["kind"]), data["figures"].tolist()
        known: dict[str, tuple[Array, ...]] = {"hull": (vertices,), "mesh": ()}
        return Cover(kind, known[kind] if kind in known else _pieces(data), beyond, hull)


def cover_name(vertices: Array, triangles: Triangles) -> str:
    """Return the cache name of the cover of a mesh: vertices (k, 3) in m, triangles (m, 3)."""
    key = cache.digest([vertices.tobytes(), triangles.tobytes(), repr((COVER_VERSION, WITHIN)).encode()])
    return f"covers/{key}.npz"


def over_cover_of(mesh: Soup, bodies: Sequence[Array]) -> float:
    """Return how far (m) the hulls of points, (k, 3) each, reach beyond a mesh at most; cached on disk."""
    vertices, triangles = mesh.vertices, mesh.triangles
    key = cache.digest(
        [vertices.tobytes(), triangles.tobytes(), *(body.tobytes() for body in bodies), repr(COVER_VERSION).encode()]
    )

    def make() -> bytes:
        from optiplan.geometry.convex_pieces import measured

        return json.dumps(measured(MeshSolid(vertices[triangles]), bodies)).encode()

    return float(json.loads(cache.kept(f"covers/{key}.json", make)))


def _cover(vertices: Array, triangles: Triangles) -> Cover:
    from scipy.spatial import QhullError

    from optiplan.geometry.convex_pieces import PieceOptions, cut, measured

    solid = MeshSolid(vertices[triangles])
    hull = body_of(vertices)
    beyond = measured(solid, [hull.vertices]) if len(hull.vertices) else 0.0
    if beyond <= WITHIN:
        return Cover("hull", (vertices,), beyond, beyond)
    log.info("cutting a mesh of %d triangles into convex pieces, once", len(triangles))
    try:
        pieces = cut(solid, PieceOptions(over_cover=WITHIN))
    except QhullError:  # triangles too small for its rounding
        pieces = None
    if pieces is None or pieces.over_cover > WITHIN:
        return Cover("mesh", (), 0.0, beyond)
    return Cover("convex_pieces", pieces.vertices, pieces.over_cover, beyond)


def pieces_of(mesh: Soup, options: CoacdOptions = CoacdOptions()) -> CoacdPieces:
    """Return convex pieces that together contain every triangle of a mesh; cached on disk.

    CoACD's pieces cut corners of the mesh. So each triangle is assigned to the piece that contains it best; one that
    spans several pieces is divided first. Every piece becomes the hull of itself and its triangles, so the union
    contains the mesh. A mesh in a plane has the hulls of `parts_of_mesh`, which are thickened.

    Args:
        mesh: triangles, in m.
        options: how finely it is cut.
    """
    made_with = repr((COVER_VERSION, asdict(options))).encode()
    key = cache.digest([mesh.vertices.tobytes(), mesh.triangles.tobytes(), made_with])

    def make() -> bytes:
        log.info("cutting a mesh of %d triangles into convex pieces, once", len(mesh.triangles))
        made = _cut(mesh.vertices, mesh.triangles, options)
        return _pack(made.vertices, growth=made.growth)

    with np.load(io.BytesIO(cache.kept(f"pieces/{key}.npz", make))) as data:
        return CoacdPieces(_pieces(data), float(data["growth"]))


def protrusion(faces: Array, points: Array) -> Array:
    """Return how far points are outside a convex body, (k,), m: max over its faces of n . p + d; negative inside.

    Args:
        faces: (f, 4) outward unit normals n and offsets d.
        points: (k, 3), in m.
    """
    return np.asarray((points @ faces[:, :3].T + faces[:, 3]).max(axis=1))


def faces_of(points: Array) -> Array:
    """Faces of the convex hull of points (k, 3): (f, 4) outward unit normals and offsets, n . p + d <= 0 inside."""
    from scipy.spatial import ConvexHull

    return np.asarray(ConvexHull(points).equations)


def _cut(vertices: Array, triangles: Triangles, options: CoacdOptions) -> CoacdPieces:
    import coacd
    from trimesh.remesh import subdivide_to_size

    if _in_a_plane(vertices):  # without a volume that could be cut
        parts = parts_of_mesh(Soup(vertices, triangles))
        return CoacdPieces(tuple(part.vertices for part in parts), max(part.over_cover for part in parts))
    settings = asdict(options)
    longest, enough = settings.pop("longest_edge"), settings.pop("enough")
    coacd.set_log_level("error")
    rough = [np.asarray(piece[0]) for piece in coacd.run_coacd(coacd.Mesh(vertices, triangles), seed=0, **settings)]
    bodies = [faces_of(piece) for piece in rough]
    if _filling(bodies, vertices) > enough:
        return CoacdPieces((_corners(vertices),), 0.0)
    inside, _ = _best(bodies, vertices, triangles)
    spanning = triangles[inside > 1e-9]
    fine_vertices, fine = (
        subdivide_to_size(vertices, spanning, longest, max_iter=20) if len(spanning) else (vertices, spanning)
    )
    worst, owner = _best(bodies, fine_vertices, fine)
    grown = []
    for index, piece in enumerate(rough):
        added = fine_vertices[np.unique(fine[owner == index])]
        grown.append(_corners(np.vstack([piece, added])))
    return CoacdPieces(tuple(grown), float(worst.max(initial=0.0)))


def _filling(bodies: list[Array], vertices: Array) -> float:
    """Return the volume of the union of convex bodies as a share of that of the vertices' hull, from samples."""
    samples = np.random.default_rng(0).uniform(vertices.min(axis=0), vertices.max(axis=0), (20_000, 3))
    samples = samples[protrusion(faces_of(vertices), samples) <= 0]
    return float(np.any([protrusion(faces, samples) <= 0 for faces in bodies], axis=0).mean())


def _best(bodies: list[Array], vertices: Array, triangles: Triangles) -> tuple[Array, npt.NDArray[np.int64]]:
    """Return how far each triangle protrudes from the body that contains it best, m, and the index of that body."""
    best = np.full(len(triangles), np.inf)
    owner = np.zeros(len(triangles), dtype=np.int64)
    for index, faces in enumerate(bodies):
        out = np.concatenate(
            [protrusion(faces, chunk) for chunk in np.array_split(vertices, len(vertices) // 20_000 + 1)]
        )
        worst = out[triangles].max(axis=1) if len(triangles) else best
        owner[worst < best] = index
        best = np.minimum(best, worst)
    return best, owner


def _corners(points: Array) -> Array:
    from scipy.spatial import ConvexHull

    return np.asarray(points[ConvexHull(points).vertices], dtype=np.float64)


def _pack(pieces: Sequence[Array], **figures: npt.ArrayLike) -> bytes:
    buffer = io.BytesIO()
    sizes = np.array([len(piece) for piece in pieces], dtype=np.int64)
    points = np.concatenate([np.empty((0, 3)), *pieces])
    np.savez_compressed(buffer, allow_pickle=False, points=points, sizes=sizes, **figures)
    return buffer.getvalue()


def _pieces(data: Mapping[str, Any]) -> tuple[Array, ...]:
    return tuple(np.split(data["points"], np.cumsum(data["sizes"])[:-1]))
