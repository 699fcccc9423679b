"""What stands around the robot and what it holds: shapes, obstacles, attached objects, allowed contacts."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import pinocchio as pin

LARGEST_COORDINATE = 1e6
"""m; nothing that an arm can meet, and beyond it distances lose the micrometres that they are trusted to."""


@dataclass(frozen=True)
class Box:
    """Cuboid centred on its frame; edge lengths in m."""

    size: tuple[float, float, float]


@dataclass(frozen=True)
class Sphere:
    """Ball centred on its frame; radius in m."""

    radius: float


@dataclass(frozen=True)
class Cylinder:
    """Cylinder centred on its frame, axis z; radius and full length in m."""

    radius: float
    length: float


@dataclass(frozen=True)
class Capsule:
    """Cylinder with round caps, centred on its frame, axis z; `length` is that of the cylindrical part, m."""

    radius: float
    length: float


@dataclass(frozen=True)
class HalfSpace:
    """All points p of the object's frame with normal . p <= offset are solid; `normal` has unit length, offset in m."""

    normal: tuple[float, float, float]
    offset: float


@dataclass(frozen=True)
class Mesh:
    """Triangles of a file (STL, OBJ, DAE, PLY, GLB) times `scale`; `convex` takes their convex hull.

    Where the file says which axis is up, it is turned so that z is. `key` is the digest of what the file held when the
    shape was made, by `mesh_reading.open_mesh`; without one the shape is what the file holds when it is built.
    """

    file: Path
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    convex: bool = False
    key: str = field(default="", compare=False)


Shape = Box | Sphere | Cylinder | Capsule | HalfSpace | Mesh


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A shape that stands still at `X_WO`, the pose of the object in the world."""

    name: str
    shape: Shape
    X_WO: pin.SE3


@dataclass(frozen=True, eq=False)
class Attachment:
    """A shape held by a link at `X_LO`; it may touch the links named in `touch` (and always its own link)."""

    name: str
    shape: Shape
    link: str
    X_LO: pin.SE3
    touch: frozenset[str] = frozenset()


@dataclass(frozen=True, eq=False)
class Scene:
    """Obstacles, attached objects, and pairs of names (links, obstacles, attachments) that may touch."""

    obstacles: tuple[Obstacle, ...] = ()
    attached: tuple[Attachment, ...] = ()
    allowed: frozenset[frozenset[str]] = frozenset()

    def with_attached(self, *attached: Attachment) -> "Scene":
        """A new scene that holds these as well."""
        return replace(self, attached=self.attached + attached)
