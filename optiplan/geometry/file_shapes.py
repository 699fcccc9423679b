"""Shapes that files hold: meshes, point clouds, octrees; their bodies are made of triangles and kept by content."""

from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

import coal
import numpy as np
from pydantic import Field

from optiplan.arrays import Array
from optiplan.config.document import Strict
from optiplan.config.values import LARGEST_COORDINATE, FileName, Length, Scale
from optiplan.geometry.convex_hulls import convex_hull
from optiplan.geometry.meshes.box_surfaces import surface_of_boxes
from optiplan.geometry.meshes.reading import (
    FORMATS,
    OCTREE_FORMATS,
    POINT_FORMATS,
    Kind,
    known,
    open_mesh,
    read_mesh,
)
from optiplan.geometry.meshes.triangles import MOST_TRIANGLES, Soup, Triangles
from optiplan.geometry.shape import Shape


@dataclass(frozen=True)
class BodyFile:
    """A file of a body: `key` is the digest of what it has to hold, by `open_mesh`; empty: whatever it holds."""

    path: Path
    key: str
    kind: Kind

    def soup(self) -> Soup:
        """What the file holds.

        Raises:
            ValueError: it cannot be read, or is not what it was.
        """
        soup = known(self.key) if self.key else None
        if soup is None:
            file = open_mesh(self.path, self.kind)
            if self.key not in ("", file.key):
                raise ValueError(f"{self.kind} {self.path} is not what it was when it was loaded")
            soup = read_mesh(file)
        return soup


def mesh_body(source: BodyFile, scale: tuple[float, float, float], convex: bool) -> coal.CollisionGeometry:
    """Bounding-volume hierarchy of the triangles of a file or, with `convex`, their convex hull.

    Args:
        source: the file.
        scale: of its numbers.
        convex: whether the hull is wanted.

    Raises:
        ValueError: it cannot be read, holds NaN or infinity, or has no volume to hull.
    """
    soup = source.soup()
    try:
        return _built(soup, scale, convex)
    except ValueError as error:
        raise ValueError(f"{source.kind} {source.path}: {error}") from error


def cloud_body(source: BodyFile, radius: float) -> coal.CollisionGeometry:
    """Bounding-volume hierarchy of boxes that hold all points within `radius`, m, of the points of a file.

    The points are gathered in cells with edges of `radius`; of each cell, the least box along the axes that holds the
    balls of its points. So nothing is closer to a point than it seems, and a box reaches at most 0.74 radius + (what
    the points of one cell are apart) beyond the balls.

    Raises:
        ValueError: it cannot be read, or there are too many cells.
    """
    points = source.soup()
    try:
        return _gathered(points, radius)
    except ValueError as error:
        raise ValueError(f"{source.kind} {source.path}: {error}") from error


@lru_cache(maxsize=64)
def _gathered(soup: Soup, radius: float) -> coal.CollisionGeometry:
    points = soup.vertices
    check_reach(points)
    cells = np.floor(points / radius)
    order = np.lexsort(cells.T)
    begins = np.flatnonzero(np.concatenate([[True], (np.diff(cells[order], axis=0) != 0.0).any(axis=1)]))
    if 12 * len(begins) > MOST_TRIANGLES:
        raise ValueError(
            f"its points fill {len(begins)} cells of {radius:g} m, at most {MOST_TRIANGLES // 12} are kept: "
            "a larger radius makes fewer"
        )
    low = np.minimum.reduceat(points[order], begins) - radius
    high = np.maximum.reduceat(points[order], begins) + radius
    return triangle_mesh(*surface_of_boxes(low, high))


@lru_cache(maxsize=256)
def _built(soup: Soup, scale: tuple[float, float, float], convex: bool) -> coal.CollisionGeometry:
    """Made once per content, scale and kind; coal geometry is never changed after it is made, so it is shared."""
    vertices = (soup.vertices @ soup.turn.T) * np.asarray(scale, float)
    if convex:
        check_reach(vertices)
        return convex_hull(vertices)
    return triangle_mesh(vertices, soup.triangles)


def check_reach(vertices: Array) -> None:
    """Refuse vertices (k, 3), m, that are too far away, or no numbers.

    Raises:
        ValueError: says so.
    """
    if not (np.abs(vertices) <= LARGEST_COORDINATE).all():  # written so that NaN is refused too
        raise ValueError(f"a vertex that is no number or beyond {LARGEST_COORDINATE:g} m")


