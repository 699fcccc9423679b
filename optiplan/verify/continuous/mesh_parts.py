"""Hulls of the parts of a mesh: asked where the hull of the whole does not tell, before its triangles are."""

from collections.abc import Iterator
from weakref import WeakKeyDictionary

import coal
import numpy as np

from optiplan.arrays import Array, Index
from optiplan.geometry.convex import mesh_triangles, mesh_vertices
from optiplan.geometry.convex_hulls import kept_hull, thickened_hull
from optiplan.robot.robot import Robot
from optiplan.verify.continuous.bodies import BodyShape

_PARTS = 6
"""Into which a mesh is cut: more are not asked less often, and each costs a query of two polyhedra."""

_kept: "WeakKeyDictionary[Robot, dict[int, tuple[BodyShape, ...]]]" = WeakKeyDictionary()


def parts_of_link(robot: Robot, body: int) -> tuple[BodyShape, ...]:
    """Hulls that together hold a body of the robot that is a mesh, in its frame; built once for each robot."""
    known = _kept.setdefault(robot.unmounted, {})
    if body not in known:
        mesh = robot.geometry.geometryObjects[body].geometry
        known[body] = tuple(BodyShape.of(_hull(points)) for points in _cut(mesh_vertices(mesh), mesh_triangles(mesh)))
    return known[body]


def _cut(vertices: Array, triangles: Index) -> Iterator[Array]:
    """Corners of all triangles of each part: the longest part is cut in two, across its length, again and again."""
    corners = vertices[triangles]  # (f, 3, 3)
    parts = [corners]
    while len(parts) < min(_PARTS, len(triangles)):
        lengths = [np.ptp(part.reshape(-1, 3), axis=0) for part in parts]
        longest = parts.pop(int(np.argmax([length.max() for length in lengths])))
        middles = longest.mean(axis=1)
        order = np.argsort(middles[:, int(np.argmax(np.ptp(middles, axis=0)))], kind="stable")
        if len(order) < 2:
            parts.append(longest)
            break
        parts += [longest[half] for half in np.array_split(order, 2)]
    return (part.reshape(-1, 3) for part in parts)


def _hull(points: Array) -> coal.ConvexBase:
    try:
        return kept_hull(points).build()
    except ValueError:  # in a plane
        return thickened_hull(points).build()
