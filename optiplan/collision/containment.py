"""Bodies inside a mesh: a mesh is a surface, so the distance to it is positive inside and outside."""

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import coal
import numpy as np

from optiplan.arrays import Array, Flags, Index
from optiplan.geometry.convex import mesh_triangles, mesh_vertices

if TYPE_CHECKING:
    from optiplan.geometry.enclosure import Enclosure

_KINDS = (coal.BVHModelBase, coal.Halfspace)
_POINTS_PER_PART = 16
"""Points of one part of a body that are tried."""


class Contained(NamedTuple):
    """A body inside a mesh: the pair, the two bodies, and a point (3,) of the inner one, world, m."""

    pair: int
    inner: int
    mesh: int
    point: Array


class _Candidates(NamedTuple):
    """K pairs of a mesh and another body.

    Attributes:
        low, high: (K, 3) corners of the mesh's box, m.
        point: (K, 3) point of the other body in its own frame, m.
        several: (K,) whether the other body has several parts.
    """

    low: Array
    high: Array
    point: Array
    several: Flags


class Containment:
    """Find pairs of bodies where one is inside the other, a mesh.

    As long as the surfaces stay apart, a connected part of a body is inside or outside as a whole. So one check at one
    configuration is enough for a motion without contact.

    Args:
        shapes: coal geometry of each body.
        pairs: bodies a and b of each pair, (P, 2).
    """

    def __init__(self, shapes: Sequence[coal.CollisionGeometry], pairs: Index) -> None:
        self.shapes = shapes
        meshes, planes = (np.array([isinstance(shape, kind) for shape in shapes], dtype=bool) for kind in _KINDS)
        which, side = np.nonzero(meshes[pairs] & ~planes[pairs[:, ::-1]])
        self._pairs, self._meshes, self._others = which, pairs[which, side], pairs[which, 1 - side]
        self._corners: dict[int, tuple[Array, Array]] = {}
        self._enclosures: dict[int, Enclosure] = {}
        self._parts: dict[int, list[Array]] = {}

    @property
    def possible(self) -> bool:
        """Whether any pair has a mesh that can contain the other body."""
        return len(self._pairs) > 0

    def find(self, poses: Array) -> Contained | None:
        """Return the first body inside another one; None if there is none.

        Args:
            poses: (G, 4, 4) of the bodies in the world.
        """
        for k in np.flatnonzero(self._may_hold(poses)).tolist():
            mesh, other = int(self._meshes[k]), int(self._others[k])
            X_MO = np.linalg.inv(poses[mesh]) @ poses[other]
            low, high = self._box(mesh)
            for points in self._parts_of(other):
                p_M = points @ X_MO[:3, :3].T + X_MO[:3, 3]
                if ((p_M >= low) & (p_M <= high)).all() and self._enclosure(mesh).holds(p_M):
                    point = poses[other, :3, :3] @ points[0] + poses[other, :3, 3]
                    return Contained(int(self._pairs[k]), other, mesh, point)
        return None

    def _may_hold(self, poses: Array) -> Flags:
        """Return whether the other body of each candidate (K,) may be inside the mesh.

        A body of one part is outside if its point is outside the box of the mesh.
        """
        if not self.possible:
            return np.zeros(0, dtype=bool)
        meshes, others = self._meshes, self._others
        low, high, point, several = self._table
        R, p = poses[meshes, :3, :3], poses[meshes, :3, 3]
        world = np.einsum("kij,kj->ki", poses[others, :3, :3], point) + poses[others, :3, 3]
        p_M = np.einsum("kji,kj->ki", R, world - p)
        slack = 1e-9 * (1.0 + np.abs(p_M).max(axis=1, keepdims=True))
        inside = ((p_M >= low - slack) & (p_M <= high + slack)).all(axis=1)
        return np.asarray(inside | several)

    @cached_property
    def _table(self) -> _Candidates:
        meshes, mesh_of = np.unique(self._meshes, return_inverse=True)
        low, high = (np.array(corners) for corners in zip(*map(self._box, meshes.tolist()), strict=True))
        bodies, body_of = np.unique(self._others, return_inverse=True)
        points, whole = zip(*map(self._first_part, bodies.tolist()), strict=True)
        return _Candidates(low[mesh_of], high[mesh_of], np.array(points)[body_of], ~np.array(whole)[body_of])

    def _first_part(self, body: int) -> tuple[Array, bool]:
        """Return a point (3,) of a body's first part, m, in its own frame, and whether that is the only part."""
        shape = self.shapes[body]
        if isinstance(shape, coal.ConvexBase):
            return np.array(shape.point(0)), True
        parts = self._parts_of(body)
        return (parts[0][0], len(parts) == 1) if parts else (np.zeros(3), False)

    def _box(self, mesh: int) -> tuple[Array, Array]:
        if mesh not in self._corners:
            vertices = mesh_vertices(self.shapes[mesh])
            self._corners[mesh] = vertices.min(axis=0), vertices.max(axis=0)
        return self._corners[mesh]

    def _enclosure(self, mesh: int) -> "Enclosure":
        if mesh not in self._enclosures:
            shape = self.shapes[mesh]
            from optiplan.geometry.enclosure import Enclosure

            self._enclosures[mesh] = Enclosure(mesh_vertices(shape), mesh_triangles(shape))
        return self._enclosures[mesh]

    def _parts_of(self, body: int) -> list[Array]:
        """Return some points (k, 3) of every connected part of a body, in its own frame, m."""
        if body not in self._parts:
            shape = self.shapes[body]
            if isinstance(shape, coal.BVHModelBase):
                from optiplan.geometry.enclosure import connected_parts

                parts = connected_parts(mesh_vertices(shape), mesh_triangles(shape))
                self._parts[body] = [part[:: len(part) // _POINTS_PER_PART + 1] for part in parts]
            elif isinstance(shape, coal.ConvexBase):
                corners = np.array(shape.points())
                self._parts[body] = [
                    np.vstack([corners.mean(axis=0), corners[:: len(corners) // _POINTS_PER_PART + 1]])
                ]
            else:
                self._parts[body] = [np.zeros((1, 3))]
        return self._parts[body]
