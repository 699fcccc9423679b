"""A run in plain arrays, as programs that play recordings take it."""

import base64
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin
import trimesh

from optiplan.arrays import Array
from optiplan.errors import OptiPlanError
from optiplan.geometry.obstacle_motion import ObstacleMotion
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.viewer.runs import Poses, ViewedRun
from optiplan.viewer.scene import build_scene

RATE = 60.0
"""Poses a second."""
_WIDE = 4.0  # m, side of the square that stands for a plane


@dataclass(frozen=True, eq=False)
class RecordedBody:
    """A body that moves as one.

    Attributes:
        name: of the joint that moves it, of the obstacle or of the object; `world` for what stands.
        vertices: (k, 3), m, in the frame of the body.
        faces: (m, 3), indices of vertices.
        colours: (k, 4), 0 to 1, red, green, blue and opacity of each vertex.
        poses: (n, 7), at each time of the recording, x, y, z, m, and the quaternion x, y, z, w; (1, 7) where it stands;
            NaN while it is nowhere, like a tool without a rack that is not mounted.
    """

    name: str
    vertices: Array
    faces: npt.NDArray[np.int64]
    colours: Array
    poses: Array


@dataclass(frozen=True, eq=False)
class RecordedCurve:
    """A quantity over time: `names` (m) of its series, `t` (k,), s, `y` (k, m) in `unit`."""

    name: str
    unit: str
    names: list[str]
    t: Array
    y: Array


@dataclass(frozen=True, eq=False)
class Recording:
    """A run: `t` (n,), s, the bodies, the path of the tool (n, 3), m, its curves, and the verdict in words."""

    name: str
    t: Array
    bodies: list[RecordedBody]
    tool: Array
    curves: list[RecordedCurve]
    verified: bool
    verdict: str


def recording_of(problem: Problem, run: ViewedRun) -> Recording:
    """Return a run of a problem as arrays.

    Raises:
        OptiPlanError: the run has no motion.
    """
    if run.trajectory is None:
        raise OptiPlanError(f"the run '{run.label}' has no motion to record")
    scene = build_scene(problem, [run])
    shown, duration = scene.runs[0], run.trajectory.duration
    t = np.linspace(0.0, duration, max(2, int(np.ceil(RATE * duration)) + 1))
    joints, tool = Poses(problem).of(run.trajectory(t))
    surfaces = [_triangles(one) for one in scene.geometries]
    drawn = {"visual", "attached"} if any(part["set"] == "visual" for part in scene.parts) else {"collision", "frame"}
    groups: dict[str, list[tuple[Mapping[str, Any], pin.SE3]]] = {}
    poses: dict[str, Array] = {}
    still = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
    for part in scene.parts:
        if part["set"] == "obstacle":
            name, own = f"obstacles/{part['name']}", pin.SE3.Identity()
            poses[name] = _obstacle_poses(part, t)
        elif part["set"] in drawn:
            name = str(problem.robot.model.names[part["body"]]) if part["body"] else "world"
            own = pin.XYZQUATToSE3(np.array(part["pose"]))
            poses[name] = joints[:, part["body"] - 1] if part["body"] else still
        else:
            continue
        groups.setdefault(name, []).append((part, own))
    for one in shown["objects"]:
        name = f"objects/{one['name']}"
        groups[name], poses[name] = [(one, pin.SE3.Identity())], _object_poses(one, joints, t)
    bodies = [_body(name, parts, surfaces, poses[name]) for name, parts in groups.items()]
    lines = [f"{run.label}: {shown['badge']}", *(f"{name}: {value}" for name, value in shown["facts"])]
    lines += [f"{'✓' if check['passed'] else '✗'} {check['name']} ({check['kind']})" for check in shown["checks"]]
    verdict = "\n".join([*lines, *shown["problems"]])
    return Recording(scene.name, t, bodies, tool, _curves(shown), shown["badge"] == "verified", verdict)


