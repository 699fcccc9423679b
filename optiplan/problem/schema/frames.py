"""Named frames of a problem file: poses that are said in an object or a frame become poses in the world.

A pose X_WB that the file says `in` F, with an `offset`, is X_WF X_FB X_BO: the pose of the file in F, and then the
offset in its own axes. An obstacle's frame is where the file puts it, also where a task takes it away later.

A frame or an obstacle with a `motion` moves, and what is said in it moves along: an obstacle gets the same motion, and
a move, an approach or a line of a task `rides` with it. Their poses are then those without any displacement.
"""

from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from optiplan.config.document import Document, validate
from optiplan.config.messages import choices, describe
from optiplan.config.values import Vector
from optiplan.errors import InputError, Issue
from optiplan.geometry.pose import PoseSpec, pose_of
from optiplan.geometry.poses import pose_to_data
from optiplan.problem.partial import fit, mapping
from optiplan.problem.schema.scene import OF_LINES, WORLD
from optiplan.robot.robot import Robot

OWN = ("in", "offset", "position", "rpy", "rpy_deg", "quaternion")
"""Keys of a pose that say where it is."""
FARTHEST = 5.0
"""m; an offset that is longer was meant in mm."""
POSES = frozenset({"base", "parked", "pose", "region"})
"""Keys under which a pose stands."""
LISTS = {"any_of": "approach", "points": "path", "targets": "tour"}
"""Keys under which poses stand in a list, each with the step that has it; those of a path and a tour may have an axis.
"""
RIDING = frozenset({"move", "approach", "line", "pick", "place"})
"""Steps whose poses may be in what moves."""
APART = ("robot", "frames")
"""Parts of a file whose poses are of their own kind."""

Place = tuple[str | int, ...]


class Placed(NamedTuple):
    """A pose of a file: X_WB, and the frame F that it is said in."""

    X_WF: pin.SE3
    X_WB: pin.SE3


