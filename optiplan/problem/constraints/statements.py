"""Path constraints: what holds during the whole motion, or a part of it."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar, TypeAlias

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.poses import pose_from_data, pose_to_data

During: TypeAlias = tuple[float, float]
"""Part of the motion, as fractions of its duration."""

WHOLE: During = (0.0, 1.0)


@dataclass(frozen=True, eq=False)
class OrientationCone:
    """An axis of a frame stays within an angle of a direction of the world.

    Attributes:
        frame: a link or fixed frame of the robot.
        axis: (3,) unit vector in the frame.
        toward: (3,) unit vector in the world.
        within: rad.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "orientation"

    frame: str
    axis: Array
    toward: Array
    within: float
    during: During = WHOLE


@dataclass(frozen=True, eq=False)
class PositionBox:
    """The origin of a frame stays in a box.

    Attributes:
        frame: a link or fixed frame of the robot.
        size: (3,) edge lengths, m.
        X_WC: pose of the box in the world.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "position"

    frame: str
    size: Array
    X_WC: pin.SE3
    during: During = WHOLE


@dataclass(frozen=True, eq=False)
class OnPlane:
    """The origin p of a frame stays near a plane: |normal · p - offset| <= within.

    Attributes:
        frame: a link or fixed frame of the robot.
        normal: (3,) unit vector in the world.
        offset: m.
        within: m.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "plane"

    frame: str
    normal: Array
    offset: float
    within: float
    during: During = WHOLE


@dataclass(frozen=True, eq=False)
class OnLine:
    """The origin of a frame stays near the segment between two points.

    Attributes:
        frame: a link or fixed frame of the robot.
        start, end: (3,) in the world, m.
        within: m.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "line"

    frame: str
    start: Array
    end: Array
    within: float
    during: During = WHOLE


@dataclass(frozen=True, eq=False)
class ToolSpeed:
    """A frame moves and turns no faster than this.

    Attributes:
        frame: a link or fixed frame of the robot.
        linear: of its origin, m/s; infinite: any.
        angular: rad/s; infinite: any.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "tool_speed"

    frame: str
    linear: float = np.inf
    angular: float = np.inf
    during: During = WHOLE


@dataclass(frozen=True, eq=False)
class PairClearance:
    """Pairs of bodies, by name, stay farther apart than this.

    Attributes:
        pairs: of links, obstacles and attached objects.
        at_least: m.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "clearance"

    pairs: tuple[tuple[str, str], ...]
    at_least: float
    during: During = WHOLE


@dataclass(frozen=True, eq=False)
class RelativePose:
    """One frame keeps its pose in another: two hands on one tray.

    Attributes:
        frame: a link or fixed frame of the robot.
        to: the frame that it keeps its pose in.
        X_TF: that pose.
        position: tolerance, m.
        orientation: tolerance, rad.
        during: part of the motion.
    """

    KEY: ClassVar[str] = "relative_pose"

    frame: str
    to: str
    X_TF: pin.SE3
    position: float
    orientation: float
    during: During = WHOLE


PathConstraint: TypeAlias = OrientationCone | PositionBox | OnPlane | OnLine | ToolSpeed | PairClearance | RelativePose

KINDS: dict[str, type[PathConstraint]] = {
    kind.KEY: kind for kind in (OrientationCone, PositionBox, OnPlane, OnLine, ToolSpeed, PairClearance, RelativePose)
}
"""Classes of constraints by their key in a problem file."""


def constraint_of(key: str, data: Mapping[str, Any], frame: str) -> PathConstraint:
    """Return the constraint of a validated entry of a file.

    Args:
        key: one of `KINDS`.
        data: the entry, all values there.
        frame: of an entry that names none.
    """
    during = tuple(data["during"]) if data.get("during") is not None else WHOLE
    own = data.get("frame") or frame
    if key == "orientation":
        return OrientationCone(own, _unit(data["axis"]), _unit(data["toward"]), data["within"], during)
    if key == "position":
        return PositionBox(own, np.array(data["box"]["size"]), pose_from_data(data["box"]["pose"]), during)
    if key == "plane":
        return OnPlane(own, _unit(data["normal"]), data["offset"], data["within"], during)
    if key == "line":
        return OnLine(own, np.array(data["from"], float), np.array(data["to"], float), data["within"], during)
    if key == "tool_speed":
        linear, angular = (np.inf if data.get(name) is None else data[name] for name in ("linear", "angular"))
        return ToolSpeed(own, linear, angular, during)
    if key == "clearance":
        return PairClearance(tuple((a, b) for a, b in data["pairs"]), data["at_least"], during)
    tolerance = data["tolerance"]
    return RelativePose(own, data["to"], pose_from_data(data), tolerance["position"], tolerance["orientation"], during)


def constraint_data(one: PathConstraint) -> dict[str, Any]:
    """Return a constraint as a problem file says it: its key, and under that its values."""
    said: dict[str, Any]
    if isinstance(one, OrientationCone):
        said = {"axis": one.axis, "toward": one.toward, "within": one.within}
    elif isinstance(one, PositionBox):
        said = {"box": {"size": np.asarray(one.size).tolist(), "pose": pose_to_data(one.X_WC)}}
    elif isinstance(one, OnPlane):
        said = {"normal": one.normal, "offset": one.offset, "within": one.within}
    elif isinstance(one, OnLine):
        said = {"from": one.start, "to": one.end, "within": one.within}
    elif isinstance(one, ToolSpeed):
        said = {name: getattr(one, name) for name in ("linear", "angular") if np.isfinite(getattr(one, name))}
    elif isinstance(one, PairClearance):
        said = {"pairs": [list(pair) for pair in one.pairs], "at_least": one.at_least}
    else:
        tolerance = {"position": one.position, "orientation": one.orientation}
        said = {"to": one.to, **pose_to_data(one.X_TF), "tolerance": tolerance}
    said = {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in said.items()}
    if "frame" in {field.name for field in fields(one)}:
        said["frame"] = one.frame  # type: ignore[union-attr]
    if tuple(one.during) != WHOLE:
        said["during"] = list(one.during)
    return {one.KEY: said}


def _unit(values: Any) -> Array:
    """Return the direction (3,) of unit length."""
    vector = np.array(values, float)
    return vector / float(np.linalg.norm(vector))
