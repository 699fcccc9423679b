"""The one articulation of a stage as a tree: which body carries which, by what joint.

The articulations are the groups of bodies that joints connect. Where prims have the articulation API, those with such a
prim count, else those with a joint that moves. A joint that closes a loop, or is excluded from the articulation, is
left out.
"""

from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any

import pinocchio as pin

from optiplan.importers.robots.usd.joints import FIXED, FREE, SLIDES, TURNS, UsdJoint
from optiplan.importers.robots.usd.shapes import is_body
from optiplan.importers.robots.usd.stage import UsdStage, schemas
from optiplan.records import dataclass

ROOT = "PhysicsArticulationRootAPI"


@dataclass
class Articulation:
    """An articulation.

    Attributes:
        order: paths of bodies, each after the one that carries it.
        carried: by path, the joint and the path of the body that carries it; empty: the world. None: it stands in the
            world where it is drawn.
        notes: what was left out.
    """

    order: list[str] = field(default_factory=list)
    carried: dict[str, tuple[UsdJoint, str] | None] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def rigid_bodies(stage: UsdStage) -> dict[str, Any]:
    """The rigid bodies that are enabled, by path."""
    return {str(prim.GetPath()): prim for prim in stage.prims() if is_body(stage, prim)}


def groups(joints: Sequence[UsdJoint], bodies: Mapping[str, Any]) -> list[set[str]]:
    """Bodies that joints connect, in the order of the stage; the world connects nothing."""
    group = {path: {path} for path in bodies}
    for joint in joints:
        a, b = joint.bodies
        if joint.kind != FREE and a and b and group[a] is not group[b]:
            group[a] |= group[b]
            for path in group[b]:
                group[path] = group[a]
    return list({id(one): one for one in group.values()}.values())


def robots(joints: Sequence[UsdJoint], bodies: Mapping[str, Any]) -> list[set[str]]:
    """The groups with a joint that moves, also against the world."""
    moving = {body for joint in joints if joint.kind not in (FIXED, FREE) for body in joint.bodies if body}
    return [group for group in groups(joints, bodies) if group & moving]


def read_tree(stage: UsdStage, joints: Sequence[UsdJoint], bodies: Mapping[str, pin.SE3]) -> Articulation:
    """Find the articulation.

    Raises:
        InputError: none, several, or a joint in it that a robot cannot have.
    """
    group = _articulation(stage, joints, bodies)
    tree = Articulation()
    own = [joint for joint in joints if set(joint.bodies) & group]
    usable = []
    for joint in own:
        if not joint.in_tree or joint.kind == FREE:
            tree.notes.append(
                f"left out: the joint {joint.path}, {'which holds nothing' if joint.in_tree else 'a loop'}"
            )
        else:
            usable.append(joint)
    grounded = [joint for joint in usable if "" in joint.bodies]
    root = "" if grounded else _root(stage, usable, group)
    if root:
        tree.order.append(root)
        tree.carried[root] = None
        tree.notes.append(f"nothing holds {root}: it is fixed where it is drawn")
    _grow(stage, tree, usable, root)
    return tree


def _articulation(stage: UsdStage, joints: Sequence[UsdJoint], bodies: Mapping[str, pin.SE3]) -> set[str]:
    found = robots(joints, bodies)
    expected = "one articulation: rigid bodies that revolute or prismatic joints connect"
    marked = [str(prim.GetPath()) for prim in stage.prims() if ROOT in schemas(prim)]
    if marked:
        ends = {joint.path: joint.bodies for joint in joints}
        below = [group for group in found if any(_within(body, root) for body in group for root in marked)]
        below += [group for group in found if any(group & set(ends.get(root, ())) for root in marked)]
        found = list({id(group): group for group in below}.values()) or found
    if not found:
        told = f"{len(bodies)} rigid bodies and {len(joints)} joints, none of which moves"
        raise stage.issue(stage.stage.GetPseudoRoot(), told, expected)
    if len(found) > 1:
        listed = "; ".join(min(sorted(group), key=len) for group in found[:5])
        raise stage.issue(stage.stage.GetPseudoRoot(), f"{len(found)} articulations, with {listed}", expected)
    return found[0]


def _within(path: str, root: str) -> bool:
    return path == root or path.startswith(f"{root}/")


def _root(stage: UsdStage, joints: Sequence[UsdJoint], group: set[str]) -> str:
    """The body without a joint to the world that carries the others: marked, else body 1 of none, else the first."""
    ordered = [path for path in rigid_bodies(stage) if path in group]
    marked = [path for path in ordered if ROOT in schemas(stage.stage.GetPrimAtPath(path))]
    led = {joint.bodies[1] for joint in joints}
    return next(iter([*marked, *(path for path in ordered if path not in led), *ordered]))


def _grow(stage: UsdStage, tree: Articulation, joints: Sequence[UsdJoint], root: str) -> None:
    """Breadth first from the root, so that a loop opens far from it."""
    waiting, reached = [root], {root}
    left = list(joints)
    while waiting:
        carrier = waiting.pop(0)
        for joint in [joint for joint in left if carrier in joint.bodies]:
            left.remove(joint)
            body = joint.bodies[1] if joint.bodies[0] == carrier else joint.bodies[0]
            if body in reached:
                tree.notes.append(f"left out: the joint {joint.path}, which closes a loop")
                continue
            if joint.kind not in (FIXED, TURNS, SLIDES):
                expected = "fixed, revolute and prismatic joints, which a robot can have"
                raise stage.issue(joint.prim, f"a joint that is {joint.kind}", expected)
            reached.add(body)
            waiting.append(body)
            tree.order.append(body)
            tree.carried[body] = (joint, carrier)
