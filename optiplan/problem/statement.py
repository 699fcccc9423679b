"""`Pose` and `ViaPoint` for construction in Python, checked by the schema of problem files."""

from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin

from optiplan.arrays import is_finite, is_listed
from optiplan.config.document import plain
from optiplan.errors import described, wrong_argument
from optiplan.geometry.pose import Pose, Values, checked
from optiplan.geometry.poses import is_matrix_of_pose, pose_to_data
from optiplan.problem.goals_and_vias import AllOfGoal, JointGoal, PoseGoal, Via
from optiplan.problem.regions.region import RegionGoal
from optiplan.problem.regions.schema import RegionSpec, axes_data
from optiplan.problem.schema.ends import AlternativeSpec, ViaSpec
from optiplan.problem.schema.joint_names import lists_of
from optiplan.records import dataclass
from optiplan.robot.given_configurations import is_by_name
from optiplan.trajectory.state import State

Range: TypeAlias = float | str | tuple[float | str, float | str]
"""How far a coordinate may be off: either way, between two, or `"free"`."""


@dataclass(frozen=True)
class Region:
    """Goal: a frame of the robot anywhere in a region of poses.

    The frame is at `offset` (its pose in the region) in the middle; from there it may be displaced `along` the axes of
    the region, m, and turned `about` them, rad. An axis that is not named has the tolerance of a pose goal, 1e-4 m and
    1e-3 rad. Rotations: all bounded (the components of the rotation vector), one free (the others bound how far its
    axis tilts), or all three.

    Attributes:
        position: [x, y, z] of the region in the world, m.
        rpy: [roll, pitch, yaw] of the region, rad, about the fixed axes x, then y, then z, as in URDF.
        quaternion: [x, y, z, w] of unit length, instead of `rpy`; with neither the axes are those of the world.
        along: range of each of the axes `x`, `y`, `z`; `"free"`: all three free.
        about: likewise.
        offset: pose of the frame in the region; a `Pose`, or a mapping of `position` and `rpy` or `quaternion`.
        frame: a link or fixed frame of the robot; None: its tool frame.
        rpy_deg: `rpy` in degrees; the region then has `rpy`.

    Raises:
        InputError: a range that is empty, rotations free about two axes, everything free.

    Example:
        >>> import optiplan as op
        >>> op.Region((0.5, 0.0, 0.3), rpy=(3.14, 0, 0), along={"x": 0.1, "y": (-0.2, 0.3)}, about={"z": "free"})
        Region(position=(0.5, 0.0, 0.3), rpy=(3.14, 0.0, 0.0), along={'x': 0.1, 'y': (-0.2, 0.3)}, about={'z': 'free'})
    """

    position: Values
    rpy: Values | None = None
    quaternion: Values | None = None
    along: Mapping[str, Range] | str = field(default_factory=dict)
    about: Mapping[str, Range] | str = field(default_factory=dict)
    offset: Pose | Mapping[str, Any] | None = None
    frame: str | None = None
    rpy_deg: Values | None = None

    def __post_init__(self) -> None:
        spec = checked(RegionSpec, self.to_data(), "Region", {})
        for name in ("position", "rpy", "rpy_deg", "quaternion"):
            object.__setattr__(self, name, getattr(spec, name))

    def to_data(self) -> dict[str, Any]:
        """As a problem file says it."""
        offset = self.offset.to_data() if isinstance(self.offset, Pose) else self.offset
        stated = {name: getattr(self, name) for name in self.__dataclass_fields__} | {"offset": offset}
        return {key: plain(value) for key, value in stated.items() if not _nothing(value)}

    def __repr__(self) -> str:
        """What was said, and nothing else."""
        said = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return f"Region({', '.join(f'{k}={value!r}' for k, value in said.items() if not _nothing(value))})"


def _nothing(value: Any) -> bool:
    return value is None or (isinstance(value, Mapping) and not value)


