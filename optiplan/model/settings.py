"""What a robot.yaml names: the tool frame and the configurations of a group."""

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.errors import InputError
from optiplan.model.joints import Group
from optiplan.model.robot_spec import RobotSpec
from optiplan.model.srdf import Srdf
from optiplan.yaml_lines import Document, Place
from optiplan.yaml_words import choices


def tool_frame(spec: RobotSpec, document: Document, model: pin.Model, group: Group) -> str:
    """The group's frame in `tool_frames`, else `tool_frame`, else the last link that the last planned joint moves.

    Raises:
        InputError: a frame or a group that is not there.
    """
    frames = [frame.name for frame in model.frames]
    named: list[tuple[Place, str]] = [(("tool_frames", key), frame) for key, frame in spec.tool_frames.items()]
    named += [] if spec.tool_frame is None else [(("tool_frame",), spec.tool_frame)]
    wrong = [(place, frame) for place, frame in named if frame not in frames]
    issues = [document.issue(place, f"unknown frame '{frame}'", choices(frame, frames)) for place, frame in wrong]
    for key in (key for key in spec.tool_frames if key not in spec.groups):
        issues.append(document.issue(("tool_frames", key), f"unknown group '{key}'", choices(key, list(spec.groups))))
    if issues:
        raise InputError(issues)
    frame = spec.tool_frames.get(group.name or "", spec.tool_frame)
    return _last_link(model) if frame is None else frame


def _last_link(model: pin.Model) -> str:
    moved = [frame for frame in model.frames if frame.type == pin.FrameType.BODY]
    last = max(frame.parentJoint for frame in moved)
    return str([frame.name for frame in moved if frame.parentJoint == last][-1])


def configurations(spec: RobotSpec, document: Document, srdf: Srdf | None, group: Group) -> dict[str, Array]:
    """Named configurations, each (n,): the robot.yaml's, then those of the SRDF that it does not have.

    Raises:
        InputError: a list of another length.
    """
    result: dict[str, Array] = {}
    issues = []
    for name, given in spec.configurations.items():
        if len(given) == len(group.listed):
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