class FrameReader:
    """The frames of a document.

    Attributes:
        issues: what is wrong with them, and with poses that name them.
    """

    def __init__(self, document: Document, robot: Callable[[], Robot | None]) -> None:
        self._document, self._robot = document, robot
        root = mapping(document.data)
        self._said: dict[str, tuple[Place, Mapping[str, Any]]] = {}
        self._motions: dict[str, tuple[Place, Any]] = {}
        for k, one in enumerate(_listed(mapping(root.get("scene")).get("obstacles"))):
            if isinstance(name := mapping(one).get("name"), str):
                self._said[name] = ("scene", "obstacles", k, "pose"), mapping(one.get("pose"))
                if one.get("motion") is not None:
                    self._motions[name] = ("scene", "obstacles", k, "motion"), one["motion"]
        self.issues: list[Issue] = []
        frames = root.get("frames")
        if frames is not None and not isinstance(frames, Mapping):
            self._report(("frames",), describe(frames), "poses by name: {tray: {in: …, position: […], rpy: […]}}")
        for name, pose in mapping(frames).items():
            self._add(name, pose)
        self._known: dict[str, pin.SE3 | None] = {WORLD: pin.SE3.Identity()}
        self._base = mapping(root.get("base"))

    @cached_property
    def _links(self) -> Mapping[str, pin.SE3]:
        """Poses X_BL of the links that no joint moves; the robot is loaded where a pose names what is no frame."""
        from optiplan.problem.schema.fixed_links import fixed_links

        robot = self._robot()
        return {} if robot is None else fixed_links(robot)

    def _add(self, name: str, pose: Any) -> None:
        place: Place = ("frames", name)
        if name in OF_LINES or name in self._said:
            taken = f"the {name}'s own name" if name in OF_LINES else "the name of an obstacle"
            self._report(place, f"'{name}', {taken}", "a name that nothing else has")
        elif not isinstance(pose, Mapping):
            self._report(place, describe(pose), "a pose: {in: …, position: […], rpy: […]}")
        else:
            known = (*OWN, "motion")
            for key in (key for key in pose if key not in known):
                self._report((*place, key), "a key that a frame does not have", choices(key, known))
            self._said[name] = place, pose
            if "motion" in pose:
                self._motions[name] = (*place, "motion"), pose["motion"]

    def check(self) -> None:
        """Find what is wrong with frames that no pose names."""
        for name, (_, pose) in self._said.items():
            self.pose_of(name, (name,))
            parent = self.mover(pose.get("in"))
            if parent is not None and name in self._motions:
                self._report(self._motions[name][0], f"a motion in '{parent}', which moves", "one of both")

    def mover(self, name: Any) -> str | None:
        """Return what moves a frame: itself, or the one that it is in; None where it stands still."""
        for _ in range(len(self._said) + 1):
            if not isinstance(name, str) or name not in self._said:
                return None
            if name in self._motions:
                return name
            name = self._said[name][1].get("in")
        return None

    def motion_of(self, name: str) -> Any:
        """Return the motion of a frame that moves, as a file says it; the axis of a turn is where it is."""
        said, X_WF = self._motions[name][1], self.pose_of(name, (name,))
        turn = said.get("turn") if isinstance(said, Mapping) else None
        if not isinstance(turn, Mapping) or "about" in turn or X_WF is None:
            return said
        return {**said, "turn": {**turn, "about": X_WF.translation.tolist()}}

    def moving_frames(self) -> dict[str, Any]:
        """Return the frames that move, as the schema has them: in the world."""
        found = {}
        for name, (place, _) in self._motions.items():
            if place[0] == "frames":
                X_WF = self.pose_of(name, (name,))
                found[name] = {**({} if X_WF is None else pose_to_data(X_WF)), "motion": self.motion_of(name)}
        return found

    def along(self, place: Place, pose: Mapping[str, Any]) -> tuple[Place, str, Any] | None:
        """Return where in the file it is said that what is at a pose moves, with which key and value; None: it stands.

        A pose at a place that cannot move is reported.
        """
        mover = self.mover(pose.get("in"))
        if mover is None:
            return None
        if place[:2] == ("scene", "obstacles") and place[3:] == ("pose",):
            return place[:3], "motion", self.motion_of(mover)
        if place[0] == "task" and len(place) > 3 and place[2] in RIDING and "via" not in place:
            return place[:3], "rides", mover
        expected = "what stands still: in what moves are obstacles, and poses of moves, approaches and lines of a task"
        self._report((*place, "in"), f"'{pose['in']}', which moves", expected)
        return None

    def pose_of(self, name: str, way: tuple[str, ...]) -> pin.SE3 | None:
        """Return X_WF of a frame that is there; None where it cannot be said. `way` has the names that led to it."""
        if name not in self._known and name not in self._said:
            X_WB = self.in_world(("base",), self._base, way)
            return None if X_WB is None else X_WB * self._links[name]
        if name not in self._known:
            self._known[name] = None  # for whoever asks again on the way
            place, pose = self._said[name]
            self._known[name] = self.in_world(place, pose, way)
        return self._known[name]

    def in_world(self, place: Place, pose: Mapping[str, Any], way: tuple[str, ...] = ()) -> pin.SE3 | None:
        """Return X_WO of a pose of the file; None where it cannot be said, which has been reported or will be."""
        parent = pose.get("in", WORLD)
        known = isinstance(parent, str) and (parent in (WORLD, *self._said) or parent in self._links)
        if not known:
            expected = choices(str(parent), list(dict.fromkeys([WORLD, *self._said, *self._links])))
            moves = self._moves(parent)
            found = f"'{parent}', a link that joints move" if moves else f"unknown frame {describe(parent)}"
            self._report((*place, "in"), found, f"what stands still: {expected}" if moves else expected)
            return None
        if parent in way:
            found = f"a circle of frames: {' in '.join([*way, parent])}"
            self._report((*place, "in"), found, "frames that lead to the world")
            return None
        if "in" in pose and self._is_carried(place):
            expected = "a pose in the frame of the link that carries the targets, without `in`"
            self._report((*place, "in"), f"{describe(parent)} beside `carried_by`", expected)
            return None
        X_WF = self.pose_of(parent, (*way, parent))
        X_FB = self._read(place, {key: pose[key] for key in OWN[2:] if key in pose}, place[0] == "frames")
        X_BO = self._offset(place, pose)
        return None if X_WF is None or X_FB is None or X_BO is None else X_WF * X_FB * X_BO

    def placed(self, place: Place, pose: Mapping[str, Any]) -> Placed | None:
        """Return a pose of the file in the world, with the frame that it is in; None where these cannot be said."""
        X_WB, parent = self.in_world(place, pose), pose.get("in", WORLD)
        X_WF = None if X_WB is None else self.pose_of(parent, (parent,))
        return None if X_WF is None or X_WB is None else Placed(X_WF, X_WB)

    def _offset(self, place: Place, pose: Mapping[str, Any]) -> pin.SE3 | None:
        """Return X_BO, the identity of what has none."""
        if pose.get("offset") is None or _is_region(place):
            return pin.SE3.Identity()
        X_BO = self._read((*place, "offset"), pose["offset"], True)
        if X_BO is not None and (far := float(np.abs(X_BO.translation).max())) > FARTHEST:
            self._report((*place, "offset", "position"), f"{far:g} m", f"metres, at most {FARTHEST:g}")
        return X_BO

    def _read(self, place: Place, data: Any, told: bool) -> pin.SE3 | None:
        """Return a pose of the file; None where it is none, which is `told` here where no other check says it."""
        try:
            return pose_of(validate(PoseSpec, Document(self._document.path, data, {})))
        except InputError as error:
            for issue in error.issues if told else ():
                self._report((*place, *issue.path), issue.found, issue.expected)
            return None

    def _is_carried(self, place: Place) -> bool:
        """Whether this is a target of a tour that a link of the robot carries."""
        tour = _at(self._document.data, place[:3]) if place[2:4] == ("tour", "targets") else None
        return mapping(tour).get("carried_by") is not None

    def all_along(self, data: Mapping[str, Any], moving: Sequence[tuple[Place, str, Any]]) -> None:
        """Report steps of which one end moves with something, and another does not."""
        riding = [(place, value) for place, key, value in moving if key == "rides"]
        for place in dict.fromkeys(place for place, _ in riding):
            movers = [mover for other, mover in riding if other == place]
            several = mapping(_at(data, place)).get("any_of")
            if len(set(movers)) > 1 or (isinstance(several, list) and len(several) != len(movers)):
                found = f"ends in {' and '.join(sorted(set(movers)))} beside others"
                self._report((*place, "any_of"), found, "ends that all move with the same thing")

    def _moves(self, name: Any) -> bool:
        """Whether this is the name of a link that is not fixed."""
        robot = self._robot()
        return robot is not None and isinstance(name, str) and robot.model.existFrame(name, pin.FrameType.BODY)

    def _report(self, place: Place, found: str, expected: str) -> None:
        self.issues.append(self._document.issue(place, found, expected))


