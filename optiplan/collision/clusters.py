"""Bodies that one joint carries, many of them: a hull of all answers for all where they are far from something."""

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import coal
import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull, QhullError

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.robot.robot import Robot

if TYPE_CHECKING:
    from optiplan._core._core_base import Body

    Cluster = tuple[Body, list[int]]

_MANY = 8
"""Bodies of a joint from which on a hull of all is worth asking first: a gripper of convex pieces has some 80."""

_SLACK = 1e-9
"""m, by which the hull's box is larger than its vertices."""

_kept: "WeakKeyDictionary[Robot, list[Cluster]]" = WeakKeyDictionary()


def clusters_of(robot: Robot) -> "list[Cluster]":
    """Hulls of the polyhedra that each joint carries, where there are many, with the indices of those bodies.

    What no joint moves has none: its pairs are with each body that moves, not with many at once.
    """
    if robot not in _kept:
        bodies = list(robot.geometry.geometryObjects)
        corners = [_corners(body.geometry) for body in bodies]
        joints = np.array([int(body.parentJoint) for body in bodies], dtype=np.intp)
        found = []
        for joint in range(1, robot.model.njoints):
            members = [k for k in np.flatnonzero(joints == joint).tolist() if len(corners[k])]
            if len(members) >= _MANY:
                placed = [_placed(corners[k], bodies[k].placement) for k in members]
                found += [(hull, members) for hull in _hull(joint, np.vstack(placed))]
        _kept[robot] = found
    return _kept[robot]


def _hull(joint: int, points: Array) -> "list[Body]":
    """Return the hull of points (k, 3), m, in the frame of a joint, as one body; none where they lie in a plane."""
    try:
        outer = np.ascontiguousarray(points[ConvexHull(points).vertices])
    except QhullError:
        return []
    low, high = outer.min(axis=0), outer.max(axis=0)
    centre, half = 0.5 * (low + high), 0.5 * (high - low) + _SLACK
    radius = float(np.linalg.norm(outer - centre, axis=1).max()) + _SLACK
    box = np.concatenate([centre, half])
    return [core.Body.of(joint, np.eye(4), [core.Shape.convex_hull(outer)], box, radius)]


def _placed(points: Array, X: pin.SE3) -> Array:
    """Return points (k, 3), m, of a body in the frame in which its pose is X."""
    return np.asarray(points @ X.rotation.T + X.translation)


def _corners(shape: coal.CollisionGeometry) -> Array:
    """Return the corners (k, 3) of a polyhedron, m; none of other shapes."""
    match shape:
        case coal.Box():
            signs = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
            return np.asarray(signs * np.array(shape.halfSide))
        case coal.ConvexBase():
            return np.array(shape.points())
    return np.empty((0, 3))
