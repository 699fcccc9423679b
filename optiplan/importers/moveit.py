"""One MoveIt planning scene and motion plan request, as YAML data, into the data of a problem file."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.pose import ToleranceSpec
from optiplan.geometry.poses import pose_to_data
from optiplan.importers.moveit_objects import CannotConvert, Frames, SceneConverter, joint_state, numbers, pose
from optiplan.records import dataclass
from optiplan.robot.robot import Robot

CLAMP = 1e-3
"""A joint value this far outside its limits, rad or m, is rounding of whoever wrote the file: it is moved inside."""

EXACT = ToleranceSpec()
"""Stands for a tolerance of 0, which messages have where none is filled in; no solver meets that."""


@dataclass
class Converted:
    """The data of a problem file, meshes to be written beside it (name to OBJ text), and remarks."""

    data: dict[str, Any]
    meshes: dict[str, str]
    notes: list[str] = field(default_factory=list)


def convert(scene: Mapping[str, Any], request: Mapping[str, Any], robot: Robot, prefix: str) -> Converted:
    """Convert a scene and a request for `robot` to problem data, without `robot` and `name`.

    Args:
        scene: `moveit_msgs/PlanningScene` as YAML data.
        request: `moveit_msgs/MotionPlanRequest` as YAML data.
        robot: determines which joints are planned or can be locked, and the bodies.
        prefix: start of the names of mesh files.

    Raises:
        CannotConvert: something is missing or has no counterpart in a problem file.
    """
    _refuse(scene, request)
    notes: list[str] = []
    state = merged_state(scene, request)
    start = _planned(robot, state, "the start state", notes)
    frames = Frames(robot, np.array(start), scene, request)
    bodies = SceneConverter(robot, frames, prefix)
    for state_message in (request.get("start_state"), scene.get("robot_state")):
        bodies.add_attached(state_message)
    bodies.add_world(scene)
    allowed = bodies.allowed_collisions(scene.get("allowed_collision_matrix") or {})
    data = {
        "version": 1,
        "locked": _locked(robot, state, notes),
        "start": {"joints": start},
        "goal": _goal(request.get("goal_constraints") or [], robot, frames, notes),
        "scene": {"obstacles": bodies.obstacles, "attached": bodies.attached, "allowed_collisions": allowed},
        "limits": _limits(request),
    }
    notes += _left_out(scene, request)
    return Converted({k: v for k, v in data.items() if v}, bodies.meshes, notes + bodies.notes)


def _left_out(scene: Mapping[str, Any], request: Mapping[str, Any]) -> Iterator[str]:
    """Say what the messages state beside what is converted."""
    padded = [one["link_name"] for one in scene.get("link_padding") or [] if float(one.get("padding") or 0.0)]
    padded += [one["link_name"] for one in scene.get("link_scale") or [] if float(one.get("scale") or 1.0) != 1.0]
    if padded:
        yield f"left out padding and scale of links: {', '.join(dict.fromkeys(map(str, padded)))}"
    for state in (request.get("start_state") or {}, scene.get("robot_state") or {}):
        if any(map(float, (state.get("joint_state") or {}).get("velocity") or [])):
            yield "left out velocities at the start: the motion begins at rest"
            break
    if float(request.get("max_cartesian_speed") or 0.0) > 0.0:
        yield "left out the limit of the Cartesian speed"


def _refuse(scene: Mapping[str, Any], request: Mapping[str, Any]) -> None:
    constraints = request.get("path_constraints") or {}
    if any(constraints.values()) or (request.get("trajectory_constraints") or {}).get("constraints"):
        raise CannotConvert("the request has path constraints, which are not converted")
    octomap = ((scene.get("world") or {}).get("octomap") or {}).get("octomap") or {}
    if octomap.get("data"):
        raise CannotConvert("the scene has an octomap, which problem files cannot hold yet")


def _planned(robot: Robot, state: Mapping[str, float], where: str, notes: list[str]) -> list[float]:
    missing = [name for name in robot.joint_names if name not in state]
    if missing:
        raise CannotConvert(f"{where} gives no value for {', '.join(missing)}")
    q = np.array([state[name] for name in robot.joint_names], float)
    inside = np.clip(q, robot.limits.lower, robot.limits.upper)
    for name, value, bound in zip(robot.joint_names, q, inside, strict=True):
        if not abs(value - bound) <= CLAMP:
            raise CannotConvert(f"{where} has {name} = {value:.6g}, beyond its limit {bound:.6g}")
        if value != bound:
            notes.append(f"{where} has {name} beyond its limit by {abs(value - bound):.1e}: moved to the limit")
    return [float(value) for value in inside]


def merged_state(scene: Mapping[str, Any], request: Mapping[str, Any]) -> dict[str, float]:
    """Joint values at the start: the request's, and the scene's for joints that the request does not name."""
    return joint_state(scene.get("robot_state")) | joint_state(request.get("start_state"))


def _locked(robot: Robot, state: Mapping[str, float], notes: list[str]) -> dict[str, float]:
    """Joints that are not planned stand where the state puts them, also beyond their own limits."""
    outside = {name: value for name, value in state.items() if name not in robot.joint_names}
    absent = sorted(name for name in outside if name not in robot.locked)
    if absent:
        notes.append(f"left out joints that the robot has fixed or does not have: {', '.join(absent)}")
    return {name: value for name, value in outside.items() if name in robot.locked}


def _limits(request: Mapping[str, Any]) -> dict[str, float]:
    """MoveIt reads a scaling factor outside (0, 1] as 1."""
    factors = {name: float(request.get(f"max_{name}_scaling_factor") or 0.0) for name in ("velocity", "acceleration")}
    return {name: factor for name, factor in factors.items() if 0.0 < factor < 1.0}


def _goal(constraints: Sequence[Mapping[str, Any]], robot: Robot, frames: Frames, notes: list[str]) -> dict[str, Any]:
    ends = [end for item in constraints for end in _ends(item, robot, frames, notes)]
    if not ends:
        raise CannotConvert("the request has no goal")
    return ends[0] if len(ends) == 1 else {"any_of": ends}


def _ends(item: Mapping[str, Any], robot: Robot, frames: Frames, notes: list[str]) -> list[dict[str, Any]]:
    joints = item.get("joint_constraints") or []
    positions, orientations = item.get("position_constraints") or [], item.get("orientation_constraints") or []
    if item.get("visibility_constraints"):
        raise CannotConvert("the goal has visibility constraints")
    if joints and (positions or orientations):
        raise CannotConvert("the goal constrains joints and a pose at once")
    if joints:
        values = {str(j["joint_name"]): float(j["position"]) for j in joints}
        if others := sorted(values.keys() - set(robot.joint_names)):
            notes.append(f"left out of the goal: joints that are not planned, {', '.join(others)}")
        return [{"joints": _planned(robot, values, "the goal", notes)}]
    if len(positions) != 1 or len(orientations) > 1:
        raise CannotConvert(f"the goal has {len(positions)} position and {len(orientations)} orientation constraints")
    return _pose_ends(positions[0], orientations[0] if orientations else None, robot, frames)


def _pose_ends(
    position: Mapping[str, Any], orientation: Mapping[str, Any] | None, robot: Robot, frames: Frames
) -> list[dict[str, Any]]:
    """One pose goal for each ball or box in which the point of the link may end."""
    link = str(position["link_name"])
    if orientation is not None and str(orientation["link_name"]) != link:
        raise CannotConvert(f"the goal is about two links, {link} and {orientation['link_name']}")
    if not robot.model.existFrame(link):
        raise CannotConvert(f"the goal is about link {link}, which the robot does not have")
    R_WL, angle = np.eye(3), np.pi
    if orientation is not None:
        R_FL = pose({"orientation": orientation["orientation"]}).rotation
        R_WL = frames.pose(orientation.get("header")).rotation @ R_FL
        angle = min(abs(float(orientation.get(f"absolute_{axis}_axis_tolerance") or 0.0)) for axis in "xyz")
    offset = numbers(position.get("target_point_offset") or [0, 0, 0], "xyz")
    if orientation is None and np.any(offset):
        raise CannotConvert("the goal is about a point beside the link's origin, without an orientation")
    X_WF = frames.pose(position.get("header"))
    region = position.get("constraint_region") or {}
    if region.get("meshes") or not region.get("primitives"):
        raise CannotConvert("the position goal is not a box or sphere")
    ends = []
    for shape, placement in zip(region["primitives"], region["primitive_poses"], strict=True):
        point = X_WF.act(pose(placement).translation)
        X_WL = pose_to_data(pin.SE3(R_WL, point - R_WL @ offset))
        tolerance = {"position": _ball(shape) or EXACT.position, "orientation": min(angle or EXACT.orientation, np.pi)}
        ends.append({"pose": {"frame": link, **X_WL, "tolerance": tolerance}})
    return ends


def _ball(shape: Mapping[str, Any]) -> float:
    """Radius, m, of the largest ball inside a goal region."""
    size: Array = np.array(shape["dimensions"], float)
    if str(shape["type"]) in ("box", "1"):
        return float(size[:3].min() / 2.0)
    if str(shape["type"]) in ("sphere", "2"):
        return float(size[0])
    raise CannotConvert(f"the position goal is a {shape['type']}, not a box or sphere")
