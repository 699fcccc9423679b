"""MoveIt's collision objects, frames and allowed pairs, as YAML data, into the bodies of a problem file."""

import math
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.poses import pose_to_data
from optiplan.importers.robots.polyhedra import obj_text
from optiplan.problem.schema.scene import WORLD
from optiplan.robot.frames import link_names
from optiplan.robot.robot import Robot

Data = Mapping[str, Any]


class CannotConvert(ValueError):
    """The reason why a scene or request has no counterpart as a problem file."""


def numbers(value: Any, keys: str) -> Array:
    """A vector written as a list or as a mapping with one-letter keys."""
    return np.array([value[key] for key in keys] if isinstance(value, Mapping) else value, float)


def pose(data: Data | None) -> pin.SE3:
    """A `geometry_msgs/Pose` or `Transform`: lists or mappings, quaternion x, y, z, w; what is left out is identity."""
    data = data or {}
    translation = data.get("position", data.get("translation")) or [0, 0, 0]
    rotation = numbers(data.get("orientation", data.get("rotation")) or [0, 0, 0, 1], "xyzw")
    length = _length(rotation)
    if length == 0.0:  # a message whose orientation was never filled in
        rotation, length = np.array([0.0, 0.0, 0.0, 1.0]), 1.0
    return pin.SE3(pin.Quaternion(rotation / length).toRotationMatrix(), numbers(translation, "xyz"))


def _length(quaternion: Array) -> float:
    """Return |q| of (4,), with one rounding a square, as fused multiply-adds have.

    The bits of NumPy's norm depend on the processor, and those of a pose are part of the problem's hash.
    """
    square = 0.0
    for x in quaternion:
        square = float(Fraction(float(x)) ** 2 + Fraction(square)) if math.isfinite(x) else math.nan
    return math.sqrt(square)


def joint_state(state: Data | None) -> dict[str, float]:
    """Values of the joints in a `moveit_msgs/RobotState`, rad or m.

    Raises:
        CannotConvert: not as many values as names.
    """
    joints = (state or {}).get("joint_state") or {}
    names, values = joints.get("name") or [], joints.get("position") or []
    if len(names) != len(values):
        raise CannotConvert(f"a joint state has {len(names)} names and {len(values)} values")
    return {str(name): float(value) for name, value in zip(names, values, strict=True)}


class Frames:
    """Poses of named frames in the robot's base frame W, the world of the problem file.

    MoveIt's model frame M is another where the `virtual_joint` of a robot state moves the base: X_MW is its transform.
    """

    def __init__(self, robot: Robot, start: Array, scene: Data, request: Data) -> None:
        X_MW = pin.SE3.Identity()
        for state in (scene.get("robot_state"), request.get("start_state")):
            for transform in ((state or {}).get("multi_dof_joint_state") or {}).get("transforms") or []:
                X_MW = pose(transform)
        self._X_WM = X_MW.inverse()
        self._named = {"": self._X_WM}
        data = robot.model.createData()
        pin.framesForwardKinematics(robot.model, data, start)
        for frame, X_WF in zip(robot.model.frames, data.oMf, strict=True):
            if frame.name != "universe":
                self._named[frame.name] = X_WF.copy()
        self._add_fixed(list(scene.get("fixed_frame_transforms") or []))

    def _add_fixed(self, transforms: list[Data]) -> None:
        """Resolve transforms in whatever order they are listed; frames of the robot are where it has them."""
        if not any(_child(item) == WORLD for item in transforms):
            self.add(WORLD, self._X_WM)
        while transforms := [item for item in transforms if _child(item) not in self._named]:
            ready = [item for item in transforms if _parent(item) in self._named]
            for item in ready or transforms:  # without any, the first one's parent is reported as unknown
                self.add(_child(item), self.named(_parent(item)) * pose(item["transform"]))

    def pose(self, header: Data | None) -> pin.SE3:
        """Pose of the frame named by a message header."""
        return self.named(str((header or {}).get("frame_id") or ""))

    def named(self, frame: str) -> pin.SE3:
        """Pose of a frame in the world.

        Raises:
            CannotConvert: there is none of that name.
        """
        name = frame.removeprefix("/")
        if name not in self._named:
            raise CannotConvert(f"unknown frame '{frame}'")
        return self._named[name]

    def add(self, name: str, X_WO: pin.SE3) -> None:
        """Objects are frames too."""
        self._named.setdefault(name, X_WO)


