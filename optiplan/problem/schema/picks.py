"""Picking and placing in a problem file, written out as the steps that they are.

    - pick: {object: part, grasps: auto, from: conveyor}       # approach, attach, gripper, retreat
    - place: {object: part, pose: {in: tray, position: […]}}   # approach, gripper, detach, retreat

What is not stated of the hand is what the robot file says: the fingers are a group of its joints, they slide, and the
link that holds is the one that carries the tool frame.
"""

import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal, Self

import pinocchio as pin
from pydantic import Field, model_validator

from optiplan.config.document import Document, Strict, validate
from optiplan.config.messages import choices
from optiplan.config.values import JointValues, Length, Name, NotNegative
from optiplan.errors import InputError, Issue
from optiplan.geometry.pose import PoseGoalSpec
from optiplan.geometry.shapes import shape_from_spec
from optiplan.kinematics.ik.numeric import joints_that_move
from optiplan.problem.constraints.statements import KINDS as KINDS_OF_CONSTRAINTS
from optiplan.problem.constraints.statements import PathConstraintSpec
from optiplan.problem.grasps.antipodal import graspable, least_width
from optiplan.problem.partial import fit, mapping
from optiplan.problem.schema.ends import exactly_one
from optiplan.problem.schema.scene import LARGEST_MASS, WORLD, ObstacleSpec
from optiplan.robot.frames import with_tool_of
from optiplan.robot.mimic_joints import resolve
from optiplan.robot.robot import Robot
from optiplan.robot.urdf.reader import stated_mimics

_AWAY = 0.1
"""m of the lines to an object and away from it, where no other length is stated."""

_TIGHT = 1e-6
"""m that fingers open wider than the side that they close on: no other side is taken then."""

STEP = ("name", "arm", "wait_for", "allowed_collisions", "path_constraints")
"""Keys of a step beside what it does, that its parts have too."""

_NOT_OF = {
    "name": ("attach", "detach", "gripper", "retreat"),
    "wait_for": ("attach", "detach", "gripper", "retreat"),
    "path_constraints": ("attach", "detach"),
}
"""Parts that do not have a key: only the first has a name and waits, and events take no time."""

Place = tuple[str | int, ...]

Loader = Callable[[], tuple[Robot | None, Sequence[str]]]
"""Loads the robot, and says which joints the group of the problem has."""


class PickSpec(Strict):
    """Take an `object` with the fingers: approach one of its `grasps`, attach it, close, lift it off.

    `grasps` are `auto`, those of `approach.grasps` across the least width of the object, or poses of the tool in the
    frame of the object. `from` names what the object moves with. The fingers are the joints of `hand`, which open to
    `opening`, m, and close to `closed`. `link`, `touch` and `mass` are as of `attach`.
    """

    object: Name
    grasps: Literal["auto"] | Annotated[tuple[PoseGoalSpec, ...], Field(min_length=1)] = "auto"
    from_: Annotated[Name | None, Field(alias="from")] = None
    hand: Name | None = None
    opening: Length | None = None
    closed: JointValues | None = None
    link: Name | None = None
    touch: tuple[Name, ...] | None = None
    mass: Annotated[NotNegative, Field(le=LARGEST_MASS)] | None = None
    distance: Length = _AWAY
    lift: Length = _AWAY
    speed: Length | None = None
    group: Name | None = None


class PlaceSpec(Strict):
    """Put a held `object` down: approach a pose of the tool, or any of several, open the fingers, let go, go back."""

    object: Name
    pose: PoseGoalSpec | None = None
    any_of: Annotated[tuple[PoseGoalSpec, ...], Field(min_length=1)] | None = None
    hand: Name | None = None
    open_: Annotated[JointValues | None, Field(alias="open")] = None
    distance: Length = _AWAY
    away: Length = _AWAY
    speed: Length | None = None
    group: Name | None = None

    @model_validator(mode="after")
    def _one_end(self) -> Self:
        exactly_one(self, ("pose", "any_of"))
        return self


