"""Links that nothing moves: which obstacles do they stand in, rather than on?"""

from collections.abc import Sequence

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Flags, Index
from optiplan.robot.self_collision.pair_bounds import LocalBox

STANDING_OVERLAP = 5e-3
"""Depth, m, to which a link that nothing moves may be sunk into an obstacle that it stands on.

Makers' meshes reach below the plane that the robot is screwed to, that of the UR5 by 3 mm.
"""


def overlapping(geometry: pin.GeometryModel, pairs: Index, boxes: Sequence[LocalBox]) -> list[tuple[int, int]]:
    """Return those of pairs (K, 2) of static bodies, that overlap by more than `STANDING_OVERLAP`; `boxes` are of all.

    The depth in a mesh is not known, and neither is inside from outside: a pair with a mesh is kept where the two
    touch, and where their boxes overlap, for the verifier to look whether one holds the other.
    """
    if not len(pairs):
        return []
    bodies = list(geometry.geometryObjects)
    low, high = _world_boxes(bodies, boxes)
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


def _world_boxes(bodies: Sequence[pin.GeometryObject], boxes: Sequence[LocalBox]) -> tuple[Array, Array]:
    """Corners, (G, 3) each, of boxes along the world's axes that hold bodies which stand still; inf for half-spaces."""
    centre, half = (np.array([box[k] for box in boxes]) for k in (0, 1))
    X = np.array([body.placement.homogeneous for body in bodies])
    endless = np.isinf(half).any(axis=1)
    middle = (X[:, :3, :3] @ centre[:, :, None])[..., 0] + X[:, :3, 3]
    reach = (np.abs(X[:, :3, :3]) @ np.where(endless[:, None], 0.0, half)[:, :, None])[..., 0]
    reach[endless] = np.inf
    return middle - reach, middle + reach


def _transform(placement: pin.SE3) -> coal.Transform3s:
    return coal.Transform3s(placement.rotation, placement.translation)
