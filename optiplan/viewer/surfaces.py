"""Drawable surfaces of geometries: a primitive by its dimensions, anything else as triangles."""

import base64
import logging
from pathlib import Path
from typing import Any

import coal
import numpy as np
import numpy.typing as npt
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.convex import mesh_triangles, mesh_vertices
from optiplan.geometry.convex_hulls import plain_hull
from optiplan.geometry.meshes.box_surfaces import box_corners
from optiplan.geometry.meshes.scene_graph import MeshPart, joined
from optiplan.geometry.shape import Shape
from optiplan.geometry.shapes import Box, Capsule, Cylinder, Sphere, shape_of_body
from optiplan.records import dataclass

Colour = tuple[float, float, float, float]
MAX_TRIANGLES = 20_000  # of one surface; more than that makes the page heavy and looks the same
_NARROW = 1 << 16  # vertices that two bytes can number
_STEPS = (1 << 16) - 1  # of a coordinate, along the longest side of the surface: 15 µm for 1 m
ROUND = 24
"""Corners of a circle."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles of one colour: vertices (k, 3) in m, faces (m, 3) indices into them; colour None when none is given."""

    vertices: Array
    faces: npt.NDArray[np.int64]
    colour: Colour | None = None

    def encoded(self) -> dict[str, Any]:
        """JSON-ready: base64 of little-endian whole numbers.

        A vertex v (m) is low + step · k with k (3,) in `vertices`, uint16; `faces` are uint16, or uint32 where `wide`.
        """
        wide = len(self.vertices) > _NARROW
        low = self.vertices.min(axis=0) if len(self.vertices) else np.zeros(3)
        step = max(float((self.vertices - low).max(initial=0.0)), 1e-9) / _STEPS
        return {
            "kind": "mesh",
            "low": low.tolist(),
            "step": step,
            "vertices": base64_of(np.round((self.vertices - low) / step), "<u2"),
            "faces": base64_of(self.faces, "<u4" if wide else "<u2"),
            "wide": wide,
        }


def base64_of(array: npt.NDArray[Any], dtype: str = "<f4") -> str:
    """Base64 of an array's numbers in C order, little-endian."""
    return base64.b64encode(np.ascontiguousarray(array, dtype=dtype).tobytes()).decode("ascii")


def encode(geometry: coal.CollisionGeometry) -> dict[str, Any]:
    """JSON-ready form of a coal geometry in its own frame, lengths in m.

    Shapes that the page cannot draw exactly are drawn as their bounding box.
    """
    shape = shape_of_body(geometry)
    picture = None if shape is None else shape.picture()
    if isinstance(picture, dict):
        return picture
    if picture is not None or isinstance(geometry, coal.ConvexBase | coal.BVHModelBase):
        return body_triangles(geometry).encoded()
    geometry.computeLocalAABB()
    box = geometry.aabb_local
    centre, size = 0.5 * (box.min_ + box.max_), box.max_ - box.min_
    return {"kind": "box", "size": size.tolist(), "centre": centre.tolist()}


def body_triangles(body: coal.CollisionGeometry) -> Surface:
    """Triangles of a body of coal in its own frame, m; bodies of a kind that is not known by their bounding box."""
    shape = shape_of_body(body)
    points = None if shape is None else _corners(shape)
    if points is not None:
        return hull_surface(points)
    match body:
        case coal.ConvexBase():
            return hull_surface(np.asarray(body.points(), dtype=float))
        case coal.BVHModelBase():
            return bounded(bvh_surface(body))
    body.computeLocalAABB()
    box = body.aabb_local
    return hull_surface(box_corners(0.5 * (box.max_ - box.min_)) + 0.5 * (box.min_ + box.max_))


