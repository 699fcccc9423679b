"""A robot in a scene as a MuJoCo model (MJCF): our inertias, our bodies, our pairs of bodies that matter.

Everything comes from the robot as it was loaded: joints and inertias from its pinocchio model, bodies and pairs from
its collision model. So MuJoCo's dynamics, its contacts and its integration are a second opinion on ours, of the same
robot.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence

import coal
import numpy as np
import pinocchio as pin

from optiplan.collision.model import CollisionModel
from optiplan.geometry.convex import pieces_of, soup_of
from optiplan.geometry.scene import Scene
from optiplan.robot.mimic_joints import coupling, screws
from optiplan.robot.robot import Robot
from optiplan.robot.urdf.elements import number_words
from optiplan.simulation.plants.base import NOMINAL, PlantOptions
from optiplan.simulation.plants.mecanum_wheels import MecanumWheels
from optiplan.simulation.plants.mjcf_bodies import inertial_of, pose_of
from optiplan.simulation.plants.mjcf_objects import TaskObjects

SEPARATOR = "#"
"""Stands between the name of a body (link, held object, obstacle) and the number of its geom."""

_REACH = 100.0  # m; half the side of what stands for a half-space in pictures; MuJoCo's planes are endless


def mjcf(
    robot: Robot,
    scene: Scene,
    step: float,
    options: PlantOptions = NOMINAL,
    objects: TaskObjects | None = None,
    wheels: MecanumWheels | None = None,
) -> str:
    """The MJCF text of a robot in a scene.

    A joint of pinocchio is a body with one joint, in the frame of which its inertia and its geoms lie. Geoms touch only
    as the pairs of `CollisionModel` say, listed one by one. A mesh that is not convex is cut into convex pieces, since
    MuJoCo takes the hull of each.

    Args:
        robot: with n joints; its model may have joints that follow others, which become equality constraints.
        scene: obstacles and held objects.
        step: of the integration, s.
        options: friction (`damping` and `frictionloss` of MuJoCo), payload, rotor inertia (`armature`).
        wheels: that carry the base of the robot; None: its joints do.
        objects: obstacles that are free bodies, and the pairs that may meet; None: none, and those of `CollisionModel`.
    """
    root = ET.Element("mujoco", model=robot.name)
    ET.SubElement(root, "compiler", angle="radian", inertiafromgeom="false", balanceinertia="false", boundmass="0")
    option = ET.SubElement(root, "option", timestep=repr(step), gravity=number_words(robot.model.gravity.linear))
    option.set("integrator", "implicitfast")
    ET.SubElement(option, "flag", eulerdamp="disable", autoreset="disable")  # what diverges is to be seen
    assets, world = ET.SubElement(root, "asset"), ET.SubElement(root, "worldbody")
    collision = CollisionModel(robot, scene)
    nodes = _joints(robot, world, options)
    for body in scene.dynamic_obstacles:  # the collision model has joints for each, the last of which carries it
        carrier = ET.SubElement(world, "body", name=f"moving {body.name}", mocap="true")
        nodes += [carrier] * (0 if body.motion is None else body.motion.size)
    parts = _geoms(collision, nodes, assets, {} if objects is None else objects.add_bodies(world))
    contact = ET.SubElement(root, "contact")
    for pair in collision.pairs if objects is None else ():
        for a in parts[pair.a]:
            for b in parts[pair.b]:
                ET.SubElement(contact, "pair", geom1=a, geom2=b, condim="1")
    if wheels is not None:
        option.set("cone", "elliptic")
        wheels.add(world, nodes[robot.model.getJointId(wheels.turning)], contact)
    equality = ET.SubElement(root, "equality")
    _followers(robot, equality)
    if objects is not None:
        objects.meet(option, contact, equality, parts)
    return ET.tostring(root, encoding="unicode")


def _joints(robot: Robot, world: ET.Element, options: PlantOptions) -> list[ET.Element]:
    """One body a joint; element 0 is the world."""
    model, axes, friction, rotor = robot.model, screws(robot.model), options.friction, options.rotor_inertia
    inertias = list(model.inertias)
    if options.mass:
        frame = model.frames[robot.frame_id(robot.tool_frame)]
        point = frame.placement.act(options.centre)
        own = inertias[frame.parentJoint]
        inertias[frame.parentJoint] = own + pin.Inertia(
            options.mass, point, np.zeros((3, 3))
        )  # += would change the robot
    planned = {name: j for j, name in enumerate(robot.joint_names)}
    nodes = [world]
    for j in range(1, model.njoints):
        X, name = model.jointPlacements[j], model.names[j]
        node = ET.SubElement(nodes[model.parents[j]], "body", {"name": f"body {name}", **pose_of(X)})
        turning = bool(np.linalg.norm(axes[j - 1, 3:]) > 0.5)
        joint = ET.SubElement(node, "joint", name=name, type="hinge" if turning else "slide", limited="false")
        joint.set("axis", number_words(axes[j - 1, 3:] if turning else axes[j - 1, :3]))
        k = planned.get(name)
        if k is not None and friction is not None:
            joint.set("damping", repr(float(friction.viscous[k])))
            joint.set("frictionloss", repr(float(friction.coulomb[k])))
            joint.set("solreffriction", "0.001 1")  # stiff: what is held creeps little
        if k is not None and rotor is not None:
            joint.set("armature", repr(float(rotor[k])))
        inertial_of(node, inertias[j])
        nodes.append(node)
    return nodes


def _geoms(
    collision: CollisionModel, nodes: Sequence[ET.Element], assets: ET.Element, free: Mapping[str, ET.Element]
) -> list[list[str]]:
    """Geoms of every body of the collision model, by its index: their names; `free` bodies have frames of their own."""
    found: list[list[str]] = []
    for index, body in enumerate(collision.geometry.geometryObjects):
        names = []
        for part, (kind, attributes, X) in enumerate(_shapes(body.geometry)):
            name = f"{collision.names[index]}{SEPARATOR}{index}.{part}"
            if kind == "mesh":
                ET.SubElement(assets, "mesh", name=name, vertex=attributes["vertex"])
                attributes = {"mesh": name}
            apart = {"contype": "0", "conaffinity": "0"}  # only the listed pairs touch
            own = free.get(collision.names[index])
            told = {"name": name, "type": kind, **attributes, **apart}
            told |= pose_of(body.placement * X if own is None else X)
            ET.SubElement(nodes[body.parentJoint] if own is None else own, "geom", told)
            names.append(name)
        found.append(names)
    return found


def _shapes(shape: coal.CollisionGeometry) -> Iterator[tuple[str, dict[str, str], pin.SE3]]:
    """MuJoCo's kind, attributes and pose of the parts of a body."""
    here = pin.SE3.Identity()
    match shape:
        case coal.Box():
            yield "box", {"size": number_words(shape.halfSide)}, here
        case coal.Sphere():
            yield "sphere", {"size": repr(float(shape.radius))}, here
        case coal.Capsule():
            yield "capsule", {"size": number_words([shape.radius, shape.halfLength])}, here
        case coal.Cylinder():
            yield "cylinder", {"size": number_words([shape.radius, shape.halfLength])}, here
        case coal.Halfspace():
            up = pin.SE3(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), shape.n).matrix(), shape.d * shape.n)
            yield "plane", {"size": number_words([_REACH, _REACH, 1.0])}, up
        case coal.BVHModelBase():
            for vertices in pieces_of(soup_of(shape)).vertices:
                yield "mesh", {"vertex": number_words(vertices.ravel())}, here
        case coal.ConvexBase():
            points = np.array([shape.point(k) for k in range(shape.num_points)])
            yield "mesh", {"vertex": number_words(points.ravel())}, here
        case _:
            raise ValueError(f"no shape of MuJoCo for a {type(shape).__name__}")


def _followers(robot: Robot, equality: ET.Element) -> None:
    """Joints that follow others: q_f = offset + multiplier q_leader, as stiff equality constraints."""
    if not robot.followers:
        return
    A, b = coupling(robot.model)
    for name, mimic in robot.followers.items():
        row = robot.model.getJointId(name) - 1
        k = robot.joint_names.index(mimic.source)
        polynomial = number_words([b[row], A[row, k], 0.0, 0.0, 0.0])
        ET.SubElement(equality, "joint", joint1=name, joint2=mimic.source, polycoef=polynomial, solref="0.001 1")