KINDS: Mapping[str, type[PickSpec] | type[PlaceSpec]] = {"pick": PickSpec, "place": PlaceSpec}
"""What is written out here."""


def with_picks(document: Document, robot: Loader) -> tuple[Document, list[Issue]]:
    """Return a problem file whose picks and places are plain steps, with their lines; and what is wrong with them."""
    task = mapping(document.data).get("task")
    if not isinstance(task, list) or not any(isinstance(one, dict) and KINDS.keys() & one.keys() for one in task):
        return document, []
    reader, steps = _PickReader(document, robot), list[Any]()
    lines = {place: line for place, line in document.lines.items() if place[:1] != ("task",) or len(place) == 1}
    for k, step in enumerate(task):
        old = ("task", k)
        below = {place[2:]: line for place, line in document.lines.items() if place[:2] == old}
        for one, left in reader.steps(old, step):
            new = ("task", len(steps))
            steps.append(one)
            lines |= {(*new, *own): line for rest, line in below.items() if (own := _place_of(rest, left)) is not None}
            if (line := document.lines.get(old)) is not None:
                lines |= {(*new, key): line for key in mapping(one) if (*new, key) not in lines}
    return replace(document, data={**document.data, "task": steps}, lines=lines), reader.issues


def _place_of(place: Place, left: Sequence[int] | None) -> Place | None:
    """Return where something of a step is in one of its parts, which has the path constraints that are `left` to it."""
    if left is None or place[:1] != ("path_constraints",) or len(place) == 1:
        return place
    return (place[0], left.index(int(place[1])), *place[2:]) if place[1] in left else None


