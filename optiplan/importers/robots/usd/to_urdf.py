"""A robot of a USD stage as a URDF: bodies, joints, masses, colliders and what is drawn.

A joint of USD has a frame in either body, one of a URDF only in the body that carries it. So a link without a body
stands between where the frame in the carried body is not that body's own.
"""

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.config.messages import some
from optiplan.importers.robots.description import Description
from optiplan.importers.robots.urdf_tree import FAR, WORLD, MeshFiles, UrdfTree, add_shape, moved, torques_without
from optiplan.importers.robots.usd.joints import SLIDES, TURNS, UsdJoint, read_joints
from optiplan.importers.robots.usd.masses import body_inertia
from optiplan.importers.robots.usd.shapes import NOT_READ, UsdShape, gprims, shape_of
from optiplan.importers.robots.usd.stage import UsdStage, opened_stage, schemas
from optiplan.importers.robots.usd.tree import Articulation, read_tree, rigid_bodies
from optiplan.robot.urdf.elements import inertial_element, number_words
from optiplan.robot.urdf.srdf import LinkPair, link_pair

DRAWN = "drawn"
"""The configuration in which the stage shows the robot."""

HOLDERS = ("visuals", "collisions", "visual", "collision")
"""Names of the Xforms that exporters put shapes into: empty ones are no frames."""

OFF = 1e-3
"""m and rad; bodies that are drawn further from where their joint lets them be are remarked on."""


def describe_usd(path: Path) -> Description:
    """Read the robot of a USD stage.

    Raises:
        InputError: no USD, no articulation or several, or a prim of it that cannot be used.
        OptiPlanError: the package `usd-core` is not installed.
    """
    with opened_stage(path) as stage:
        writer = _UsdWriter(stage)
        writer.write()
        allowed = writer.filtered()
    return Description(
        source=path,
        name=str(writer.urdf.root.get("name")),
        text=writer.urdf.text(),
        files=writer.meshes.files,
        limits={"velocity": writer.rates} if writer.rates else {},
        states={DRAWN: writer.drawn} if any(writer.drawn.values()) else {},
        rest=writer.drawn,
        allowed=allowed,
        notes=tuple(dict.fromkeys(writer.notes)),
    )


