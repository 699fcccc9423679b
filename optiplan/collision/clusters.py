"""Bodies that move as one, many of them: a hull around all answers for all where they are far from something."""

from collections.abc import Callable
from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.convex_hulls import Hull, kept_hull
from optiplan.geometry.meshes.box_surfaces import BOX_CORNERS
from optiplan.robot.loaded_robots import once_for_each_robot
from optiplan.robot.robot import Robot

_MANY = 8
"""Bodies of a joint from which on a hull of all is worth asking first: a gripper of convex pieces has some 80."""

_SEVERAL = 4
"""Bodies of one link from which on, within such a joint, a hull of theirs is asked next."""


@dataclass(frozen=True, eq=False)
class Cluster:
    """Bodies on a joint, by index, and a hull that holds them, in the joint's frame."""

    joint: int
    bodies: tuple[int, ...]
    hull: Hull


@dataclass(frozen=True, eq=False)
class Clusters:
    """Clusters of a robot, each of its bodies in at most one of each kind.

    Attributes:
        by_joint: of all polyhedra that a joint carries.
        by_link: of those of one link, where `by_joint` has them and they are not all that it has.
    """

    by_joint: tuple[Cluster, ...]
    by_link: tuple[Cluster, ...]


@once_for_each_robot
def clusters_of(robot: Robot) -> Clusters:
    """Clusters of the polyhedra that each joint carries, where there are many.

    What no joint moves has none: its pairs are with each body that moves, not with many at once.
    """
    bodies = list(robot.geometry.geometryObjects)
    joints = [int(body.parentJoint) for body in bodies]
    corners = {k: _corners(body) for k, body in enumerate(bodies) if joints[k]}
    polyhedra = [k for k, points in corners.items() if len(points)]

    def cluster(members: list[int]) -> list[Cluster]:
        try:
            hull = kept_hull(np.vstack([corners[k] for k in members]))
        except ValueError:  # they lie in a plane
            return []
        return [Cluster(joints[members[0]], tuple(members), hull)]

    whole = [members for members in _alike(polyhedra, joints.__getitem__) if len(members) >= _MANY]
    parts = [(part, members) for members in whole for part in _alike(members, robot.link_of)]
    return Clusters(
        tuple(found for members in whole for found in cluster(members)),
        tuple(found for part, all_ in parts if _SEVERAL <= len(part) < len(all_) for found in cluster(part)),
    )


def _alike(bodies: list[int], key: Callable[[int], object]) -> list[list[int]]:
    """Bodies of the same key, in lists."""
    found: dict[object, list[int]] = {}
    for body in bodies:
        found.setdefault(key(body), []).append(body)
    return list(found.values())


def _corners(body: pin.GeometryObject) -> Array:
    """Return the corners (k, 3) of a polyhedron in the frame of its joint, m; none of other shapes."""
    match body.geometry:
        case coal.Box():
            points = (2.0 * BOX_CORNERS - 1.0) * np.array(body.geometry.halfSide)
        case coal.ConvexBase():
            points = np.array(body.geometry.points())
        case _:
            return np.empty((0, 3))
    return np.asarray(points @ body.placement.rotation.T + body.placement.translation)
