"""What a person or a program wants to know of a robot, as plain data."""

import math
from collections import Counter
from typing import Any

import pinocchio as pin

from optiplan.model.robot import Robot


def describe(robot: Robot) -> dict[str, Any]:
    """A robot as JSON-ready data: joints with limits, frames, configurations, pairs, geometry, notes.

    Angles in rad, lengths in m, times in s, torques in N·m; an infinite limit is None. `pairs.checked` holds pairs of
    link names; `pairs.allowed` maps a reason to the pairs that are not checked for it; `pairs.reasons` counts them.
    """
    return {
        "name": robot.name,
        "source": str(robot.source),
        "fingerprint": robot.fingerprint,
        "tool_frame": robot.tool_frame,
        "joints": _joints(robot),
        "locked": dict(robot.locked),
        "frames": [frame.name for frame in robot.model.frames if frame.type == pin.FrameType.BODY],
        "configurations": {name: [float(value) for value in q] for name, q in robot.configurations.items()},
        "geometry": _geometry(robot),
        "pairs": _pairs(robot),
        "notes": list(robot.notes),
    }


def _joints(robot: Robot) -> list[dict[str, Any]]:
    keys = ("lower", "upper", "velocity", "acceleration", "jerk", "torque")
    return [
        {"name": name, "type": _kind(robot.model.joints[index + 1])}
        | {key: _finite(getattr(robot.limits, key)[index]) for key in keys}
        for index, name in enumerate(robot.joint_names)
    ]


def _kind(joint: pin.JointModel) -> str:
    return "prismatic" if joint.shortname().startswith("JointModelP") else "revolute"


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _geometry(robot: Robot) -> list[dict[str, Any]]:
    """For each link with collision geometry: what is checked, and how many bodies that is."""
    bodies = Counter(robot.link_of(index) for index in range(robot.geometry.ngeoms))
    return [{"link": link, "checked": robot.link_geometry[link], "bodies": count} for link, count in bodies.items()]


def _pairs(robot: Robot) -> dict[str, Any]:
    checked = {tuple(sorted((robot.link_of(p.first), robot.link_of(p.second)))) for p in robot.geometry.collisionPairs}
    allowed: dict[str, list[list[str]]] = {}
    for pair, reason in sorted(robot.allowed.items()):
        allowed.setdefault(reason, []).append(list(pair))
    reasons = {reason: len(pairs) for reason, pairs in allowed.items()}
    return {"checked": [list(pair) for pair in sorted(checked)], "allowed": allowed, "reasons": reasons}
