"""Pose and geometric Jacobian of any frame of a robot; which frame is the tool of a group.

Source: B. Siciliano et al., Robotics: Modelling, Planning and Control, section 3.1; values from pinocchio.
"""

from collections.abc import Collection
from typing import TYPE_CHECKING, Literal

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array

if TYPE_CHECKING:
    from optiplan.robot.robot import Robot

Axes = Literal["world", "frame"]


def link_names(model: pin.Model) -> list[str]:
    """Return the names of all links, also of those without geometry."""
    return [str(frame.name) for frame in model.frames if frame.type == pin.FrameType.BODY]


def frame_names(model: pin.Model) -> list[str]:
    """Return the names of all frames that a pose goal can be about: links and fixed frames, not joints."""
    kinds = (pin.FrameType.BODY, pin.FrameType.OP_FRAME)
    return [str(frame.name) for frame in model.frames if frame.type in kinds]


def frame_pose(robot: "Robot", q: Array, frame: str, data: pin.Data | None = None) -> pin.SE3:
    """Return the pose X_WF of a frame at q (n,).

    Args:
        robot: the robot.
        q: (n,), rad or m.
        frame: its name.
        data: of `robot.model`, kept by a caller who asks often; None: made for this call.

    Raises:
        UnknownChoiceError: there is no such frame.
    """
    data = robot.model.createData() if data is None else data
    index = robot.frame_id(frame)
    pin.framesForwardKinematics(robot.model, data, np.asarray(q, dtype=np.float64))
    return pin.SE3(data.oMf[index])


def frame_poses(robot: "Robot", Q: Array, frame: str) -> Array:
    """Return the poses X_WF (N, 4, 4) of a frame at Q (N, n).

    Raises:
        UnknownChoiceError: there is no such frame.
    """
    placed = robot.model.frames[robot.frame_id(frame)]
    return np.asarray(robot.kinematics.poses(Q)[:, int(placed.parentJoint)] @ np.array(placed.placement.homogeneous))


def geometric_jacobian(robot: "Robot", q: Array, frame: str, axes: Axes = "world") -> Array:
    """Return J (6, n) with [v; w] = J q̇: velocity v, m/s, of the frame's origin, and angular velocity w, rad/s.

    Column of a revolute joint with the axis z through p: [z x (p_F - p); z]; of a prismatic one: [z; 0].

    Args:
        robot: with n joints.
        q: (n,), rad and m.
        frame: a link, joint or fixed frame.
        axes: of v and w, those of the `world` or of the `frame`.

    Raises:
        UnknownChoiceError: there is no such frame.
    """
    reference = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED if axes == "world" else pin.ReferenceFrame.LOCAL
    data, index = robot.model.createData(), robot.frame_id(frame)
    jacobian: Array = pin.computeFrameJacobian(robot.model, data, np.asarray(q, dtype=np.float64), index, reference)
    return jacobian.reshape(6, -1)  # of one joint it is (6,)


def pose_errors(X: Array, X_goal: Array) -> Array:
    """Return distance (m) and angle (rad) of poses (..., 4, 4): (..., 2), by |R - S|_F = 2 sqrt(2) sin(angle / 2)."""
    difference = X[..., :3, :] - X_goal[..., :3, :]
    squares = np.einsum("...ij,...ij->...j", difference, difference)
    chord = np.sqrt(squares[..., :3].sum(-1)) / np.sqrt(8.0)
    return np.stack([np.sqrt(squares[..., 3]), 2.0 * np.arcsin(np.minimum(chord, 1.0))], axis=-1)


def with_tool_of(robot: "Robot", group: str | None, main: Collection[str]) -> "Robot":
    """Return the robot with the tool frame of a group, if that has one of its own and its joints are not `main`.

    Args:
        robot: whose tool frame is that of the `main` joints.
        group: a name of its `groups`; None: that of the problem.
        main: the joints of the problem's own group.
    """
    frame = robot.tool_frames.get(group or "", robot.tool_frame)
    if frame == robot.tool_frame or set(robot.groups.get(group or "", ())) == set(main):
        return robot
    return robot.with_tool(frame)
