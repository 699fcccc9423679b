"""Bodies inside a mesh: a mesh is a surface, and the distance to it does not tell inside from outside."""

from collections.abc import Sequence
from dataclasses import dataclass

import coal
import numpy as np

from optiplan.arrays import Array
from optiplan.geometry.convex import triangles_of, vertices_of
from optiplan.geometry.enclosure import Enclosure, connected_parts

_FEW = 16  # points of a part of a mesh that are tried


@dataclass(frozen=True, eq=False)
class Contained:
    """A body inside a mesh: the pair, the two bodies, and a point (3,) of the inner one, world, m."""

    pair: int
    inner: int
    mesh: int
    point: Array


class Containment:
    """Finds pairs of bodies of which one is inside the mesh that is the other.

    One connected part of a body is inside or outside as a whole as long as the surfaces stay apart; so this needs to
    hold at one configuration of a motion that is free of contact.

    Args:
        shapes: coal geometry of each body.
        pairs: bodies a and b of each pair.
    """

    def __init__(self, shapes: Sequence[coal.CollisionGeometry], pairs: Sequence[tuple[int, int]]) -> None:
        self.shapes = shapes
        self._sides = [
            (index, mesh, other)
            for index, pair in enumerate(pairs)
            for mesh, other in (pair, pair[::-1])
            if isinstance(shapes[mesh], coal.BVHModelBase) and not isinstance(shapes[other], coal.Halfspace)
        ]
        self._corners: dict[int, tuple[Array, Array]] = {}
        self._enclosures: dict[int, Enclosure] = {}
        self._parts: dict[int, list[Array]] = {}

    def find(self, poses: Array) -> Contained | None:
        """The first body inside another one; None if there is none.

        Args:
            poses: (G, 4, 4) of the bodies in the world.
        """
        for pair, mesh, other in self._sides:
            X_MO = np.linalg.inv(poses[mesh]) @ poses[other]
            low, high = self._box(mesh)
            for points in self._parts_of(other):
                p_M = points @ X_MO[:3, :3].T + X_MO[:3, 3]
                if ((p_M >= low) & (p_M <= high)).all() and self._enclosure(mesh).holds(p_M):
                    return Contained(pair, other, mesh, poses[other, :3, :3] @ points[0] + poses[other, :3, 3])
        return None

    def _box(self, mesh: int) -> tuple[Array, Array]:
        if mesh not in self._corners:
            vertices = vertices_of(self.shapes[mesh])
            self._corners[mesh] = vertices.min(axis=0), vertices.max(axis=0)
        return self._corners[mesh]

    def _enclosure(self, mesh: int) -> Enclosure:
        if mesh not in self._enclosures:
            shape = self.shapes[mesh]
            self._enclosures[mesh] = Enclosure(vertices_of(shape), triangles_of(shape))
        return self._enclosures[mesh]

    def _parts_of(self, body: int) -> list[Array]:
        """Some points (k, 3) of every connected part of a body, in its own frame, m."""
        if body not in self._parts:
            shape = self.shapes[body]
            if isinstance(shape, coal.BVHModelBase):
                parts = connected_parts(vertices_of(shape), triangles_of(shape))
                self._parts[body] = [part[:: len(part) // _FEW + 1] for part in parts]
            elif isinstance(shape, coal.ConvexBase):
                corners = np.array(shape.points())
                self._parts[body] = [np.vstack([corners.mean(axis=0), corners[:: len(corners) // _FEW + 1]])]
            else:
                self._parts[body] = [np.zeros((1, 3))]
        return self._parts[body]
