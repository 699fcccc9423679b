"""Shapes of obstacles and attached objects.

A shape is one class here and one line in `ShapeSpec`. The class has the keys of a problem file, the body for coal, the
support function for the verifier's proofs, and the drawing for the page. All other code works for any shape.
"""

from dataclasses import field
from typing import Any, ClassVar, Self

import coal
import numpy as np

from optiplan.arrays import Array, unit_vector
from optiplan.config.document import Strict
from optiplan.config.values import Coordinate, Direction, ExactlyOne, Length, Size
from optiplan.geometry.file_shapes import FileShape, Mesh, MeshSpec, Octree, OctreeSpec, PointCloud, PointCloudSpec
from optiplan.geometry.shape import Shape
from optiplan.records import dataclass


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

    body_type: ClassVar[type[coal.CollisionGeometry]]

    @classmethod
    def from_data(cls, data: RoundSpec) -> Self:
        """`{radius: r, length: l}`."""
        return cls(data.radius, data.length)

    def to_data(self) -> dict[str, float]:
        """Radius and length."""
        return {"radius": self.radius, "length": self.length}

    def body(self) -> coal.CollisionGeometry:
        """See `Shape`."""
        return self.body_type(self.radius, self.length)

    @classmethod
    def of_body(cls, body: Any) -> Self:
        """See `Shape`."""
        return cls(body.radius, 2.0 * body.halfLength)

    def picture(self) -> dict[str, Any]:
        """See `Shape`."""
        return {"kind": type(self).__name__.lower(), **self.to_data()}


@dataclass(frozen=True)
class Cylinder(_Round):
    """Cylinder centred on its frame, axis z; radius and full length in m."""

    body_type = coal.Cylinder

    def support(self, n: Array) -> Array:
        """h(n) = r ||(n_x, n_y)|| + l / 2 |n_z|."""
        return np.asarray(self.radius * np.hypot(n[:, 0], n[:, 1]) + 0.5 * self.length * np.abs(n[:, 2]))


@dataclass(frozen=True)
class Capsule(_Round):
    """Cylinder with round caps, centred on its frame, axis z; `length` is that of the cylindrical part, m."""

    body_type = coal.Capsule

    def support(self, n: Array) -> Array:
        """h(n) = r ||n|| + l / 2 |n_z|."""
        return np.asarray(self.radius * np.linalg.norm(n, axis=1) + 0.5 * self.length * np.abs(n[:, 2]))


class HalfSpaceSpec(Strict):
    """All points p with normal . p <= offset are solid; `normal` has unit length, `offset` in m."""

    normal: Direction
    offset: Coordinate = 0.0


@dataclass(frozen=True)
class HalfSpace(Shape):
    """All points p of the object's frame with normal . p <= offset are solid; `normal` has unit length, offset in m.

    `stated` is the normal as given in the problem file, of unit length up to rounding.
    """

    normal: tuple[float, float, float]
    offset: float
    stated: tuple[float, ...] | None = field(default=None, compare=False, repr=False)

    body_type = coal.Halfspace
    endless = True

    @classmethod
    def from_data(cls, data: HalfSpaceSpec) -> Self:
        """`{normal: [x, y, z], offset: d}`."""
        x, y, z = unit_vector(data.normal).tolist()
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
    """Return the shape of a problem file; the path of a file is not resolved."""
    return SHAPES[spec.kind].from_data(spec.value)


def shape_data(shape: Shape) -> dict[str, Any]:
    """Return the value of `shape:` in a problem file."""
    return {next(key for key, cls in SHAPES.items() if isinstance(shape, cls)): shape.to_data()}


def shape_of_body(body: coal.CollisionGeometry) -> Shape | None:
    """Return the shape of a body of coal; None for polyhedra, triangles and unknown types."""
    for cls in SHAPES.values():
        if cls.body_type is not None and isinstance(body, cls.body_type):
            return cls.of_body(body)
    return None


def build_geometry(shape: Shape) -> coal.CollisionGeometry:
    """Return the coal geometry of a shape, in the shape's own frame, m.

    Raises:
        ValueError: a mesh file that cannot be read, holds NaN or infinity, or has no volume to hull.
    """
    body = shape.body()
    if not isinstance(shape, FileShape):  # whose body is shared, with its box
        body.computeLocalAABB()
    return body
