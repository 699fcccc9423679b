"""From the shapes of a scene to coal geometry."""

from functools import lru_cache
from pathlib import Path

import coal
import numpy as np

from optiplan.model.hull import convex_hull
from optiplan.model.scene import Box, Capsule, Cylinder, HalfSpace, Mesh, Shape, Sphere

__all__ = ["FARTHEST", "build_geometry", "convex_hull"]

FARTHEST = 1e6
"""Largest coordinate of a mesh, m: beyond it distances lose the micrometres that they are trusted to."""


def build_geometry(shape: Shape) -> coal.CollisionGeometry:
    """Coal geometry of a shape, in the shape's own frame, m.

    Meshes become a bounding-volume hierarchy of their triangles or, with `convex`, their convex hull.

    Raises:
        ValueError: a mesh file that cannot be read, holds NaN or infinity, or has no volume to hull.
    """
    match shape:
        case Box(size):
            geometry = coal.Box(*size)
        case Sphere(radius):
            geometry = coal.Sphere(radius)
        case Cylinder(radius, length):
            geometry = coal.Cylinder(radius, length)
        case Capsule(radius, length):
            geometry = coal.Capsule(radius, length)
        case HalfSpace(normal, offset):
            geometry = coal.Halfspace(np.asarray(normal, float), float(offset))
        case Mesh():
            return _load_mesh(shape)
    geometry.computeLocalAABB()
    return geometry


@lru_cache(maxsize=256)
def _load_mesh(shape: Mesh) -> coal.CollisionGeometry:
    """Read once per file, scale and kind; coal geometry is never changed after loading, so it is shared."""
    try:
        mesh = coal.MeshLoader(coal.BV_OBBRSS).load(str(shape.file), np.asarray(shape.scale, float))
    except Exception as error:  # assimp raises whatever it likes
        raise ValueError(f"cannot read mesh {shape.file}: {_reason(str(error), shape.file)}") from error
    vertices = np.asarray(mesh.vertices())
    if not (len(vertices) and (np.abs(vertices) <= FARTHEST).all()):  # written so that NaN is refused too
        raise ValueError(f"mesh {shape.file} has no vertices, or one that is no number or beyond {FARTHEST:g} m")
    geometry = convex_hull(vertices) if shape.convex else mesh
    geometry.computeLocalAABB()
    return geometry


def _reason(message: str, file: Path) -> str:
    """What is wrong with the file in one line, without the lines of coal about its own sources."""
    ours = ("From file:", "in function:", "at line:", "Hint:", "message: Could not load resource")
    lines = [line.strip() for line in message.splitlines()]
    told = " ".join(line.removeprefix("message: ") for line in lines if line and not line.startswith(ours))
    return told.replace(str(file), file.name) or "no reason given"
