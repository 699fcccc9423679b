"""Hulls of the parts of a mesh: asked where the hull of the whole does not tell, before its triangles are."""

from collections.abc import Iterator

import numpy as np

from optiplan.arrays import Array
from optiplan.cache import MostRecent, digest
from optiplan.geometry.convex_hulls import Hull, solid_hull
from optiplan.geometry.meshes.triangles import Soup

_PARTS = 6
"""Into which a mesh is cut: more are not asked less often, and each costs a query of two polyhedra."""

_made: MostRecent[tuple[Hull, ...]] = MostRecent(256)
"""Parts of meshes by content."""


def parts_of_mesh(mesh: Soup) -> tuple[Hull, ...]:
    """Return hulls that together hold all triangles of a mesh, in its frame; made once for each content."""
    key = digest([mesh.vertices.tobytes(), mesh.triangles.tobytes()])
    return _made.get(key, lambda: tuple(map(solid_hull, _cut(mesh))))


def _cut(mesh: Soup) -> Iterator[Array]:
    """Corners of all triangles of each part: the longest part is cut in two, across its length, again and again."""
    corners = mesh.vertices[mesh.triangles]  # (f, 3, 3)
    parts = [corners]
    while len(parts) < min(_PARTS, len(corners)):
        lengths = [np.ptp(part.reshape(-1, 3), axis=0) for part in parts]
        longest = parts.pop(int(np.argmax([length.max() for length in lengths])))
        middles = longest.mean(axis=1)
        order = np.argsort(middles[:, int(np.argmax(np.ptp(middles, axis=0)))], kind="stable")
        if len(order) < 2:
            parts.append(longest)
            break
        parts += [longest[half] for half in np.array_split(order, 2)]
    return (part.reshape(-1, 3) for part in parts)