@dataclass(frozen=True, eq=False)
class AllOf:
    """Goal: several frames of the robot in their places at once, such as both hands.

    Attributes:
        ends: two or more of `Pose` and `Region`, each with its `frame`.

    Raises:
        InputError: fewer than two, or an end of another kind.

    Example:
        >>> import optiplan as op
        >>> op.AllOf([op.Pose((0.7, 0.2, 0.3), frame="left_hand"), op.Pose((0.7, -0.2, 0.3), frame="right_hand")])
        AllOf([Pose(position=(0.7, 0.2, 0.3), frame='left_hand'), Pose(position=(0.7, -0.2, 0.3), frame='right_hand')])
    """

    ends: Sequence["Pose | Region | PoseGoal | RegionGoal"]

    def __post_init__(self) -> None:
        checked(AlternativeSpec, self.to_data(), "AllOf", {"all_of": "ends"})

    def to_data(self) -> dict[str, Any]:
        """As a problem file says it."""
        if not isinstance(self.ends, Sequence):
            raise wrong_argument("AllOf", "ends", described(self.ends), "a list of op.Pose(…) and op.Region(…)")
        for k, one in enumerate(self.ends):
            if not isinstance(one, Pose | Region | PoseGoal | RegionGoal):
                raise wrong_argument("AllOf", f"ends[{k}]", described(one), "op.Pose(…) or op.Region(…) with its frame")
        return {"all_of": [_framed(end_data(one, "AllOf", f"ends[{k}]")) for k, one in enumerate(self.ends)]}

    def __repr__(self) -> str:
        """The ends."""
        return f"AllOf({list(self.ends)!r})"


def _framed(end: Mapping[str, Any]) -> dict[str, Any]:
    """Return an end with its frame beside the pose or region, as a file has several of them."""
    ((kind, placed),) = end.items()
    frame = {"frame": placed["frame"]} if "frame" in placed else {}
    return {**frame, kind: {key: value for key, value in placed.items() if key != "frame"}}


End: TypeAlias = (
    Pose
    | Region
    | AllOf
    | AllOfGoal
    | JointGoal
    | PoseGoal
    | RegionGoal
    | pin.SE3
    | str
    | Values
    | State
    | Mapping[str, Any]
)
"""One end: a pose, a region, a configuration (n,) or `{joint: value}`, rad or m, its name, a state of motion, or what a
file would say."""


@dataclass(frozen=True, eq=False)
class ViaPoint:
    """Via point of a motion.

    Attributes:
        at: a configuration (n,) or `{joint: value}`, rad or m, the name of one, or a `Pose`.
        tolerance: of each joint, or of both parts of a pose, rad or m; None: 1e-6.
        velocity: (n,) or `{joint: value}`, rad/s or m/s, desired; only the planner `spline` meets it.
        time: s from the start, likewise; given for all via points or for none.

    Example:
        >>> import optiplan as op
        >>> op.ViaPoint(op.Pose((0.4, 0.2, 0.5)), tolerance=0.01)
        ViaPoint(at=Pose(position=(0.4, 0.2, 0.5)), tolerance=0.01)
    """

    at: End
    tolerance: float | None = None
    velocity: Values | Mapping[str, float] | None = None
    time: float | None = None

    def __post_init__(self) -> None:
        data = lists_of({"via": [self.to_data()]})["via"][0]  # which joints are named is checked with the robot
        checked(ViaSpec, data, "ViaPoint", {"joints": "at", "configuration": "at", "pose": "at"})

    def to_data(self) -> dict[str, Any]:
        """As a problem file says it."""
        wishes = {"tolerance": self.tolerance, "velocity": self.velocity, "time": self.time}
        at = end_data(self.at, "ViaPoint", "at")
        return {**at, **{key: plain(value) for key, value in wishes.items() if value is not None}}

    def __repr__(self) -> str:
        """What was said, and nothing else."""
        said = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return f"ViaPoint({', '.join(f'{name}={value!r}' for name, value in said.items() if value is not None)})"


def end_data(end: Any, function: str, argument: str) -> dict[str, Any]:
    """Return one end as in a problem file.

    Raises:
        InputError: not an end, or a joint goal with a tolerance that files cannot hold.
    """
    if isinstance(end, str):
        return {"configuration": end}
    if isinstance(end, Pose | pin.SE3 | PoseGoal):
        return {"pose": _pose_data(end, function, argument)}
    if isinstance(end, AllOf | AllOfGoal):
        return (end if isinstance(end, AllOf) else AllOf(end.parts)).to_data()
    if isinstance(end, Region | RegionGoal):
        return {"region": end.to_data() if isinstance(end, Region) else _region_data(end)}
    if isinstance(end, JointGoal):
        return _joint_goal_data(end, function, argument)
    if isinstance(end, Mapping):
        return {"joints": plain(end)} if is_by_name(end) else dict(plain(end))
    if isinstance(end, State):
        return state_data(end.q, end.v, end.a)
    if is_configuration(end):
        return {"joints": np.asarray(end, dtype=float).tolist()}
    if is_matrix_of_pose(end):
        raise wrong_argument(function, argument, "a matrix (4, 4) of a pose", "op.Pose.from_matrix(matrix)")
    expected = "values of the joints (n,) or {joint: value}, the name of a configuration, op.Pose(…) or op.Region(…)"
    raise wrong_argument(function, argument, described(end), expected)


