"""Which bodies a robot in a scene has, and which pairs of them must stay apart."""

from collections.abc import Mapping, Sequence

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Index
from optiplan.geometry.scene import Obstacle, Scene
from optiplan.geometry.shapes import build_geometry
from optiplan.robot.robot import Robot


def bodies_of(robot: Robot, scene: Scene, carriers: Mapping[str, int]) -> list[tuple[str, pin.GeometryObject]]:
    """Return links, then attachments, then obstacles, each with its name.

    Args:
        robot: the robot.
        scene: the scene.
        carriers: the joints of obstacles that move, by name.
    """
    found = [(robot.link_of(k), body.copy()) for k, body in enumerate(robot.geometry.geometryObjects)]
    for held in scene.attached:
        frame = robot.model.frames[robot.model.getFrameId(held.link)]
        place = (frame.parentJoint, frame.placement * held.X_LO)
        found.append((held.name, _body(f"{held.name}#{len(found)}", *place, build_geometry(held.shape))))
    for obstacle in scene.obstacles:
        place = (carriers.get(obstacle.name, 0), obstacle.X_WO)
        found.append((obstacle.name, _body(f"{obstacle.name}#{len(found)}", *place, build_geometry(obstacle.shape))))
    return found


def pairs_of(
    robot: Robot, scene: Scene, names: Sequence[str], parents: Sequence[int]
) -> tuple[list[tuple[int, int]], Index]:
    """Return the pairs that must stay apart, and those of a link and an obstacle, (K, 2), that nothing moves.

    Args:
        robot: which says what pairs of its links are checked.
        scene: of which attachments may touch what they are held by, and bodies what is allowed.
        names: of all bodies, in the order of `bodies_of`.
        parents: the joint that moves each; 0: none.
    """
    links = len(robot.geometry.geometryObjects)
    held = range(links, links + len(scene.attached))
    moving = range(links + len(scene.attached))
    obstacles = range(moving.stop, len(names))
    found = [(int(p.first), int(p.second)) for p in robot.geometry.collisionPairs]
    touch = {index: item.touch | {item.link} for index, item in zip(held, scene.attached, strict=True)}
    found += [(a, b) for b in held for a in range(links) if names[a] not in touch[b]]
    found += [(a, b) for b in held for a in held if a < b]
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


def only_moved(a: Scene, b: Scene) -> bool:
    """Whether two scenes hold the same obstacles, perhaps at other places, and nothing that is attached or moves."""
    if a.attached or b.attached or a.allowed != b.allowed or len(a.obstacles) != len(b.obstacles):
        return False
    return all(same_standing_body(one, other) for one, other in zip(a.obstacles, b.obstacles, strict=True))


def same_standing_body(one: Obstacle, other: Obstacle) -> bool:
    """Whether two obstacles are the same body, perhaps at other places, and none of them moves."""
    alike = one.name == other.name and one.shape.same_body(other.shape)
    return alike and one.motion is None and other.motion is None


def _body(name: str, joint: int, placement: pin.SE3, geometry: coal.CollisionGeometry) -> pin.GeometryObject:
    return pin.GeometryObject(name, joint, 0, placement, geometry)