class _PickReader:
    def __init__(self, document: Document, robot: Loader) -> None:
        self._document, self._load = document, robot
        self.issues: list[Issue] = []
        obstacles = mapping(mapping(document.data).get("scene")).get("obstacles")
        self._obstacles = {
            str(one["name"]): one
            for one in (obstacles if isinstance(obstacles, list) else [])
            if isinstance(one, dict) and "name" in one
        }

    def steps(self, place: Place, step: Any) -> Iterator[tuple[Any, Sequence[int] | None]]:
        """Yield the steps that a step is, each with the places of its path constraints in those of the step."""
        kinds = [kind for kind in KINDS if isinstance(step, dict) and kind in step]
        if len(kinds) != 1:
            yield step, None
            return
        kind = kinds[0]
        if unknown := [key for key in step if key not in (kind, *STEP, "option")]:
            self._report((*place, unknown[0]), f"a key that does not go with `{kind}`", choices(unknown[0], STEP))
            return
        try:
            spec = validate(KINDS[kind], Document(self._document.path, _unframed(step[kind]), {}))
        except InputError as error:
            for issue in error.issues:
                self._report((*place, kind, *issue.path), issue.found, issue.expected)
            return
        whole, main = self._load()
        if whole is None:
            return
        robot = with_tool_of(whole, spec.group or step.get("arm"), main)
        rest = {key: value for key, value in step.items() if key != kind}
        parts, held = self._pick if isinstance(spec, PickSpec) else self._place, isinstance(spec, PlaceSpec)
        for one in parts((*place, kind), spec, robot, step[kind]):  # type: ignore[arg-type]
            held = "attach" in one or (held and "detach" not in one)
            own = {key: value for key, value in rest.items() if not one.keys() & _NOT_OF.get(key, ())}
            left = None
            if isinstance(said := own.get("path_constraints"), list):
                tool = with_tool_of(whole, one["gripper"]["group"], main) if "gripper" in one else robot
                frame = None if tool.tool_frame == robot.tool_frame else robot.tool_frame
                kept = {k: _about(c, frame) for k, c in enumerate(said) if held or spec.object not in _frames(c)}
                own["path_constraints"], left = [*kept.values()], [*kept]
            yield {**one, **own}, left

    def _pick(self, place: Place, spec: PickSpec, robot: Robot, raw: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
        hand = self._hand(place, spec.hand, robot)
        body = self._obstacles.get(spec.object)
        if body is None:
            expected = choices(spec.object, list(self._obstacles) or ["none: there are no obstacles"])
            self._report((*place, "object"), f"unknown object '{spec.object}'", expected)
        if hand is None or body is None:
            return
        fingers = _Fingers(robot, hand)
        width, closed = self._width(body), None if spec.closed is None else list(spec.closed)
        opening = fingers.opening if spec.opening is None else spec.opening
        if spec.grasps == "auto" and (width is None or opening is None or width > opening):
            found = f"'{spec.object}'" if width is None else f"'{spec.object}', {width:g} m wide"
            expected = "`grasps`: poses of the tool in the frame of the object" if width is None else "`opening`, m"
            wide = "" if width is None or opening is None else f" of more than that; the fingers open to {opening:g} m"
            self._report((*place, "grasps"), found, expected + wide)
            return
        if closed is None and width is not None:
            closed = fingers.closed(width)
        if closed is None:
            self._report((*place, "closed"), "nothing", f"values of the joints of '{hand}' that hold the object")
            return
        line = {key: value for key, value in (("speed", spec.speed), ("group", spec.group)) if value is not None}
        if spec.grasps == "auto" and width is not None:
            grasps: dict[str, Any] = {"grasps": {"object": spec.object, "opening": width + _TIGHT}}
        else:
            grasps = {"any_of": [{"in": spec.object, **one} for one in raw["grasps"]]}
        link = spec.link or _holding(robot)
        weight = {} if spec.mass is None else {"mass": spec.mass}
        touch = fingers.links if spec.touch is None else list(spec.touch)
        lift: dict[str, Any] = {"distance": spec.lift, "along": [0, 0, 1], "in": spec.from_ or WORLD}
        yield {"approach": {**grasps, "distance": spec.distance, **line}}
        yield {"attach": {"object": spec.object, "link": link, "touch": touch, **weight}}
        yield {"gripper": {"group": hand, "joints": list(closed)}}
        yield {"retreat": {**lift, **line}}

    def _place(self, place: Place, spec: PlaceSpec, robot: Robot, raw: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
        hand = self._hand(place, spec.hand, robot)
        if hand is None:
            return
        opened = spec.open_ or _Fingers(robot, hand).opened
        if opened is None:
            self._report((*place, "open"), "nothing", f"values of the joints of '{hand}' that let go of the object")
            return
        line = {key: value for key, value in (("speed", spec.speed), ("group", spec.group)) if value is not None}
        end = {key: raw[key] for key in ("pose", "any_of") if key in raw}
        yield {"approach": {**end, "distance": spec.distance, **line}}
        yield {"gripper": {"group": hand, "joints": list(opened)}}
        yield {"detach": {"object": spec.object}}
        yield {"retreat": {"distance": spec.away, **line}}

    def _hand(self, place: Place, name: str | None, robot: Robot) -> str | None:
        """Return the group of the fingers: as it is stated, or the only one whose joints are not those of the arm."""
        leading = zip(robot.joint_names, joints_that_move(robot, robot.tool_frame), strict=True)
        own = {joint for joint, leads in leading if leads}
        others = [group for group, joints in robot.groups.items() if not set(joints) & own]
        if name in others:
            return name
        if name is None and len(others) == 1:
            return others[0]
        found = "nothing" if name is None else f"'{name}'"
        expected = choices(name or "", others or ["none: the robot file has no group of fingers"])
        self._report((*place, "hand"), found, f"a group of fingers: {expected}")
        return None

    def _width(self, body: Mapping[str, Any]) -> float | None:
        """Return the least width of a box or a cylinder, m; None of another shape."""
        spec = fit(ObstacleSpec, {key: body[key] for key in ("name", "shape") if key in body})
        shape = None if spec is None else shape_from_spec(spec.shape)
        return least_width(shape) if shape is not None and graspable(shape) else None

    def _report(self, place: Place, found: str, expected: str) -> None:
        self.issues.append(self._document.issue(place, found, expected))


def _frames(said: Any) -> set[str]:
    """Return the frames that a path constraint names."""
    spec = fit(PathConstraintSpec, _without_frames(said))
    one = None if spec is None else KINDS_OF_CONSTRAINTS[spec.kind].of(spec.value, "")
    return set() if one is None else {mention.name for mention in one.mentioned() if mention.kind == "frame"}


def _about(said: Any, frame: str | None) -> Any:
    """Return a path constraint about a frame where it would be about the tool frame, which is another one."""
    spec = None if frame is None else fit(PathConstraintSpec, _without_frames(said))
    if spec is None or getattr(spec.value, "frame", frame) is not None:
        return said
    return {spec.kind: {**mapping(said[spec.kind]), "frame": frame}}


def _unframed(data: Any) -> Any:
    """Return what a step says with poses without their frames, which are read later."""
    if not isinstance(data, dict):
        return data
    found = dict(data)
    for key in ("pose", "any_of", "grasps"):
        one = found.get(key)
        if isinstance(one, dict):
            found[key] = _bare(one)
        elif isinstance(one, list):
            found[key] = [_bare(pose) if isinstance(pose, dict) else pose for pose in one]
    return found


def _without_frames(data: Any) -> Any:
    """Return a path constraint with its poses without their frames, likewise."""
    if isinstance(data, list):
        return [_without_frames(one) for one in data]
    if not isinstance(data, dict):
        return data
    return {k: _bare(one) if k == "pose" and isinstance(one, dict) else _without_frames(one) for k, one in data.items()}


def _bare(pose: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in pose.items() if key not in ("in", "offset")}


class _Fingers:
    """The joints of a hand, with those that follow them, as the URDF has them.

    Fingers that slide by q each open by `_travel` q in all: 1 for each joint, |m| for what follows it by m.
    """

    def __init__(self, robot: Robot, group: str) -> None:
        root = ET.fromstring(robot.urdf)
        joints = {str(one.get("name")): one for one in root.findall("joint")}
        self.names = [name for name in robot.groups[group] if name in joints]
        mimics = resolve(stated_mimics(joints.values()), list(joints))
        followers = {name: mimic for name, mimic in mimics.items() if mimic.source in self.names}
        moved = [*self.names, *followers]
        self._sliding = bool(moved) and all(joints[name].get("type") == "prismatic" for name in moved)
        self._upper = [float(_limit(joints[name])) for name in self.names]
        self._travel = len(self.names) + sum(abs(mimic.multiplier) for mimic in followers.values())
        own = {_link(joints[name], "child") for name in moved}
        for _ in joints:
            own |= {_link(one, "child") for one in joints.values() if _link(one, "parent") in own}
        self.links = sorted(own & robot.link_geometry.keys())

    @property
    def opened(self) -> list[float] | None:
        """Values at which fingers that slide are open."""
        return self._upper if self._sliding else None

    @property
    def opening(self) -> float | None:
        """How far apart fingers that slide are then, m, if they meet at 0."""
        return max(self._upper) * self._travel if self._sliding and self._upper else None

    def closed(self, width: float) -> list[float] | None:
        """Values at which they hold a width, m."""
        return [width / self._travel] * len(self.names) if self._sliding else None


def _limit(joint: ET.Element) -> str:
    limit = joint.find("limit")
    return "0" if limit is None else limit.get("upper", "0")


def _link(joint: ET.Element, end: str) -> str:
    found = joint.find(end)
    return "" if found is None else str(found.get("link"))


def _holding(robot: Robot) -> str:
    """Return the link with a body that carries the tool frame."""
    frame = robot.model.frames[robot.frame_id(robot.tool_frame)]
    while frame.type != pin.FrameType.BODY or str(frame.name) not in robot.link_geometry:
        above = robot.model.frames[frame.parentFrame]
        if above.name == frame.name or frame.parentFrame == 0:
            return robot.tool_frame
        frame = above
    return str(frame.name)
