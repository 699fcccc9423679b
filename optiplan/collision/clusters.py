"""Clusters of bodies that move together: the hull around a cluster bounds the distances of all its bodies."""

from collections.abc import Callable
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.convex_hulls import Hull, kept_hull
from optiplan.geometry.meshes.box_surfaces import box_corners
from optiplan.robot.loaded_robots import once_for_each_robot
from optiplan.robot.robot import Robot

_MANY = 8
"""Least number of bodies of a joint for a cluster: a gripper of convex pieces has some 80."""

_SEVERAL = 4
"""Least number of bodies of one link for a cluster within such a joint."""


class Cluster(NamedTuple):
    """Bodies on a joint, by index, and a hull that contains them, in the joint's frame."""

    joint: int
    bodies: tuple[int, ...]
    hull: Hull


class Clusters(NamedTuple):
    """Clusters of a robot, each of its bodies in at most one of each kind.

    Attributes:
        by_joint: all polyhedra that a joint carries.
        by_link: all polyhedra of one link, a proper part of a cluster in `by_joint`.
    """

    by_joint: tuple[Cluster, ...]
    by_link: tuple[Cluster, ...]


@once_for_each_robot
def clusters_of(robot: Robot) -> Clusters:
    """Return the clusters of the polyhedra that each joint carries, where there are many.

    Static bodies have none: each of their pairs has a single moving body.
    """
    bodies = list(robot.geometry.geometryObjects)
    joints = [int(body.parentJoint) for body in bodies]
    corners = {k: _corners(body) for k, body in enumerate(bodies) if joints[k]}
    polyhedra = [k for k, points in corners.items() if len(points)]

    def cluster(members: list[int]) -> list[Cluster]:
        try:
            hull = kept_hull(np.vstack([corners[k] for k in members]))
        except ValueError:  # plane bodies
            return []
        return [Cluster(joints[members[0]], tuple(members), hull)]

    whole = [members for members in _alike(polyhedra, joints.__getitem__) if len(members) >= _MANY]
    parts = [(part, members) for members in whole for part in _alike(members, robot.link_of)]
    return Clusters(
        tuple(found for members in whole for found in cluster(members)),
        tuple(found for part, all_ in parts if _SEVERAL <= len(part) < len(all_) for found in cluster(part)),
    )


def _alike(bodies: list[int], key: Callable[[int], object]) -> list[list[int]]:
    found: dict[object, list[int]] = {}
    for body in bodies:
        found.setdefault(key(body), []).append(body)
    return list(found.values())


def _corners(body: pin.GeometryObject) -> Array:
    """Return the corners (k, 3) of a polyhedron in the frame of its joint, m; none of other shapes."""
    match body.geometry:
        case coal.Box():
            points = box_corners(np.array(body.geometry.halfSide))
        case coal.ConvexBase():
            points = np.array(body.geometry.points())
        case _:
            return np.empty((0, 3))
    return np.asarray(points @ body.placement.rotation.T + body.placement.translation)
