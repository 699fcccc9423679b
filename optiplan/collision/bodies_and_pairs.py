"""Bodies of a robot in a scene, and the pairs that must stay apart."""

from collections.abc import Callable, Mapping, Sequence

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Flags, Index
from optiplan.cache import MostRecent
from optiplan.geometry.coal_queries import exact_distance_request
from optiplan.geometry.safety import Safety
from optiplan.geometry.scene import Obstacle, Scene
from optiplan.geometry.shapes import build_geometry
from optiplan.robot.loaded_robots import once_for_each
from optiplan.robot.robot import Robot
from optiplan.robot.self_collision.pair_bounds import LocalBox
from optiplan.robot.self_collision.pair_proof import GAP
from optiplan.robot.self_collision.pairs import PROVED
from optiplan.robot.urdf.srdf import LinkPair

STANDING_OVERLAP = 5e-3
"""Depth, m, to which a link that no joint moves may be sunk into an obstacle that it stands on.

Makers' meshes reach below the mounting plane of the robot, that of the UR5 by 3 mm.
"""


def bodies_of(
    robot: Robot, scene: Scene, carriers: Mapping[str, tuple[int, pin.SE3]]
) -> list[tuple[str, pin.GeometryObject]]:
    """Return links, then attachments, then obstacles, each with its name.

    Args:
        robot: the robot.
        scene: the scene.
        carriers: joints of moving obstacles, and their poses there, by name.
    """
    found = [(robot.link_of(k), body.copy()) for k, body in enumerate(robot.geometry.geometryObjects)]
    for held in scene.attached:
        frame = robot.model.frames[robot.model.getFrameId(held.link)]
        place = (frame.parentJoint, frame.placement * held.X_LO)
        found.append((held.name, _body(f"{held.name}#{len(found)}", *place, build_geometry(held.shape))))
    for obstacle in scene.obstacles:
        place = carriers.get(obstacle.name, (0, obstacle.X_WO))
        found.append((obstacle.name, _body(f"{obstacle.name}#{len(found)}", *place, build_geometry(obstacle.shape))))
    return found


def pairs_of(
    robot: Robot, scene: Scene, names: Sequence[str], parents: Sequence[int]
) -> tuple[list[tuple[int, int]], Index]:
    """Return the pairs that must stay apart, and the pairs (K, 2) of a link and an obstacle that never move.

    Args:
        robot: with the pairs of its links that are checked.
        scene: an attached object may touch its own link and `touch`, a body of a tool the others of that tool; allowed
            pairs may touch.
        names: of all bodies, in the order of `bodies_of`.
        parents: the joint that moves each body; 0: none.
    """
    links = len(robot.geometry.geometryObjects)
    held = range(links, links + len(scene.attached))
    moving = range(links + len(scene.attached))
    obstacles = range(moving.stop, len(names))
    found = [(int(p.first), int(p.second)) for p in robot.geometry.collisionPairs]
    touch = {index: item.touch | {item.link} for index, item in zip(held, scene.attached, strict=True)}
    found += [(a, b) for b in held for a in range(links) if names[a] not in touch[b]]
    found += [(a, b) for b in held for a in held if a < b and names[a] not in touch[b]]
    still = [a for a in moving if parents[a] == 0 and a not in held]
    found += [(a, b) for a in moving if a not in still for b in obstacles]
    excused = {name for pair in scene.allowed for name in pair}

    def allowed(a: int, b: int) -> bool:
        one, other = names[a], names[b]
        return one in excused and other in excused and frozenset((one, other)) in scene.allowed

    kept = [(a, b) for a, b in found if not allowed(a, b)]
    beside = [(a, b) for a in still for b in obstacles if not allowed(a, b)]
    kept += [(a, b) for a, b in beside if parents[b] != 0]
    standing = [(a, b) for a, b in beside if parents[b] == 0]
    return kept, np.array(standing, dtype=np.intp).reshape(-1, 2)


