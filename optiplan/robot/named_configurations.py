"""Names in a robot.yaml: the tool frame and the configurations of a group."""

import re

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.config.document import Document
from optiplan.config.messages import choices
from optiplan.config.simple_yaml import Place
from optiplan.errors import InputError
from optiplan.robot.given_configurations import wrong_names
from optiplan.robot.joint_groups import Group, Reduced
from optiplan.robot.spec import RobotSpec
from optiplan.robot.urdf.reader import UrdfSource
from optiplan.robot.urdf.srdf import Srdf

_TOOL = re.compile(r"(^|_)(tcp|tool0|grasp(ing)?(_frame|_link)?|end_effector|eef?)($|_)", re.IGNORECASE)
"""Common names of tool frames."""


def tool_frame(
    spec: RobotSpec, document: Document, reduced: Reduced, urdf: UrdfSource, group: Group
) -> tuple[str, list[str]]:
    """Return the group's frame in `tool_frames`, else `tool_frame`, else a link at the end of the last planned joint.

    Returns:
        The frame, and notes on the joints and the frame chosen because the robot.yaml names none.

    Raises:
        InputError: an unknown frame or group.
    """
    frames = [frame.name for frame in reduced.model.frames]
    named: list[tuple[Place, str]] = [(("tool_frames", key), frame) for key, frame in spec.tool_frames.items()]
    named += [] if spec.tool_frame is None else [(("tool_frame",), spec.tool_frame)]
    wrong = [(place, frame) for place, frame in named if frame not in frames]
    issues = [document.issue(place, f"unknown frame '{frame}'", choices(frame, frames)) for place, frame in wrong]
    for key in (key for key in spec.tool_frames if key not in spec.groups):
        issues.append(document.issue(("tool_frames", key), f"unknown group '{key}'", choices(key, list(spec.groups))))
    if issues:
        raise InputError(issues)
    frame = spec.tool_frames.get((group.name or "").partition("+")[0], spec.tool_frame)
    notes = []
    if group.chosen:
        notes.append(f"no group is given: planned is the longest chain of joints, {', '.join(group.joints)}")
    if frame is None:
        frame = _last_link(reduced.model, urdf, group.joints[-1])
        notes.append(f"no tool frame is given: {frame}, at the end of {group.joints[-1]}, is taken")
    return frame, notes


def _last_link(model: pin.Model, urdf: UrdfSource, joint: str) -> str:
    """Return the last link fixed to the last planned joint, preferably one with the name of a tool."""
    joined = [urdf.children[joint]]
    for link in joined:
        joined += [child for name, child in urdf.children.items() if urdf.fixed_to(name) == link]
    moved = [frame.name for frame in model.frames if frame.type == pin.FrameType.BODY and frame.name in joined]
    named = [name for name in moved if _TOOL.search(name)]
    return str((named or moved)[-1])


def configurations(spec: RobotSpec, document: Document, srdf: Srdf | None, group: Group) -> dict[str, Array]:
    """Return the named configurations, each (n,): of the robot.yaml, then further ones of the SRDF.

    Raises:
        InputError: a list of another length, an unknown joint, or a joint without a value.
    """
    result: dict[str, Array] = {}
    issues = []
    for name, given in spec.configurations.items():
        if isinstance(given, dict):
            place: Place = ("configurations", name)
            wrong = wrong_names(group.listed, given)
            issues += [document.issue(place if j is None else (*place, j), found, so) for j, found, so in wrong]
            if not wrong:
                result[name] = np.array([given[joint] for joint in group.joints], float)
        elif len(given) == len(group.listed):
            result[name] = group.pick(given)
        else:
            found, expected = f"a list of {len(given)} values", f"{len(group.listed)}, one a planned joint"
            issues.append(document.issue(("configurations", name), found, expected))
    if issues:
        raise InputError(issues)
    for name, values in ({} if srdf is None else srdf.states).items():
        if set(group.joints) <= set(values):
            result.setdefault(name, np.array([values[joint] for joint in group.joints]))
    return result
