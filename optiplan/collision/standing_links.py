"""Links that nothing moves: which obstacles do they stand in, rather than on?"""

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Flags, Index

STANDING_OVERLAP = 5e-3
"""Depth, m, to which a link that nothing moves may be sunk into an obstacle that it stands on.

Makers' meshes reach below the plane that the robot is screwed to, that of the UR5 by 3 mm.
"""


def overlapping(geometry: pin.GeometryModel, pairs: Index) -> list[tuple[int, int]]:
    """Return those of pairs (K, 2) of static bodies that overlap by more than `STANDING_OVERLAP`.

    The depth in a mesh is not known, and neither is inside from outside: a pair with a mesh is kept where the two
    touch, and where their boxes overlap, for the verifier to look whether one holds the other.
    """
    if not len(pairs):
        return []
    bodies = list(geometry.geometryObjects)
    low, high = np.array([_world_box(body) for body in bodies]).transpose(1, 0, 2)
    a, b = pairs.T
    meets: Flags = ((low[a] <= high[b]) & (low[b] <= high[a])).all(axis=1)
    request, found = coal.DistanceRequest(), []
    request.gjk_tolerance, request.gjk_max_iterations = 1e-9, 500
    for first, second in pairs[meets].tolist():
        one, other = bodies[first], bodies[second]
        mesh = any(isinstance(body.geometry, coal.BVHModelBase) for body in (one, other))
        ends = (one.geometry, _transform(one.placement), other.geometry, _transform(other.placement))
        if mesh or coal.distance(*ends, request, coal.DistanceResult()) < -STANDING_OVERLAP:
            found.append((first, second))
    return found


def _world_box(body: pin.GeometryObject) -> tuple[Array, Array]:
    """Corners of the box along the world's axes that holds a body which stands still; infinite for a half-space."""
    if isinstance(body.geometry, coal.Halfspace):
        return np.full(3, -np.inf), np.full(3, np.inf)
    body.geometry.computeLocalAABB()
    low, high = np.array(body.geometry.aabb_local.min_), np.array(body.geometry.aabb_local.max_)
    centre, reach = body.placement * (0.5 * (low + high)), np.abs(body.placement.rotation) @ (0.5 * (high - low))
    return centre - reach, centre + reach


def _transform(placement: pin.SE3) -> coal.Transform3s:
    return coal.Transform3s(placement.rotation, placement.translation)
