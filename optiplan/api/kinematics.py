"""`ik`: the configurations that put a frame of a robot at a pose."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.api.loading import load_robot
from optiplan.arrays import Array
from optiplan.collision.kept_models import collision_model
from optiplan.config.messages import choices
from optiplan.errors import InputError, described, errors_about, flag_argument, whole_argument, wrong_argument
from optiplan.geometry.pose import Pose, Values
from optiplan.geometry.poses import pose_from_data, pose_from_matrix
from optiplan.geometry.scene import Obstacle, Scene
from optiplan.kinematics.ik.null_space import AIMS, Preference
from optiplan.kinematics.ik.numeric import IkOptions
from optiplan.kinematics.ik.solve import answer, wanted_configuration
from optiplan.robot.given_configurations import configuration
from optiplan.robot.robot import Robot

_MORE = 3
"""Times as many solutions are looked for where some may be in collision."""


def ik(  # noqa: PLR0913  # one keyword for each thing that chooses among solutions
    robot: Robot | str | Path,
    pose: Pose | pin.SE3 | Array | Mapping[str, Any],
    *,
    all: bool = False,  # the word of `optiplan ik --all`
    frame: str | None = None,
    near: Values | Mapping[str, float] | str | None = None,
    scene: Scene | Sequence[Obstacle] | None = None,
    prefer: str | None = None,
    count: int = 8,
) -> Array:
    """Find the configurations within the joint limits that put a frame of a robot at a pose.

    Solves X_WF(q) = X_WG with lower <= q <= upper. Arms with a spherical wrist and arms with three parallel axes are
    solved in closed form: up to eight branches, all of them. For other robots 200 starts are tried by damped least
    squares; a redundant arm has infinitely many solutions, of which these are some. The error is below 1e-8 m and rad.

    Args:
        robot: a `Robot`, the name of one, or a path, as of `op.load_robot`.
        pose: of the frame in the world: an `op.Pose`, a matrix (4, 4), m, a `pinocchio.SE3`, or a mapping of `position`
            and `rpy` or `quaternion`.
        all: return every solution found; else the nearest alone.
        frame: a link or fixed frame; None: that of the pose, else the tool frame.
        near: the configuration that solutions should be near to, as of `Robot.fk`; None: `ready`, else the first that
            has a name, else zero. It chooses among whole turns, too.
        scene: only solutions where the robot touches neither itself nor a body of the scene; `[]`: nor itself; None:
            collisions are not checked.
        prefer: of a redundant arm: each solution moves, with its pose kept, to the `middle` of the joint limits, to the
            `reference`, which is `near`, or to the greatest `manipulability`; None: as found.
        count: solutions returned, at most; a closed form has no more than eight.

    Returns:
        Configurations (k, n), rad or m, the nearest first: by max_i |q_i - near_i|. Without a solution k is 0.

    Raises:
        InputError: an argument that does not fit, an unknown frame or joint (with the choices).

    Example:
        >>> import optiplan as op
        >>> ur5 = op.load_robot("ur5")
        >>> op.ik(ur5, ur5.fk("ready"), all=True).shape
        (8, 6)
    """
    arm = robot if isinstance(robot, Robot) else _loaded(robot)
    X_WG = _pose(pose)
    flag_argument("ik", "all", all)
    name = _frame(arm, frame if frame is not None or not isinstance(pose, Pose) else pose.frame)
    named = arm.joint_names, arm.configurations
    start = wanted_configuration(arm) if near is None else configuration(*named, near, "ik", "near")
    if prefer is not None and (not isinstance(prefer, str) or prefer not in AIMS):
        raise wrong_argument("ik", "prefer", described(prefer), choices(str(prefer), AIMS))
    whole_argument("ik", "count", count, 1)
    wanted = None if prefer is None else Preference(prefer, start if prefer == "reference" else None)
    options = IkOptions(count=count if scene is None else _MORE * count, prefer=wanted)
    found = [one.q for one in answer(arm, name, X_WG, start, options).solutions if one.within_limits]
    if scene is not None:
        model = collision_model(arm, _scene(scene))
        found = [q for q in found if not model.collides(q) and model.contained(q) is None]
    return np.array(found[: count if all else 1]).reshape(-1, arm.n)


def _loaded(robot: Any) -> Robot:
    try:
        return load_robot(robot)
    except InputError as error:
        renamed = (replace(issue, file="op.ik", field="robot") for issue in error.issues if issue.field == "source")
        raise InputError([*renamed, *(issue for issue in error.issues if issue.field != "source")]) from None


def _frame(robot: Robot, name: str | None) -> str:
    frames = [str(frame.name) for frame in robot.model.frames[1:]]
    if name is not None and (not isinstance(name, str) or name not in frames):
        raise wrong_argument("ik", "frame", f"'{name}'", choices(str(name), frames))
    return robot.tool_frame if name is None else name


def _pose(pose: Any) -> pin.SE3:
    if isinstance(pose, pin.SE3):
        pose = pose.homogeneous
    try:
        with errors_about("op.Pose", "op.ik"):
            if isinstance(pose, Pose | Mapping):
                return pose_from_data((pose if isinstance(pose, Pose) else Pose(**pose)).to_data())
            matrix = np.asarray(pose, dtype=np.float64)
            if matrix.shape == (4, 4):
                return pose_from_matrix(matrix.ravel().tolist())
            found = described(matrix)
    except (TypeError, ValueError, OverflowError) as error:
        found = f"{described(pose)}: {error}"
    raise wrong_argument("ik", "pose", found, "op.Pose(position, rpy=…), a matrix (4, 4), or pinocchio.SE3")


def _scene(scene: Any) -> Scene:
    if isinstance(scene, Scene):
        return scene
    if isinstance(scene, str) or not isinstance(scene, Sequence) or any(not isinstance(b, Obstacle) for b in scene):
        raise wrong_argument("ik", "scene", described(scene), "op.Scene([…]) or a list of obstacles")
    return Scene(tuple(scene))