class _UsdWriter:
    """The URDF of one stage."""

    def __init__(self, stage: UsdStage) -> None:
        self.stage = stage
        self.bodies = rigid_bodies(stage)
        self.places = {path: stage.placed(prim).pose() for path, prim in self.bodies.items()}
        joints = read_joints(stage, self.places)
        self.tree: Articulation = read_tree(stage, joints, self.places)
        self.notes = list(self.tree.notes)
        self.meshes = MeshFiles()
        self.drawn: dict[str, float] = {}
        self.rates: dict[str, float] = {}
        default = stage.stage.GetDefaultPrim()
        carried = [(*pair, path) for path, pair in self.tree.carried.items() if pair is not None]
        self.joints = {joint.path: joint for joint, _, _ in carried}
        self.positions = {joint.path: self._position(joint, carrier, path) for joint, carrier, path in carried}
        named = _names([WORLD, *self.joints, *self.tree.order])
        self.names = {**named, "": WORLD}
        self.urdf = UrdfTree(default.GetName() if default else stage.path.stem, named.values())
        self._held = self._without_drive()
        strangers = [path for path in self.bodies if path not in self.tree.carried]
        if strangers:
            self.notes.append(f"left out: bodies that do not belong to it: {some(strangers, 6)}")
        still = [str(prim.GetPath()) for prim, solid in gprims(stage, stage.stage.GetPseudoRoot()) if solid]
        if still:
            self.notes.append(f"left out: colliders without a body, which belong into the scene: {some(still, 6)}")

    def _without_drive(self) -> set[str]:
        """Paths of the joints that stand still: without a drive, where another joint has one."""
        moving = [joint for joint in self.joints.values() if joint.moves]
        followers = {joint.path for joint in moving if joint.mimic is not None and joint.mimic[0] in self.joints}
        if not any(joint.driven for joint in moving):
            return set()
        held = {joint.path for joint in moving if not joint.driven and joint.path not in followers}
        if held:
            self.notes.append(f"held where they are drawn, since no drive moves them: {some(sorted(held), 6)}")
        return held

    def write(self) -> None:
        """Add all bodies with their joints."""
        self.urdf.link(WORLD)
        for path in self.tree.order:
            self._carry(path)
            self._link(path)
        moving = [joint for joint in self.joints.values() if self.names[joint.path] in self.drawn]
        stated = {"inertia of rotors (armature)": "armature", "friction (jointFriction)": "jointFriction"}
        self.notes += torques_without(
            {
                kind: [j.path for j in moving if self.stage.number(j.prim, f"physxJoint:{name}", 0.0) > 0.0]
                for kind, name in stated.items()
            }
        )

    def _carry(self, path: str) -> None:
        """The joint before a body."""
        link, carried = self.names[path], self.tree.carried[path]
        if carried is None:
            self.urdf.joint(self.urdf.free(f"{link}_fixed"), "fixed", (WORLD, link), self.places[path])
            return
        joint, carrier = carried
        X_PF, X_CF, axis = _frames(joint, path)
        parent, name = self.names[carrier], self.names[joint.path]
        still = self._still_at(joint.path)
        if still is not None:
            X_FF = moved(joint.kind == TURNS, axis, still) if joint.moves else pin.SE3.Identity()
            self.urdf.joint(name, "fixed", (parent, link), X_PF * X_FF * X_CF.inverse())
            return
        own = X_CF.isIdentity(1e-12)
        child = link if own else self.urdf.free(f"{name}_frame")
        self._moving(joint, (parent, child), X_PF, axis)
        self.drawn[name] = self.positions[joint.path]
        if not own:
            self.urdf.link(child)
            self.urdf.joint(self.urdf.free(f"{link}_fixed"), "fixed", (child, link), X_CF.inverse())

    def _still_at(self, name: str, followers: tuple[str, ...] = ()) -> float | None:
        """The position at which a joint stands still, itself or with the joint that it follows; None: it moves."""
        joint = self.joints[name]
        if not joint.moves:
            return joint.lower if joint.lower == joint.upper else 0.0
        if name in self._held:
            return self.positions[name]
        if joint.mimic is None or joint.mimic[0] not in self.joints or name in followers:
            return None
        leader, factor, offset = joint.mimic
        value = self._still_at(leader, (*followers, name))
        if value is None:
            return None
        self.notes.append(f"{name} stands still with {leader}, which it follows")
        return factor * value + offset

    def _position(self, joint: UsdJoint, carrier: str, path: str) -> float:
        """The position at which the stage shows a joint, rad or m; a remark where its bodies are not where it says."""
        X_PF, X_CF, axis = _frames(joint, path)
        X_WP = self.places[carrier] if carrier else pin.SE3.Identity()
        X = (X_WP * X_PF).actInv(self.places[path] * X_CF)
        motion = pin.log6(X)
        q = 0.0
        if joint.kind == TURNS:
            q = float(axis @ pin.log3(X.rotation))
        elif joint.kind == SLIDES:
            q = float(axis @ X.translation)
        off = pin.log6(moved(joint.kind == TURNS, axis, q).actInv(X)) if joint.moves else motion
        if max(np.linalg.norm(off.linear), np.linalg.norm(off.angular)) > OFF:
            self.notes.append(f"{path} is not drawn where the joint {joint.path} puts it: the joint counts")
        inside = float(np.clip(q, joint.lower, joint.upper)) if joint.moves else q
        if abs(inside - q) > OFF:
            self.notes.append(f"{joint.path} is drawn beyond its limits: it is taken as at {inside:g}")
        q = inside
        return 0.0 if abs(q) < 1e-9 else q

    def _moving(self, joint: UsdJoint, links: tuple[str, str], X_PF: pin.SE3, axis: Array) -> None:
        name, turns = self.names[joint.path], joint.kind == TURNS
        endless = np.isinf(joint.lower) and np.isinf(joint.upper)
        kind = ("continuous" if endless else "revolute") if turns else "prismatic"
        element = self.urdf.joint(name, kind, links, X_PF)
        ET.SubElement(element, "axis", xyz=number_words(axis))
        effort = joint.effort if np.isfinite(joint.effort) else 0.0
        limit = ET.SubElement(element, "limit", effort=repr(effort), velocity="0")
        if kind != "continuous":
            far = 2.0 * np.pi if turns else FAR
            lower, upper = (
                float(np.copysign(far, end)) if np.isinf(end) else end for end in (joint.lower, joint.upper)
            )
            limit.set("lower", repr(lower))
            limit.set("upper", repr(upper))
            if (lower, upper) != (joint.lower, joint.upper):
                self.notes.append(f"{joint.path} has no limit at an end: {lower:g} to {upper:g} is taken")
        if np.isfinite(joint.velocity):
            self.rates[name] = joint.velocity
        if joint.mimic is not None and joint.mimic[0] in self.joints:
            leader, factor, offset = joint.mimic
            ET.SubElement(element, "mimic", joint=self.names[leader], multiplier=repr(factor), offset=repr(offset))
        elif joint.mimic is not None:
            self.notes.append(f"left out: {joint.path} follows {joint.mimic[0]}, which is no joint of the robot")

    def _link(self, path: str) -> None:
        """One body: its inertia, its colliders, what is drawn, and empty prims below it as frames."""
        stage, prim, link = self.stage, self.bodies[path], self.names[path]
        element = self.urdf.link(link)
        solids = []
        for shape_prim, collides in gprims(stage, prim):
            if not collides and not stage.drawn(shape_prim):
                continue
            shape = shape_of(stage, shape_prim, self.places[path], collides)
            if shape is None or shape.kind == "plane":
                self._cannot(shape_prim, collides)
                continue
            if stage.drawn(shape_prim):
                add_shape(
                    element, "visual", shape.X, self._shape(shape_prim, shape, collides), _colour(stage, shape_prim)
                )
            if collides:
                add_shape(element, "collision", shape.X, self._shape(shape_prim, shape, collides))
                solids.append((shape_prim, shape))
        inertia = body_inertia(stage, prim, self.places[path], solids)
        if inertia is not None and inertia.mass > 0.0:
            inertial_element(element, inertia)
        else:
            self.notes.append(f"{path} has neither a mass nor a collider: it weighs nothing")
        for frame in _empty_frames(stage, prim):
            X_LF = self.places[path].actInv(stage.placed(frame).pose())
            name = self.urdf.free(frame.GetName())
            self.urdf.link(name)
            self.urdf.joint(self.urdf.free(f"{name}_fixed"), "fixed", (link, name), X_LF)

    def _cannot(self, prim: Any, collides: bool) -> None:
        """Say that a shape is left out.

        Raises:
            InputError: one that touches.
        """
        kind = str(prim.GetTypeName())
        if collides and kind in NOT_READ:
            expected = "a Cube, Sphere, Cylinder, Capsule, Cone or Mesh"
            raise self.stage.issue(prim, f"a collider of type {kind}", expected)
        self.notes.append(f"left out: {prim.GetPath()}, a {kind}, which a robot cannot have")

    def _shape(self, prim: Any, shape: UsdShape, collides: bool) -> ET.Element:
        if shape.kind == "box":
            return ET.Element("box", size=number_words(shape.sizes))
        if shape.kind == "sphere":
            return ET.Element("sphere", radius=repr(shape.sizes[0]))
        if shape.kind in ("cylinder", "capsule"):
            return ET.Element(shape.kind, radius=repr(shape.sizes[0]), length=repr(shape.sizes[1]))
        return self.meshes.element((str(prim.GetPath()), collides), prim.GetName(), shape.vertices, shape.triangles)

    def filtered(self) -> tuple[LinkPair, ...]:
        """Pairs of links that `physics:filteredPairs` names; those of colliders and of other things are remarked on."""
        pairs = set()
        for prim in (prim for prim in self.stage.prims() if "PhysicsFilteredPairsAPI" in schemas(prim)):
            for other in self.stage.targets(prim, "physics:filteredPairs"):
                ends = [str(one.GetPath()) for one in (prim, other)]
                if all(end in self.tree.carried for end in ends):
                    pairs.add(link_pair(self.names[ends[0]], self.names[ends[1]]))
                elif any(end.startswith(f"{path}/") for end in ends for path in self.tree.carried):
                    self.notes.append(f"not believed: the filtered pair of {ends[0]} and {ends[1]}, no whole bodies")
        if any(str(prim.GetTypeName()) == "PhysicsCollisionGroup" for prim in self.stage.prims()):
            self.notes.append("not believed: collision groups; all pairs of links are checked as OptiPlan chooses them")
        return tuple(sorted(pairs))