def with_asked_checked(safety: Safety | None, robot: Robot) -> Robot:
    """Return the robot with pairs of links checked that are proved apart, and that are to be farther apart than that.

    They are those that the safety names, and those of two arms. Others are left to their proof: an arm is built so.
    """
    if safety is None:
        return robot
    known = _known_checked(robot)
    required = safety.own, *((tuple(one.of), tuple(one.others), one.at_least) for one in safety.pairs)

    def make() -> Robot | None:
        asked = [pair for pair, why in robot.allowed.items() if why == PROVED and _more_than_proved(safety, pair)]
        return robot.with_proved_checked(asked) if asked else None

    return known.get(repr(required), make) or robot


@once_for_each
def _known_checked(_robot: Robot) -> MostRecent[Robot | None]:
    """Return a robot with more pairs checked, by the distances required: models are kept for the same robot."""
    return MostRecent(8)


def _more_than_proved(safety: Safety, pair: LinkPair) -> bool:
    arms = {link.partition("/")[0] if "/" in link else "" for link in pair}
    named = len(arms) == 2 or any(group.holds(*pair) for group in safety.pairs)
    return named and safety.asked(*pair, False) > GAP


def same_scene(a: Scene, b: Scene) -> bool:
    """Return whether two scenes without attached objects have the same obstacles at the same places."""

    def same(one: Obstacle, other: Obstacle) -> bool:
        return one is other or (_same_standing_body(one, other) and bool(one.X_WO == other.X_WO))

    return _alike(a, b, same)


def only_moved(a: Scene, b: Scene) -> bool:
    """Return whether two scenes have the same static obstacles, perhaps moved, and nothing attached or moving."""
    return _alike(a, b, _same_standing_body)


def _alike(a: Scene, b: Scene, same: Callable[[Obstacle, Obstacle], bool]) -> bool:
    if a.attached or b.attached or a.allowed != b.allowed or len(a.obstacles) != len(b.obstacles):
        return False
    return all(map(same, a.obstacles, b.obstacles))


def _same_standing_body(one: Obstacle, other: Obstacle) -> bool:
    alike = one.name == other.name and one.shape.same_body(other.shape)
    return alike and one.motion is None and other.motion is None


def _body(name: str, joint: int, placement: pin.SE3, geometry: coal.CollisionGeometry) -> pin.GeometryObject:
    return pin.GeometryObject(name, joint, 0, placement, geometry)


def overlapping(geometry: pin.GeometryModel, pairs: Index, boxes: Sequence[LocalBox]) -> list[tuple[int, int]]:
    """Return the pairs of `pairs` (K, 2), static bodies, that overlap by more than `STANDING_OVERLAP`.

    A distance to a mesh gives neither the depth nor whether a body is inside. So a pair with a mesh is returned if the
    boxes overlap, and the verifier checks whether one body contains the other.

    Args:
        geometry: all bodies.
        pairs: (K, 2) bodies that no joint moves.
        boxes: of all bodies.
    """
    if not len(pairs):
        return []
    bodies = list(geometry.geometryObjects)
    low, high = _world_boxes(bodies, boxes)
    a, b = pairs.T
    meets: Flags = ((low[a] <= high[b]) & (low[b] <= high[a])).all(axis=1)
    request, found = exact_distance_request(), []
    for first, second in pairs[meets].tolist():
        one, other = bodies[first], bodies[second]
        mesh = any(isinstance(body.geometry, coal.BVHModelBase) for body in (one, other))
        X_one, X_other = (coal.Transform3s(X.rotation, X.translation) for X in (one.placement, other.placement))
        ends = (one.geometry, X_one, other.geometry, X_other)
        if mesh or coal.distance(*ends, request, coal.DistanceResult()) < -STANDING_OVERLAP:
            found.append((first, second))
    return found


def _world_boxes(bodies: Sequence[pin.GeometryObject], boxes: Sequence[LocalBox]) -> tuple[Array, Array]:
    """Return the low and high corners (G, 3) of static bodies' boxes along the world's axes; inf for half-spaces."""
    centre, half = np.array([box.centre for box in boxes]), np.array([box.half for box in boxes])
    X = np.array([body.placement.homogeneous for body in bodies])
    endless = np.isinf(half).any(axis=1)
    middle = (X[:, :3, :3] @ centre[:, :, None])[..., 0] + X[:, :3, 3]
    reach = (np.abs(X[:, :3, :3]) @ np.where(endless[:, None], 0.0, half)[:, :, None])[..., 0]
    reach[endless] = np.inf
    return middle - reach, middle + reach
