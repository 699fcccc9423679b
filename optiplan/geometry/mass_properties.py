"""Mass properties of bodies of uniform density: volume, centre of mass, moments of inertia."""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.convex import mesh_triangles, mesh_vertices
from optiplan.geometry.enclosure import Enclosure


class MassProperties(NamedTuple):
    """Mass properties of a body of uniform density.

    Attributes:
        volume: m³.
        centre: of mass, (3,) m.
        moments: (3, 3) of inertia about the centre, of 1 kg: m².
    """

    volume: float
    centre: Array
    moments: Array


FLAT = 1e-10
"""Share of the cube of a mesh's extent; a smaller volume is rounding."""


def mass_properties(body: coal.CollisionGeometry) -> MassProperties:
    """Return the mass properties of a body of coal; the closed pieces of a mesh are filled, except for hollows.

    The winding of a mesh does not matter. The overlap of two pieces counts twice.

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

    A tetrahedron with corners a, b, c relative to that point has V = a · (b × c) / 6, ∫ x dV = V s / 4 with
    s = a + b + c, and ∫ x xᵀ dV = V (a aᵀ + b bᵀ + c cᵀ + s sᵀ) / 20.
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


def primitive_inertia(kind: str, sizes: Sequence[float], mass: float | None = None) -> pin.Inertia:
    """Return the inertia, kg m², of a filled primitive about its own frame.

    Args:
        kind: `box`, `sphere`, `cylinder` or `capsule`.
        sizes: m: three edges; the radius; or the radius and the length, of a capsule without its caps.
        mass: kg; None: that of 1 kg/m³, which is the volume, m³.
    """
    if kind == "box":
        x, y, z = sizes
        return pin.Inertia.FromBox(x * y * z if mass is None else mass, x, y, z)
    radius = sizes[0]
    if kind == "sphere":
        return pin.Inertia.FromSphere(4.0 / 3.0 * np.pi * radius**3 if mass is None else mass, radius)
    length = sizes[1]
    if kind == "cylinder":
        return pin.Inertia.FromCylinder(np.pi * radius**2 * length if mass is None else mass, radius, length)
    volume = np.pi * radius**2 * (length + 4.0 / 3.0 * radius)
    return pin.Inertia.FromCapsule(volume if mass is None else mass, radius, length)