def _frames(joint: UsdJoint, path: str) -> tuple[pin.SE3, pin.SE3, Array]:
    """The frames of a joint in the body that carries and in the body `path` that is carried, and the axis."""
    forward = joint.bodies[1] == path
    return (*(joint.frames if forward else joint.frames[::-1]), joint.axis if forward else -joint.axis)


def _empty_frames(stage: UsdStage, body: Any) -> list[Any]:
    """The Xforms without children right below a body, which name a place on it; not those that wait for shapes."""
    children = [
        child
        for child in body.GetFilteredChildren(stage.usd.TraverseInstanceProxies())
        if child.GetTypeName() == "Xform"
    ]
    bare = [child for child in children if not child.GetAllChildren() and not schemas(child)]
    named = [child for child in bare if child.GetName() not in HOLDERS]
    return [child for child in named if not child.IsInstance() and not child.HasAuthoredReferences()]


def _colour(stage: UsdStage, prim: Any) -> Array | None:
    """The one colour that a shape is drawn in, with opacity 1; None where it states none or several."""
    colours = stage.value(prim, "primvars:displayColor")
    if colours is None or len(colours) != 1:
        return None
    return np.append(np.clip(np.array(colours[0], float), 0.0, 1.0), 1.0)


def _names(paths: Sequence[str]) -> dict[str, str]:
    """The last part of each path, and more of it where two have the same."""
    names: dict[str, str] = {}
    for path in paths:
        parts = [part for part in path.split("/") if part]
        short = ("_".join(parts[-k:]) for k in range(1, len(parts) + 1))
        taken = {*names.values(), "universe"}
        names[path] = next((name for name in short if name not in taken), "_".join([*parts, ""]))
    return names