def _child(transform: Data) -> str:
    """Name of the frame that a `geometry_msgs/TransformStamped` places."""
    return str(transform["child_frame_id"]).removeprefix("/")


def _parent(transform: Data) -> str:
    """Name of the frame that it is placed in."""
    return str((transform.get("header") or {}).get("frame_id") or "").removeprefix("/")


class SceneConverter:
    """The obstacles and attached objects of one scene, in the form of a problem file."""

    def __init__(self, robot: Robot, frames: Frames, prefix: str) -> None:
        self.robot, self.frames, self.prefix = robot, frames, prefix
        self.links = link_names(robot.model)
        self.obstacles: list[dict[str, Any]] = []
        self.attached: list[dict[str, Any]] = []
        self.meshes: dict[str, str] = {}
        self.notes: list[str] = []
        self._parts: dict[str, list[str]] = {}

    def add_world(self, scene: Data) -> None:
        """Every collision object of the scene but those that are attached: taking an object takes it from the world."""
        held = set(self._parts)
        for item in (scene.get("world") or {}).get("collision_objects") or []:
            if str(item["id"]) in held:
                continue
            X_WO = self.frames.pose(item.get("header")) * pose(item.get("pose"))
            self.frames.add(str(item["id"]), X_WO)
            self.obstacles += self._bodies(item, X_WO)

    def add_attached(self, state: Data | None) -> None:
        """Every object that a robot state holds, unless it is attached already.

        Raises:
            CannotConvert: its link is none of the robot's, or its frame is unknown.
        """
        for item in (state or {}).get("attached_collision_objects") or []:
            held, link = item["object"], str(item["link_name"])
            if str(held["id"]) in self._parts:
                continue
            if link not in self.links:
                raise CannotConvert(f"object '{held['id']}' is attached to link {link}, which the robot does not have")
            header = held.get("header") or {}
            X_LF = pin.SE3.Identity()
            if header.get("frame_id") not in (None, "", link):
                X_LF = self.frames.named(link).actInv(self.frames.pose(header))
            if float(item.get("weight") or 0.0) > 0.0:
                self.notes.append(f"left out the weight of '{held['id']}', {float(item['weight']):g}: give it a `mass`")
            touch = [str(name) for name in item.get("touch_links") or [] if name in self.links]
            for body in self._bodies(held, X_LF * pose(held.get("pose"))):
                self.attached.append({**body, "link": link, "touch": touch})

    def _bodies(self, item: Data, X_FO: pin.SE3) -> list[dict[str, Any]]:
        """One body for each shape of an object whose pose is X_FO."""
        shapes = list(self._shapes(item, X_FO))
        if not shapes:
            raise CannotConvert(f"object '{item['id']}' has no shape")
        names = [self._name(str(item["id"]), i) for i in range(len(shapes))]
        self._parts[str(item["id"])] = names
        return [
            {"name": name, "shape": shape, "pose": pose_to_data(X_FS)}
            for name, (shape, X_FS) in zip(names, shapes, strict=True)
        ]

    def _shapes(self, item: Data, X_FO: pin.SE3) -> Iterator[tuple[dict[str, Any], pin.SE3]]:
        """The shapes of an object and their poses; MoveIt gives each shape a pose in the object."""
        kinds = (
            ("primitives", "primitive_poses", self._primitive),
            ("meshes", "mesh_poses", self._mesh),
            ("planes", "plane_poses", self._plane),
        )
        for key, key_of_poses, build in kinds:
            shapes, poses = item.get(key) or [], item.get(key_of_poses) or []
            if poses and len(poses) != len(shapes):
                raise CannotConvert(f"object '{item['id']}' has {len(shapes)} {key} and {len(poses)} {key_of_poses}")
            for shape, placement in zip(shapes, poses or [None] * len(shapes), strict=True):
                X_FS = X_FO * pose(placement)
                yield build(item, shape, X_FS), X_FS

    def _primitive(self, item: Data, shape: Data, X_FS: pin.SE3) -> dict[str, Any]:
        kind = {"1": "box", "2": "sphere", "3": "cylinder", "4": "cone"}.get(str(shape["type"]), str(shape["type"]))
        size = [float(x) for x in shape["dimensions"]]
        if kind == "box" and len(size) == 3:
            return {"box": size}
        if kind == "sphere" and len(size) == 1:
            return {"sphere": size[0]}
        if kind == "cylinder" and len(size) == 2:
            return {"cylinder": {"radius": size[1], "length": size[0]}}  # MoveIt's order: height, radius
        raise CannotConvert(f"object '{item['id']}' is a {kind} with {len(size)} dimensions")

    def _mesh(self, item: Data, mesh: Data, X_FS: pin.SE3) -> dict[str, Any]:
        vertices = [numbers(v, "xyz") for v in mesh.get("vertices") or []]
        triangles = [t["vertex_indices"] if isinstance(t, Mapping) else t for t in mesh.get("triangles") or []]
        if not vertices or not triangles:
            raise CannotConvert(f"object '{item['id']}' has a mesh without vertices or triangles in the file")
        for triangle in triangles:
            if len(triangle) != 3 or any(corner not in range(len(vertices)) for corner in triangle):
                words = f"a triangle {list(triangle)} of {len(vertices)} vertices"
                raise CannotConvert(f"object '{item['id']}' has a mesh with {words}")
        plain = "".join(c if c.isalnum() else "_" for c in str(item["id"]))
        file = f"{self.prefix}_{plain}_{len(self.meshes)}.obj"
        self.meshes[file] = obj_text(np.array(vertices), np.array(triangles, int))
        return {"mesh": {"file": file}}

    def _plane(self, item: Data, plane: Data, X_FS: pin.SE3) -> dict[str, Any]:
        """A plane a x + b y + c z + d = 0 keeps the robot on the side of its base: the other side is made solid."""
        a, b, c, d = (float(x) for x in plane["coef"])
        length = float(np.linalg.norm([a, b, c]))
        if length == 0.0:
            raise CannotConvert(f"object '{item['id']}' is a plane without a normal")
        normal, offset = np.array([a, b, c]) / length, -d / length
        if float(normal @ X_FS.inverse().translation) < offset - 1e-9:
            normal, offset = -normal, -offset
        self.notes.append(f"plane '{item['id']}' became a half-space that is solid away from the robot's base")
        return {"half_space": {"normal": [float(x) for x in normal], "offset": offset}}

    def _name(self, name: str, part: int) -> str:
        name = name if part == 0 else f"{name}_{part + 1}"
        taken = {WORLD, *self.links, *(n for names in self._parts.values() for n in names)}
        while name in taken:
            name += "_"
        return name

    def allowed_collisions(self, matrix: Data) -> list[list[str]]:
        """The pairs that an allowed collision matrix allows and that would be checked without it."""
        names = [str(name) for name in matrix.get("entry_names") or []]
        rows = [row.get("enabled", []) if isinstance(row, Mapping) else row for row in matrix.get("entry_values") or []]
        told = {
            frozenset((a, b)): bool(value)
            for a, row in zip(names, rows, strict=True)
            for b, value in zip(names, row, strict=True)
        }
        names, values = (matrix.get(f"default_entry_{key}") or [] for key in ("names", "values"))
        defaults = {str(name): bool(value) for name, value in zip(names, values, strict=True)}
        for name in defaults:
            for other in (*self._parts, *self.links):  # of two defaults, never allowing the contact wins
                told.setdefault(frozenset((name, other)), defaults[name] and defaults.get(other, True))
        allowed = {pair for pair, value in told.items() if value and len(pair) == 2}
        return [list(pair) for pair in sorted(self._checked(allowed))]

    def _checked(self, allowed: set[frozenset[str]]) -> set[tuple[str, str]]:
        """Keep pairs of links that the robot checks; replace an object by each of its parts."""
        robot = self.robot
        own = {
            frozenset((robot.link_of(int(p.first)), robot.link_of(int(p.second))))
            for p in robot.geometry.collisionPairs
        }
        known = {*self.links, *self._parts}
        pairs = set()
        for a, b in (sorted(pair) for pair in allowed if pair <= known):
            if a in self._parts or b in self._parts or frozenset((a, b)) in own:
                pairs |= {(x, y) for x in self._bodies_of(a) for y in self._bodies_of(b)}
        return pairs

    def _bodies_of(self, name: str) -> Sequence[str]:
        return self._parts.get(name, [name])