def in_world(document: Document, robot: Callable[[], Robot | None]) -> tuple[Document, list[Issue]]:
    """Return a problem file whose poses are all in the world, without frames; and what is wrong with these.

    `robot` loads the robot, whose fixed links are frames, too.
    """
    if not isinstance(document.data, Mapping):
        return document, []
    placed = list(_placed(document.data))
    if not placed and "frames" not in document.data:
        return document, []
    frames = FrameReader(document, robot)
    frames.check()
    poses = {place: frames.placed(place, pose) for place, pose in placed}
    moving = [found for place, pose in placed if (found := frames.along(place, pose)) is not None]
    frames.all_along(document.data, moving)
    data = {key: value for key, value in document.data.items() if key != "frames"}
    if any(kept := frames.moving_frames()):
        data["frames"] = kept
    unique = {(issue.field, issue.found): issue for issue in frames.issues}
    found = _replaced(data, poses, ())
    for place, key, value in moving:
        if (told := _at(found, place)) is not None:
            told[key] = value
    return replace(document, data=found), list(unique.values())


def _at(data: Any, place: Place) -> dict[str, Any] | None:
    """Return the mapping at a place."""
    for key in place:
        data = data[key]
    return data if isinstance(data, dict) else None


def _listed(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def _is_placed(value: Any, place: Place) -> bool:
    """Whether it is a pose in a frame, or with an offset; that of a region is its own."""
    if not place or not isinstance(value, Mapping) or not _is_pose(place):
        return False
    return "in" in value or ("offset" in value and not _is_region(place))


def _is_pose(place: Place) -> bool:
    """Whether a pose stands there that is not in a frame of its own, as what a link holds is."""
    if place[:2] == ("scene", "attached") or (place[0] in ("tool", "tools") and place[-1] != "parked"):
        return False
    return place[-1] in POSES or _is_listed(place, LISTS)


def _is_listed(place: Place, lists: Container[Any]) -> bool:
    """Whether it is an item of a list of a step, one of `lists`."""
    return place[0] == "task" and len(place) == 5 and place[3] in lists and place[2] == LISTS.get(str(place[3]))


def _is_region(place: Place) -> bool:
    return place[0] != "frames" and place[-1] == "region"


def _placed(data: Any, place: Place = ()) -> Iterator[tuple[Place, Mapping[str, Any]]]:
    """Poses in frames below a place."""
    if _is_placed(data, place):
        yield place, data
        return
    items = data.items() if isinstance(data, Mapping) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        if place or key not in APART:
            yield from _placed(value, (*place, key))


def _replaced(data: Any, poses: Mapping[Place, Placed | None], place: Place) -> Any:
    if place in poses:
        own = set(OWN) - ({"offset"} if _is_region(place) else set())
        pose, kept = poses[place], {key: value for key, value in data.items() if key not in own}
        stated = {key: data[key] for key in OWN[2:] if key in data} if pose is None else pose_to_data(pose.X_WB)
        if pose is not None and _is_listed(place, ("points", "targets")):
            stated = _listed_pose(data, pose, stated, "points" in place)
        return {**kept, **stated}
    if isinstance(data, Mapping):
        return {key: _replaced(value, poses, (*place, key)) for key, value in data.items()}
    return [_replaced(value, poses, (*place, k)) for k, value in enumerate(data)] if isinstance(data, list) else data


def _listed_pose(data: Mapping[str, Any], pose: Placed, stated: dict[str, Any], points: bool) -> dict[str, Any]:
    """Return a target or a point whose pose is `stated` in the world: with an axis, or as it is.

    A point without a rotation of its own has none in a frame either. What is no vector, and a rotation beside an axis,
    stays as it is written, for the check of the pose.
    """
    found, turned = dict(stated), {key: data[key] for key in OWN[3:] if key in data}
    if (axis := data.get("axis")) is not None:
        found = {"position": stated["position"], **turned}
        if (along := fit(Vector, axis)) is not None:
            found["axis"] = (pose.X_WB.rotation @ np.array(along)).tolist()
    elif points and not turned and data.get("offset") is None:
        found = {"position": stated["position"]}
    if points and (through := fit(Vector, data.get("through"))) is not None:
        found["through"] = pose.X_WF.act(np.array(through)).tolist()
    return found
