"""Queries of coal that converge and do not depend on earlier queries; importing this module primes coal."""

import warnings

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Index

DISTANCE_ERROR = 1e-6
"""m; GJK and EPA stop at this error (coal's default tolerance), so a distance is known up to it."""

_GJK_TOLERANCE = 1e-9
"""m; at coal's default of 1e-6 m distances to cylinders come out up to 0.17 mm too large."""

_GJK_ITERATIONS = 500


def coal_mesh(vertices: Array, triangles: Index | None = None) -> coal.BVHModelOBBRSS:
    """Return the bounding-volume hierarchy of triangles (m, 3), indices of vertices (k, 3), m; None: each three."""
    if triangles is None:
        triangles = np.arange(len(vertices)).reshape(-1, 3)
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(triangles), len(vertices))
    mesh.addVertices(vertices)
    mesh.addTriangles(triangles)
    mesh.endModel()
    return mesh


def exact_distance_request() -> coal.DistanceRequest:
    """Return a request for a distance that starts afresh and converges."""
    request = coal.DistanceRequest()
    _make_exact(request)
    return request


def exact_collision_request() -> coal.CollisionRequest:
    """Return a request for a contact test without contact points that starts afresh and converges."""
    request = coal.CollisionRequest(coal.CollisionRequestFlag.NO_REQUEST, 1)
    _make_exact(request)
    return request


def make_exact(data: pin.GeometryData) -> None:
    """Make the queries of pinocchio start afresh and converge.

    An initial guess kept from an earlier call makes the result depend on that call.
    """
    _make_exact(*data.distanceRequests, *data.collisionRequests)


def _make_exact(*requests: coal.QueryRequest) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # pinocchio turns on the deprecated switch
        for request in requests:
            request.enable_cached_gjk_guess = False
            request.gjk_tolerance, request.gjk_max_iterations = _GJK_TOLERANCE, _GJK_ITERATIONS


def _prime_box_support() -> None:
    """Query the support of a rotated box, once for each instance of coal's template.

    coal 3.0.3 keeps in `getShapeSupport(const Box*, ...)` a function-local

        static const inflate = (dir.array() == 0).any() ? 1 + 1e-10 : 1

    The first query of any box in the process thus decides whether all boxes are larger by that factor on their negative
    sides. GJK begins along an axis of the first shape, so most processes decide for 1 + 1e-10. A turned box as the
    first shape and a ball as the second make it so in every process. One instance of the template adds the radius of a
    swept sphere, the other does not, and each has its own constant.
    """
    turned = coal.Transform3s(pin.rpy.rpyToMatrix(0.3, 0.5, 0.7), np.array([3.0, 1.0, 0.5]))
    box, ball = coal.Box(1.0, 1.0, 1.0), coal.Sphere(0.5)
    for swept in (False, True):
        difference = coal.MinkowskiDiff()
        difference.set(box, ball, turned, coal.Transform3s(), swept)
        coal.GJK(100, DISTANCE_ERROR).evaluate(difference, np.array([1.0, 0.0, 0.0]), np.zeros(2, dtype=np.int32))


_prime_box_support()