def _body(
    name: str, parts: list[tuple[Mapping[str, Any], pin.SE3]], surfaces: list[trimesh.Trimesh], poses: Array
) -> RecordedBody:
    vertices, faces, colours, count = [], [], [], 0
    for part, own in parts:
        surface = surfaces[part["geometry"]]
        vertices.append(surface.vertices @ own.rotation.T + own.translation)
        faces.append(np.asarray(surface.faces) + count)
        colours.append(np.tile(part["colour"], (len(surface.vertices), 1)))
        count += len(surface.vertices)
    return RecordedBody(name, np.vstack(vertices), np.vstack(faces), np.vstack(colours), poses)


def _obstacle_poses(part: Mapping[str, Any], t: Array) -> Array:
    """Poses of an obstacle (n, 7); (1, 7) of one that stands."""
    pose = np.asarray(part["pose"], float)
    motion = part.get("motion")
    if not motion:
        return pose[None]
    moved, X = ObstacleMotion.of_data(**motion), pin.XYZQUATToSE3(pose)
    return np.array([pin.SE3ToXYZQUAT(moved.pose(time) * X) for time in t.tolist()])


def _object_poses(one: Mapping[str, Any], joints: Array, t: Array) -> Array:
    """Poses (n, 7) of what a task takes and puts down: with the body that it is in; NaN where it is nowhere."""
    rows = np.empty((len(t), 7))
    for k, time in enumerate(t):
        stay = next((stay for stay in reversed(one["stays"]) if stay["begin"] <= time), one["stays"][0])
        X_BO = pin.XYZQUATToSE3(np.asarray(stay["pose"], float))
        X_WB = pin.XYZQUATToSE3(joints[k, stay["body"] - 1]) if stay["body"] else pin.SE3.Identity()
        X_WB = ObstacleMotion.of_data(**stay["motion"]).pose(float(time)) if "motion" in stay else X_WB
        rows[k] = np.nan if stay.get("absent") else pin.SE3ToXYZQUAT(X_WB * X_BO)
    return rows


def _curves(shown: Mapping[str, Any]) -> list[RecordedCurve]:
    t = _floats(shown["curves"]["t"])
    found = [
        RecordedCurve(one["name"], one["unit"], list(one["series"]), t, _floats(one["y"]).reshape(len(t), -1))
        for one in shown["curves"]["quantities"]
        if "t" not in one
    ]
    clearance = shown.get("clearance")
    if clearance:
        measured = _floats(clearance["distance"])
        found.append(RecordedCurve("clearance", "m", ["measured"], _floats(clearance["t"]), measured[:, None]))
    return found


def _floats(text: str) -> Array:
    return np.frombuffer(base64.b64decode(text), "<f4").astype(float)


def _triangles(shape: Mapping[str, Any]) -> trimesh.Trimesh:
    """Surface of a geometry of a page's data."""
    kind = shape["kind"]
    if kind == "box":
        mesh = trimesh.creation.box(shape["size"])
        mesh.apply_translation(shape.get("centre") or (0.0, 0.0, 0.0))
        return mesh
    if kind == "sphere":
        return trimesh.creation.icosphere(3, shape["radius"])
    if kind == "cylinder":
        return trimesh.creation.cylinder(shape["radius"], shape["length"], sections=48)
    if kind == "capsule":
        mesh = trimesh.creation.capsule(shape["length"], shape["radius"])
        mesh.apply_translation((0.0, 0.0, -mesh.bounds.mean(axis=0)[2]))
        return mesh
    if kind == "plane":
        normal = np.asarray(shape["normal"], float) / np.linalg.norm(shape["normal"])
        mesh = trimesh.creation.box((_WIDE, _WIDE, 1e-3))
        mesh.apply_transform(trimesh.geometry.align_vectors((0.0, 0.0, 1.0), normal))
        mesh.apply_translation(normal * (shape["offset"] - 5e-4))
        return mesh
    vertices = np.frombuffer(base64.b64decode(shape["vertices"]), "<u2").reshape(-1, 3)
    faces = np.frombuffer(base64.b64decode(shape["faces"]), "<u4" if shape["wide"] else "<u2").reshape(-1, 3)
    points = np.asarray(shape["low"]) + shape["step"] * vertices.astype(float)
    return trimesh.Trimesh(points, faces.astype(np.int64), process=False)