def _pose_data(end: Pose | pin.SE3 | PoseGoal, function: str, argument: str) -> dict[str, Any]:
    if isinstance(end, Pose):
        return end.to_data()
    if isinstance(end, pin.SE3):
        return {**pose_to_data(end)}
    if not isinstance(end.X_WG, pin.SE3):
        found = f"a PoseGoal at {described(end.X_WG)}"
        raise wrong_argument(function, argument, found, "a pose (pinocchio.SE3), or op.Pose(…)")
    tolerance = {"position": end.position, "orientation": end.orientation}
    return {"frame": end.frame, **pose_to_data(end.X_WG), "tolerance": tolerance}


def _region_data(goal: RegionGoal) -> dict[str, Any]:
    parts = {"along": slice(0, 3), "about": slice(3, 6)}
    axes = {key: axes_data(goal.low[part], goal.high[part]) for key, part in parts.items()}
    return {"frame": goal.frame, **pose_to_data(goal.X_WR), "offset": pose_to_data(goal.X_RF), **axes}


def _joint_goal_data(goal: JointGoal, function: str, argument: str) -> dict[str, Any]:
    if not (is_configuration(goal.q) or is_by_name(goal.q)) or not is_finite(goal.tolerance):
        found = f"a JointGoal of {described(goal.q)}, within {described(goal.tolerance)}"
        raise wrong_argument(
            function, argument, found, "values of the joints (n,) or {joint: value}, and a number for the tolerance"
        )
    usual = JointGoal(goal.q).tolerance
    if goal.tolerance != usual:
        own = f"{usual:g}, which is that of every goal of joints"
        raise wrong_argument(function, argument, f"a tolerance of {goal.tolerance:g}", own)
    return state_data(goal.q, goal.velocity, goal.acceleration)


def state_data(q: Any, velocity: Any = None, acceleration: Any = None) -> dict[str, Any]:
    """Return a state of motion as in a problem file; zeros are left out."""
    data = {"joints": _joint_values(q)}
    for key, rate in (("velocity", velocity), ("acceleration", acceleration)):
        if rate is not None and np.any(list(rate.values()) if isinstance(rate, Mapping) else rate):
            data[key] = _joint_values(rate)
    return data


def _joint_values(values: Any) -> Any:
    return plain(values) if isinstance(values, Mapping) else np.asarray(values, dtype=float).tolist()


def is_several(ends: Any) -> bool:
    """Whether it is a list of ends, not one of them; of an arm of four joints the rows of a matrix could be four."""
    listed = isinstance(ends, Sequence | np.ndarray) and is_listed(ends)
    return listed and not is_configuration(ends) and not is_matrix_of_pose(ends)


def is_configuration(value: Any) -> bool:
    """Return whether a value is a flat array or list of numbers."""
    try:
        array = np.asarray(value)
    except ValueError:  # rows of several lengths
        return False
    return array.ndim == 1 and array.dtype.kind in "iuf" and len(array) > 0


def via_point_data(via: Any, argument: str) -> dict[str, Any]:
    """Return one via as in a problem file.

    Raises:
        InputError: not a via.
    """
    if isinstance(via, ViaPoint):
        return via.to_data()
    if not isinstance(via, Via):
        return end_data(via, "Problem", argument)
    at = via.at
    data = end_data(JointGoal(at.q) if isinstance(at, JointGoal) else at, "Problem", argument)
    if isinstance(at, JointGoal):
        data["tolerance"] = at.tolerance
    if via.velocity is not None:
        data["velocity"] = np.asarray(via.velocity, dtype=float).tolist()
    if via.time is not None:
        data["time"] = via.time
    return data
