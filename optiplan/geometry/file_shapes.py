"""Shapes from files: meshes, point clouds and octrees. Their bodies are triangles, cached by content."""

from abc import abstractmethod
from dataclasses import field, fields
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

import coal
import numpy as np
from pydantic import Field

from optiplan.arrays import Array
from optiplan.config.document import Strict, plain
from optiplan.config.values import LARGEST_COORDINATE, FileName, Length, Scale
from optiplan.geometry.coal_queries import coal_mesh
from optiplan.geometry.convex_hulls import convex_hull
from optiplan.geometry.meshes.reading import KINDS, Kind, known, open_mesh, read_mesh
from optiplan.geometry.meshes.triangles import MOST_TRIANGLES, Soup, Triangles
from optiplan.geometry.shape import Shape
from optiplan.records import dataclass


@lru_cache(maxsize=64)
def _cloud_body(soup: Soup, radius: float) -> coal.CollisionGeometry:
    from optiplan.geometry.meshes.box_surfaces import surface_of_boxes

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
def _mesh_body(soup: Soup, scale: tuple[float, float, float], convex: bool) -> coal.CollisionGeometry:
    """Return the body of a content, made once: coal geometry never changes, so it is shared."""
    vertices = (soup.vertices @ soup.turn.T) * np.asarray(scale, float)
    if convex:
        check_reach(vertices)
        return convex_hull(vertices)
    return triangle_mesh(vertices, soup.triangles)


def check_reach(vertices: Array) -> None:
    """Refuse vertices (k, 3), m, that are too far away or not finite.

    Raises:
        ValueError: there is such a vertex.
    """
    if not (np.abs(vertices) <= LARGEST_COORDINATE).all():  # written so that NaN is refused too
        raise ValueError(f"a vertex that is no number or beyond {LARGEST_COORDINATE:g} m")


def triangle_mesh(vertices: Array, triangles: Triangles) -> coal.BVHModelBase:
    """Return the bounding-volume hierarchy of triangles (m, 3), indices of vertices (k, 3) in m.

    Raises:
        ValueError: a vertex that is too far away.
    """
    check_reach(vertices)
    mesh = coal_mesh(vertices, triangles)
    mesh.computeLocalAABB()
    return mesh


@dataclass(frozen=True)
class FileShape(Shape):
    """A shape read from a file.

    `key` is the digest of the file's content when the shape was made, by `meshes.reading.open_mesh`. Without a key the
    shape is the file's content when it is built.
    """

    kind: ClassVar[Kind]

    file: Path
    key: str = field(default="", compare=False, kw_only=True)

    def same_body(self, other: Shape) -> bool:
        """Return whether another shape has the same file and the same content; False without a key."""
        return self == other and isinstance(other, FileShape) and self.key == other.key != ""

    @classmethod
    def from_data(cls, data: Any) -> Self:
        """Return the shape of the keys in a problem file, its path unresolved."""
        keys = dict(data)
        return cls(Path(keys.pop("file")), **keys)

    def to_data(self) -> dict[str, Any]:
        """Return the keys of the problem file."""
        return {one.name: plain(getattr(self, one.name)) for one in fields(self) if one.name != "key"}

    def body(self) -> coal.CollisionGeometry:
        """Return a bounding-volume hierarchy of triangles or, of a convex mesh, the hull.

        Raises:
            ValueError: the file cannot be read, has changed, holds NaN or infinity, or cannot be built.
        """
        soup = self._soup()
        try:
            return self.build(soup)
        except ValueError as error:
            raise ValueError(f"{self.kind} {self.file}: {error}") from error

    @abstractmethod
    def build(self, soup: Soup) -> coal.CollisionGeometry:
        """Return the body of the file's content.

        Raises:
            ValueError: says why there is none.
        """

    def _soup(self) -> Soup:
        soup = known(self.key) if self.key else None
        if soup is None:
            file = open_mesh(self.file, self.kind)
            if self.key not in ("", file.key):
                raise ValueError(f"{self.kind} {self.file} is not what it was when it was loaded")
            soup = read_mesh(file)
        return soup

    @property
    def wanted(self) -> str:
        """The kind of file and its formats, as the expected value in a message."""
        return f"{'an' if self.kind[0] in 'aeiou' else 'a'} {self.kind} file ({KINDS[self.kind].words})"


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

    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    convex: bool = False

    def build(self, soup: Soup) -> coal.CollisionGeometry:
        """Return a bounding-volume hierarchy of the triangles or, with `convex`, their convex hull."""
        return _mesh_body(soup, self.scale, self.convex)


class PointCloudSpec(Strict):
    """`file` (PLY, PCD or NPZ) beside this file, of points in m; all within `radius`, m, of a point is solid."""

    file: FileName
    radius: Length


@dataclass(frozen=True)
class PointCloud(FileShape):
    """All points within `radius`, m, of those of a file (PLY, PCD, NPZ).

    The body consists of boxes. The points are gathered in cells with edges of `radius`. Each cell has the least box
    along the axes that contains the balls about its points. So no distance is overestimated, and a box reaches at
    most 0.74 radius + (the extent of its points) beyond the balls.
    """

    kind = "point cloud"

    radius: float = 0.0

    def build(self, soup: Soup) -> coal.CollisionGeometry:
        """Return a bounding-volume hierarchy of the surfaces of the boxes; too many cells are refused."""
        return _cloud_body(soup, self.radius)


class OctreeSpec(Strict):
    """`file` (BT or OT, of OctoMap) beside this file; its occupied cells are solid."""

    file: FileName


@dataclass(frozen=True)
class Octree(FileShape):
    """The occupied cells of an OctoMap file (BT, OT); cells that it does not know are free."""

    kind = "octree"

    def build(self, soup: Soup) -> coal.CollisionGeometry:
        """Return a bounding-volume hierarchy of the surface around the cells."""
        return _mesh_body(soup, (1.0, 1.0, 1.0), convex=False)
