"""Hulls of the meshes of a scene: a bound of their distances that costs a twentieth of asking the meshes."""

import warnings
from collections import OrderedDict

import coal
import numpy as np
import pinocchio as pin

from optiplan.cache import digest
from optiplan.geometry.convex_hulls import convex_hull, thickened_hull

_KEPT = 256
"""Hulls kept in memory."""

SETTLED = 0.01
"""m; bodies whose hulls are farther apart are asked no nearer: the hulls' distance, a lower bound, stands for theirs.

Twice the clearance that planners aim at, so that what they keep away from is the mesh.
"""

_hulls: "OrderedDict[str, coal.ConvexBase]" = OrderedDict()


def hull_of_mesh(mesh: coal.BVHModelBase) -> coal.ConvexBase:
    """Hull of a mesh; made once for each content."""
    vertices = np.array(mesh.vertices(), dtype=np.float64).reshape(-1, 3)
    key = digest([vertices.tobytes()])
    if key not in _hulls:
        try:
            _hulls[key] = convex_hull(vertices)
        except ValueError:  # flat
            _hulls[key] = thickened_hull(vertices).build()
        if len(_hulls) > _KEPT:
            _hulls.popitem(last=False)
    return _hulls[key]


def is_flat(shape: coal.CollisionGeometry) -> bool:
    """Whether this is a mesh that lies in a plane, or within a millionth of its extent of one."""
    if not isinstance(shape, coal.BVHModelBase):
        return False
    vertices = np.array(shape.vertices(), dtype=np.float64).reshape(-1, 3)
    spread = np.linalg.eigvalsh(np.cov(vertices.T))
    return bool(spread[0] <= 1e-12 * spread[-1])


def exact_queries(data: pin.GeometryData) -> None:
    """Make queries start afresh and converge.

    Guesses kept from call to call make a result depend on what was asked before, and at coal's tolerance of 1e-6
    distances to cylinders come out up to 0.17 mm too large.
    """
    _make_exact(*data.distanceRequests, *data.collisionRequests)


def exact_requests() -> tuple[coal.DistanceRequest, coal.CollisionRequest]:
    """Requests of the same kind, for asking coal itself; that of contacts wants no points."""
    distance, collision = coal.DistanceRequest(), coal.CollisionRequest(coal.CollisionRequestFlag.NO_REQUEST, 1)
    _make_exact(distance, collision)
    return distance, collision


def _make_exact(*requests: coal.QueryRequest) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # the old switch is the one that pinocchio turns on
        for request in requests:
            request.enable_cached_gjk_guess = False
            request.gjk_tolerance = 1e-9
            request.gjk_max_iterations = 500