def triangle_mesh(vertices: Array, triangles: Triangles) -> coal.BVHModelBase:
    """Bounding-volume hierarchy of triangles (m, 3), indices of vertices (k, 3) in m.

    Raises:
        ValueError: a vertex that is too far away.
    """
    check_reach(vertices)
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(triangles), len(vertices))
    mesh.addVertices(vertices)
    mesh.addTriangles(triangles)
    mesh.endModel()
    mesh.computeLocalAABB()
    return mesh


@dataclass(frozen=True)
class FileShape(Shape):
    """A shape that a file holds.

    `key` is the digest of what the file held when the shape was made, by `meshes.reading.open_mesh`; without one the
    shape is what the file holds when it is built.
    """

    kind: ClassVar[Kind]
    formats: ClassVar[str]

    file: Path
    key: str = field(default="", compare=False, kw_only=True)

    def same_body(self, other: Shape) -> bool:
        """Whether another shape is of the same file, and that held the same; not known without a key."""
        return self == other and isinstance(other, FileShape) and self.key == other.key != ""

    @property
    def source(self) -> BodyFile:
        """The file, what it has to hold, and what it is read as."""
        return BodyFile(self.file, self.key, self.kind)

    @property
    def wanted(self) -> str:
        """What a message says was expected: the kind of file, and its formats."""
        return f"{'an' if self.kind[0] in 'aeiou' else 'a'} {self.kind} file ({self.formats})"


class MeshSpec(Strict):
    """`file` (STL, OBJ, DAE, PLY or GLB) beside this file, times `scale` (a number or [x, y, z]); `convex`: hull."""

    file: FileName
    scale: Scale = (1.0, 1.0, 1.0)
    convex: Annotated[bool, Field(strict=True)] = False


@dataclass(frozen=True)
class Mesh(FileShape):
    """Triangles of a file (STL, OBJ, DAE, PLY, GLB) times `scale`; `convex` takes their convex hull.

    Where the file says which axis is up, it is turned so that z is.
    """

    kind = "mesh"
    formats = FORMATS

    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    convex: bool = False

    @classmethod
    def from_data(cls, data: MeshSpec) -> Self:
        """`{file: …, scale: …, convex: …}`, the file as it stands there."""
        return cls(Path(data.file), (data.scale[0], data.scale[1], data.scale[2]), data.convex)

    def to_data(self) -> dict[str, Any]:
        """The file with its path."""
        return {"file": str(self.file), "scale": list(self.scale), "convex": self.convex}

    def body(self) -> coal.CollisionGeometry:
        """A bounding-volume hierarchy of the triangles or, with `convex`, their convex hull."""
        return mesh_body(self.source, self.scale, self.convex)


class PointCloudSpec(Strict):
    """`file` (PLY, PCD or NPZ) beside this file, of points in m; all within `radius`, m, of a point is solid."""

    file: FileName
    radius: Length


@dataclass(frozen=True)
class PointCloud(FileShape):
    """All points within `radius`, m, of those of a file (PLY, PCD, NPZ), as `cloud_body` holds them."""

    kind = "point cloud"
    formats = POINT_FORMATS

    radius: float = 0.0

    @classmethod
    def from_data(cls, data: PointCloudSpec) -> Self:
        """`{file: …, radius: …}`, the file as it stands there."""
        return cls(Path(data.file), data.radius)

    def to_data(self) -> dict[str, Any]:
        """The file with its path."""
        return {"file": str(self.file), "radius": self.radius}

    def body(self) -> coal.CollisionGeometry:
        """See `cloud_body`."""
        return cloud_body(self.source, self.radius)


class OctreeSpec(Strict):
    """`file` (BT or OT, of OctoMap) beside this file; its occupied cells are solid."""

    file: FileName


@dataclass(frozen=True)
class Octree(FileShape):
    """The occupied cells of an OctoMap file (BT, OT); cells that it does not know are free."""

    kind = "octree"
    formats = OCTREE_FORMATS

    @classmethod
    def from_data(cls, data: OctreeSpec) -> Self:
        """`{file: …}`, the file as it stands there."""
        return cls(Path(data.file))

    def to_data(self) -> dict[str, Any]:
        """The file with its path."""
        return {"file": str(self.file)}

    def body(self) -> coal.CollisionGeometry:
        """A bounding-volume hierarchy of the surface around the cells."""
        return mesh_body(self.source, (1.0, 1.0, 1.0), convex=False)