def visual_surfaces(thing: pin.GeometryObject) -> list[Surface]:
    """Triangles of a visual mesh, one surface a material, in the frame of the object; scaled, at most MAX_TRIANGLES."""
    if Path(thing.meshPath).suffix.lower() == ".obj":  # of what pinocchio loads, the one format with material files
        try:
            return [bounded(surface) for surface in _read_obj(thing)]
        except Exception as error:  # readers raise whatever they like; the triangles pinocchio read are good enough
            _log.warning("materials of %s not read: %s", thing.meshPath, error)
    return [bounded(bvh_surface(thing.geometry))]


def bvh_surface(model: coal.BVHModelBase) -> Surface:
    """All triangles of a bounding-volume hierarchy, as they are."""
    return Surface(mesh_vertices(model), mesh_triangles(model))


def bounded(surface: Surface) -> Surface:
    """The surface with equal vertices merged and, above MAX_TRIANGLES, vertices merged on ever coarser grids."""
    extent = float(np.ptp(surface.vertices, axis=0).max(initial=0.0))
    cells = 1 << 22
    merged = _merged(surface, extent / cells)
    while len(merged.faces) > MAX_TRIANGLES:
        cells = min(cells // 2, 512)
        merged = _merged(surface, extent / cells)
    return merged


def _merged(surface: Surface, cell: float) -> Surface:
    """One vertex (the mean) for all in one cell of a grid of width `cell` (m); collapsed and repeated faces go."""
    keys = np.round(surface.vertices / max(cell, 1e-12)).astype(np.int64)
    _, index = np.unique(keys, axis=0, return_inverse=True)
    index = index.reshape(-1)
    count = np.bincount(index)[:, None]
    sums = np.stack([np.bincount(index, weights=column) for column in surface.vertices.T], axis=1)
    faces = index[surface.faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    _, first = np.unique(faces, axis=0, return_index=True)
    return Surface(sums / count, faces[np.sort(first)], surface.colour)


def hull_surface(points: Array) -> Surface:
    """Triangles of the convex hull of points (k, 3), seen from outside counter-clockwise."""
    hull = plain_hull(points)
    return Surface(hull.vertices, hull.triangles.astype(np.int64))


def _read_obj(thing: pin.GeometryObject) -> list[Surface]:
    import trimesh

    scale = np.asarray(thing.meshScale, dtype=float)
    parts = trimesh.load_scene(thing.meshPath, process=False).geometry.values()
    by_colour: dict[Colour | None, list[MeshPart]] = {}
    for part in parts:
        material = getattr(part.visual, "material", None)
        rgba = None if material is None else tuple(float(c) / 255.0 for c in material.main_color)
        colour = None if rgba is None else (rgba[0], rgba[1], rgba[2], 1.0)
        by_colour.setdefault(colour, []).append((part.vertices * scale, np.asarray(part.faces, np.int64)))
    return [Surface(*joined(parts), colour) for colour, parts in by_colour.items()]


def _corners(shape: Shape) -> Array | None:
    """Points (k, 3), m, whose convex hull is the shape, or nearly; None where the shape has none of its own."""
    match shape:
        case Box():
            return box_corners(0.5 * np.array(shape.size))
        case Sphere():
            return shape.radius * _ball()
        case Cylinder():
            ends = np.array([[0.0, 0.0, -0.5 * shape.length], [0.0, 0.0, 0.5 * shape.length]])
            return np.concatenate([shape.radius * _circle() + end for end in ends])
        case Capsule():
            ball, half = shape.radius * _ball(), np.array([0.0, 0.0, 0.5 * shape.length])
            return np.concatenate([ball - half, ball + half])
    picture = shape.picture()
    return None if picture is None or isinstance(picture, dict) else picture


def _circle() -> Array:
    turn = np.linspace(0.0, 2.0 * np.pi, ROUND, endpoint=False)
    return np.column_stack([np.cos(turn), np.sin(turn), np.zeros(ROUND)])


def _ball() -> Array:
    rise = np.linspace(-0.5 * np.pi, 0.5 * np.pi, ROUND // 2 + 1)[1:-1]
    rings = [np.cos(angle) * _circle() + [0.0, 0.0, np.sin(angle)] for angle in rise]
    return np.concatenate([*rings, [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]])
