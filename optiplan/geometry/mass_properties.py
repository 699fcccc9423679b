"""Mass properties of bodies that are filled evenly: volume, centre of mass, moments of inertia."""

from functools import lru_cache
from typing import NamedTuple

import coal
import numpy as np

from optiplan.arrays import Array
from optiplan.geometry.convex import mesh_triangles, mesh_vertices
from optiplan.geometry.enclosure import Enclosure


class MassProperties(NamedTuple):
    """Of a body that is filled evenly.

    Attributes:
        volume: m³.
        centre: of mass, (3,) m.
        moments: (3, 3) of inertia about the centre, of 1 kg: m².
    """

    volume: float
    centre: Array
    moments: Array


FLAT = 1e-10
"""Share of the cube of a mesh's extent: less is no volume, but rounding."""


def mass_properties(body: coal.CollisionGeometry) -> MassProperties:
    """Return those of a body of coal; of a mesh, its closed pieces are filled but for hollows, whatever their winding.

    Pieces that overlap count twice where they do.

    Raises:
        ValueError: a mesh with an open piece, or a body without a volume.
    """
    if isinstance(body, coal.BVHModelBase):
        return _of_mesh(body)
    volume = body.computeVolume()
    if not volume > 0.0:
        raise ValueError("encloses no volume")
    return MassProperties(
        volume, np.array(body.computeCOM()), np.array(body.computeMomentofInertiaRelatedToCOM()) / volume
    )


@lru_cache(maxsize=64)
def _of_mesh(mesh: coal.BVHModelBase) -> MassProperties:
    """Add up the tetrahedra between a point and the triangles.

    Of one with corners a, b, c seen from that point, V = a · (b × c) / 6, ∫ x dV = V s / 4 with s = a + b + c, and
    ∫ x xᵀ dV = V (a aᵀ + b bᵀ + c cᵀ + s sᵀ) / 20.
    """
    vertices = mesh_vertices(mesh)
    origin = vertices.mean(axis=0)
    solids = Enclosure(vertices, mesh_triangles(mesh)).solids()
    if solids is None:
        raise ValueError("is a mesh that is open somewhere")
    volume, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for corners, sign in solids:
        a, b, c = np.moveaxis(corners - origin, 1, 0)
        V = sign * np.einsum("ki,ki->k", a, np.cross(b, c)) / 6.0
        total = a + b + c
        volume += float(V.sum())
        first += V @ total / 4.0
        second += sum((x * V[:, None]).T @ x for x in (a, b, c, total)) / 20.0
    if not volume > FLAT * float(np.ptp(vertices, axis=0).max()) ** 3:
        raise ValueError("encloses no volume")
    centre = first / volume
    spread = second / volume - np.outer(centre, centre)
    return MassProperties(volume, origin + centre, np.trace(spread) * np.eye(3) - spread)
