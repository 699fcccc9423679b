"""Parts of a problem as the plain data of a problem file: the inverse of `compile.py`."""

from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.geometry.poses import pose_to_data
from optiplan.geometry.scene import Box, Capsule, Cylinder, HalfSpace, Mesh, Scene, Shape, Sphere
from optiplan.problem.problem import Goal, JointGoal, PoseGoal, Via


def goal_data(goal: Goal) -> dict[str, Any]:
    """`goal:` of a file.

    Raises:
        ValueError: a joint goal has another tolerance than the only one that files know.
    """
    ends = [_end(one) for one in goal]
    return ends[0] if len(ends) == 1 else {"any_of": ends}


def via_data(vias: tuple[Via, ...]) -> list[dict[str, Any]]:
    """`via:` of a file."""
    return [_via(via) for via in vias]


def scene_data(scene: Scene) -> dict[str, Any]:
    """`scene:` of a file; meshes keep their paths."""
    obstacles = [
        {"name": body.name, "shape": shape_data(body.shape), "pose": pose_to_data(body.X_WO)}
        for body in scene.obstacles
    ]
    attached = [
        {
            "name": held.name,
            "shape": shape_data(held.shape),
            "link": held.link,
            "pose": pose_to_data(held.X_LO),
            "touch": sorted(held.touch),
        }
        for held in scene.attached
    ]
    allowed = sorted(sorted(pair) for pair in scene.allowed)
    return {"obstacles": obstacles, "attached": attached, "allowed_collisions": allowed}


def shape_data(shape: Shape) -> dict[str, Any]:
    """`shape:` of a file."""
    match shape:
        case Box():
            return {"box": list(shape.size)}
        case Sphere():
            return {"sphere": shape.radius}
        case Cylinder() | Capsule():
            name = "cylinder" if isinstance(shape, Cylinder) else "capsule"
            return {name: {"radius": shape.radius, "length": shape.length}}
        case HalfSpace():
            return {"half_space": {"normal": list(shape.normal), "offset": shape.offset}}
        case Mesh():
            return {"mesh": {"file": str(shape.file), "scale": list(shape.scale), "convex": shape.convex}}


def _end(one: JointGoal | PoseGoal) -> dict[str, Any]:
    if isinstance(one, PoseGoal):
        return {"pose": {**_pose(one.frame, one.X_WG), "tolerance": _tolerance(one)}}
    if one.tolerance != JointGoal(one.q).tolerance:
        raise ValueError(f"goal: found a tolerance of {one.tolerance:g}; expected {JointGoal(one.q).tolerance:g}")
    return {"joints": np.asarray(one.q, dtype=float).tolist()}


def _via(via: Via) -> dict[str, Any]:
    if isinstance(via.at, PoseGoal):
        data: dict[str, Any] = {"pose": {**_pose(via.at.frame, via.at.X_WG), "tolerance": _tolerance(via.at)}}
    else:
        data = {"joints": np.asarray(via.at.q, dtype=float).tolist(), "tolerance": via.at.tolerance}
    if via.velocity is not None:
        data["velocity"] = np.asarray(via.velocity, dtype=float).tolist()
    if via.time is not None:
        data["time"] = via.time
    return data


def _pose(frame: str, X_WG: pin.SE3) -> dict[str, Any]:
    return {"frame": frame, **pose_to_data(X_WG)}


def _tolerance(one: PoseGoal) -> dict[str, float]:
    return {"position": one.position, "orientation": one.orientation}
