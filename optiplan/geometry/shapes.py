"""Shapes of obstacles and attached objects.

A shape is one class here and one line in `ShapeSpec`: what stands in a problem file, the body that coal tests, the
support function by which the verifier proves it apart from others, and what the page draws. All else is general.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

import coal
import numpy as np
from pydantic import Field

from optiplan.arrays import Array, unit
from optiplan.config.document import Strict
from optiplan.config.values import Coordinate, Direction, ExactlyOne, FileName, Length, Scale, Size
from optiplan.geometry.mesh_bodies import Source, cloud_body, mesh_body
from optiplan.geometry.meshes.reading import FORMATS, OCTREE_FORMATS, POINT_FORMATS, Kind


class Shape(ABC):
    """A solid in its own frame, lengths in m.

    Attributes:
        body_type: class of coal that is this shape and no other; None where there is none.
        endless: whether it has no bounds, so that nothing can carry it.
    """

    body_type: ClassVar[type[coal.CollisionGeometry] | None] = None
    endless: ClassVar[bool] = False

    @classmethod
    @abstractmethod
    def from_data(cls, data: Any) -> Self:
        """The shape that a value of `ShapeSpec` means."""

    @abstractmethod
    def to_data(self) -> Any:
        """What a problem file says of it, JSON-ready: the inverse of `from_data`."""

    @abstractmethod
    def body(self) -> coal.CollisionGeometry:
        """What coal tests.

        Raises:
            ValueError: it cannot be made.
        """

    @classmethod
    def of_body(cls, body: Any) -> Self:
        """The shape of a body of `body_type`."""
        raise NotImplementedError(cls.__name__)

    def support(self, n: Array) -> Array:
        """h(n) = max of n . x over its points x; n (K, 3) of any length, result (K,), m; infinite where unknown."""
        return np.full(len(n), np.inf)

    def picture(self) -> dict[str, Any] | Array | None:
        """What the page draws.

        A `kind` of shapes.js with its dimensions; points (k, 3), m, whose convex hull is drawn; or None, for what the
        triangles of the body tell.
        """
        return None


class RoundSpec(Strict):
    """`radius` and `length` of a cylinder (whole length) or capsule (length between the round caps), m."""

    radius: Length
    length: Length


@dataclass(frozen=True)
class Box(Shape):
    """Cuboid centred on its frame; edge lengths in m."""

    size: tuple[float, float, float]

    body_type = coal.Box

    @classmethod
    def from_data(cls, data: Size) -> Self:
        """`box: [x, y, z]`."""
        return cls((data[0], data[1], data[2]))

    def to_data(self) -> list[float]:
        """Edge lengths."""
        return list(self.size)

    def body(self) -> coal.CollisionGeometry:
        """See `Shape`."""
        return coal.Box(*self.size)

    @classmethod
    def of_body(cls, body: Any) -> Self:
        """See `Shape`."""
        return cls.from_data((2.0 * body.halfSide).tolist())

    def support(self, n: Array) -> Array:
        """h(n) = |n| . size / 2."""
        return np.asarray(np.abs(n) @ (0.5 * np.array(self.size)))

    def picture(self) -> dict[str, Any]:
        """See `Shape`."""
        return {"kind": "box", "size": list(self.size)}


@dataclass(frozen=True)
class Sphere(Shape):
    """Ball centred on its frame; radius in m."""

    radius: float

    body_type = coal.Sphere

    @classmethod
    def from_data(cls, data: float) -> Self:
        """`sphere: radius`."""
        return cls(data)

    def to_data(self) -> float:
        """The radius."""
        return self.radius

    def body(self) -> coal.CollisionGeometry:
        """See `Shape`."""
        return coal.Sphere(self.radius)

    @classmethod
    def of_body(cls, body: Any) -> Self:
        """See `Shape`."""
        return cls(body.radius)

    def support(self, n: Array) -> Array:
        """h(n) = r ||n||."""
        return np.asarray(self.radius * np.linalg.norm(n, axis=1))

    def picture(self) -> dict[str, Any]:
        """See `Shape`."""
        return {"kind": "sphere", "radius": self.radius}


@dataclass(frozen=True)
class _Round(Shape):
    """Round about its axis z and centred on its frame; radius and length in m."""

    radius: float
    length: float

    @classmethod
    def from_data(cls, data: RoundSpec) -> Self:
        """`{radius: r, length: l}`."""
        return cls(data.radius, data.length)

    def to_data(self) -> dict[str, float]:
        """Radius and length."""
        return {"radius": self.radius, "length": self.length}

    @classmethod
    def of_body(cls, body: Any) -> Self:
        """See `Shape`."""
        return cls(body.radius, 2.0 * body.halfLength)


@dataclass(frozen=True)
class Cylinder(_Round):
    """Cylinder centred on its frame, axis z; radius and full length in m."""

    body_type = coal.Cylinder

    def body(self) -> coal.CollisionGeometry:
        """See `Shape`."""
        return coal.Cylinder(self.radius, self.length)

    def support(self, n: Array) -> Array:
        """h(n) = r ||(n_x, n_y)|| + l / 2 |n_z|."""
        return np.asarray(self.radius * np.hypot(n[:, 0], n[:, 1]) + 0.5 * self.length * np.abs(n[:, 2]))

    def picture(self) -> dict[str, Any]:
        """See `Shape`."""
        return {"kind": "cylinder", **self.to_data()}


@dataclass(frozen=True)
class Capsule(_Round):
    """Cylinder with round caps, centred on its frame, axis z; `length` is that of the cylindrical part, m."""

    body_type = coal.Capsule

    def body(self) -> coal.CollisionGeometry:
        """See `Shape`."""
        return coal.Capsule(self.radius, self.length)

    def support(self, n: Array) -> Array:
        """h(n) = r ||n|| + l / 2 |n_z|."""
        return np.asarray(self.radius * np.linalg.norm(n, axis=1) + 0.5 * self.length * np.abs(n[:, 2]))

    def picture(self) -> dict[str, Any]:
        """See `Shape`."""
        return {"kind": "capsule", **self.to_data()}


class HalfSpaceSpec(Strict):
    """All points p with normal . p <= offset are solid; `normal` has unit length, `offset` in m."""

    normal: Direction
    offset: Coordinate = 0.0


@dataclass(frozen=True)
class HalfSpace(Shape):
    """All points p of the object's frame with normal . p <= offset are solid; `normal` has unit length, offset in m.

    `stated` is the normal as it was written down, of a length that is 1 but for rounding.
    """

    normal: tuple[float, float, float]
    offset: float
    stated: tuple[float, ...] | None = field(default=None, compare=False, repr=False)

    body_type = coal.Halfspace
    endless = True

    @classmethod
    def from_data(cls, data: HalfSpaceSpec) -> Self:
        """`{normal: [x, y, z], offset: d}`."""
        x, y, z = unit(data.normal).tolist()
        return cls((x, y, z), data.offset, data.normal)

    def to_data(self) -> dict[str, Any]:
        """Normal, as it was written down, and offset."""
        return {"normal": list(self.stated or self.normal), "offset": self.offset}

    def body(self) -> coal.CollisionGeometry:
        """See `Shape`."""
        return coal.Halfspace(np.asarray(self.normal, float), float(self.offset))

    @classmethod
    def of_body(cls, body: Any) -> Self:
        """See `Shape`."""
        x, y, z = body.n.tolist()
        return cls((x, y, z), body.d)

    def support(self, n: Array) -> Array:
        """h(n) = d ||n|| along the normal, elsewhere infinite."""
        length = np.linalg.norm(n, axis=1)
        along = n @ np.array(self.normal) > (1.0 - 1e-12) * length
        return np.where(along, self.offset * length, np.inf)

    def picture(self) -> dict[str, Any]:
        """See `Shape`."""
        return {"kind": "plane", "normal": list(self.normal), "offset": self.offset}


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

    @property
    def source(self) -> Source:
        """The file, what it has to hold, and what it is read as."""
        return Source(self.file, self.key, self.kind)


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
    """All points within `radius`, m, of those of a file (PLY, PCD, NPZ), as `mesh_bodies.cloud_body` holds them."""

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
        """See `mesh_bodies.cloud_body`."""
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


class ShapeSpec(ExactlyOne):
    """One shape, such as `box: [x, y, z]` or `sphere: radius`."""

    box: Size | None = None
    sphere: Length | None = None
    cylinder: RoundSpec | None = None
    capsule: RoundSpec | None = None
    half_space: HalfSpaceSpec | None = None
    mesh: MeshSpec | None = None
    points: PointCloudSpec | None = None
    octree: OctreeSpec | None = None


SHAPES: dict[str, type[Shape]] = {
    "box": Box,
    "sphere": Sphere,
    "cylinder": Cylinder,
    "capsule": Capsule,
    "half_space": HalfSpace,
    "mesh": Mesh,
    "points": PointCloud,
    "octree": Octree,
}
"""Keys of `ShapeSpec` to their classes."""


def shape_from_spec(spec: ShapeSpec) -> Shape:
    """The shape that a problem file states; the name of a file as it stands there."""
    return SHAPES[spec.kind].from_data(spec.value)


def shape_data(shape: Shape) -> dict[str, Any]:
    """`shape:` of a problem file."""
    return {next(key for key, cls in SHAPES.items() if isinstance(shape, cls)): shape.to_data()}


def shape_of_body(body: coal.CollisionGeometry) -> Shape | None:
    """The shape that a body of coal is; None for polyhedra, triangles and what is not listed."""
    for cls in SHAPES.values():
        if cls.body_type is not None and isinstance(body, cls.body_type):
            return cls.of_body(body)
    return None


def build_geometry(shape: Shape) -> coal.CollisionGeometry:
    """Coal geometry of a shape, in the shape's own frame, m.

    Raises:
        ValueError: a mesh file that cannot be read, holds NaN or infinity, or has no volume to hull.
    """
    body = shape.body()
    if not isinstance(shape, FileShape):  # whose body is shared, with its box
        body.computeLocalAABB()
    return body
