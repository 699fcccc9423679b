"""Build `SceneData` from a problem and its runs: everything the page draws, as plain data."""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import asdict
from functools import partial
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.errors import OptiPlanError
from optiplan.geometry.shape import Shape
from optiplan.geometry.shapes import build_geometry
from optiplan.problem.problem import JointGoal, Problem
from optiplan.records import dataclass
from optiplan.robot.robot import Robot
from optiplan.runs.common_bound import common_bound
from optiplan.trajectory.trajectory import Trajectory
from optiplan.viewer.goal_marks import regions, targets
from optiplan.viewer.moving_objects import moved_by, object_stays
from optiplan.viewer.run_data.curves import short_names
from optiplan.viewer.runs import Detail, Poses, RunLike, ViewedRun, distinct_labels, motion_of, run_for_page
from optiplan.viewer.surfaces import Colour, base64_of, encode, visual_surfaces

_PLAIN: Colour = (0.93, 0.94, 0.95, 1.0)
_COLLISION: Colour = (0.45, 0.62, 0.78, 1.0)
_HELD: Colour = (0.90, 0.62, 0.25, 1.0)
_NAMED: dict[str, Colour] = {
    "red": (0.80, 0.28, 0.26, 1.0),
    "green": (0.33, 0.62, 0.36, 1.0),
    "blue": (0.25, 0.47, 0.80, 1.0),
    "yellow": (0.90, 0.75, 0.25, 1.0),
}
"""Colours of objects whose names begin with such a word."""
_OBJECTS: tuple[Colour, ...] = (
    _HELD,
    (0.30, 0.52, 0.80, 1.0),
    (0.80, 0.33, 0.31, 1.0),
    (0.36, 0.62, 0.38, 1.0),
    (0.58, 0.42, 0.70, 1.0),
)
"""Of what a task takes and releases, in turn."""
_FURNITURE: Colour = (0.70, 0.63, 0.54, 1.0)
_THING: Colour = (0.42, 0.60, 0.60, 1.0)
_ROD: Colour = (0.55, 0.60, 0.64, 1.0)
_AXES: tuple[Colour, ...] = ((0.82, 0.15, 0.12, 1.0), (0.18, 0.60, 0.28, 1.0), (0.14, 0.40, 0.80, 1.0))  # x, y, z
_AXIS, _THICK = 0.07, 0.006  # length of an axis and radius of a rod, shares of the robot's length
_LEAST = 1e-6  # m: shorter than that is no rod
_BARE = "Robot '{}' has no bodies. Its joint and tool frames are drawn instead, and the lines between them."
_THING_SIZE = 0.35  # m; obstacles smaller than this in every direction are coloured as things, the others as furniture


@dataclass(frozen=True, eq=False)
class SceneData:
    """Data that the page draws; poses are [x, y, z, qx, qy, qz, qw], m, arrays are base64 of float32.

    Attributes:
        name: of the problem; the page's title.
        geometries: each shape once.
        parts: `{set, name, owner, body, geometry, pose, colour}`, and of an obstacle that moves its `motion`, as in the
            problem; body 0 is the world, body j the robot's joint j;
            `owner` is the link, attachment or obstacle as reports name it; a robot without any geometry has its frames
            in the set `frame`.
        joints: names of the planned joints, short, and the body that each moves.
        bodies: how many joints move.
        start: poses of the joints at the start, (1, bodies, 7).
        goal: the same at the end to be reached, None when it is not known.
        targets: poses that the goal names, and those of the vias: the tool's where a via gives joint values.
        regions: goal regions, see `goal_marks.regions`.
        runs: motions to play, see `runs.run_for_page`.
        bound: lower bound of the problem, s, by which durations are divided, and what it is the least of.
        tool: body and pose in it of the robot's tool frame.
        several: whether the runs are of several problems; then every run has its own obstacles.
        note: remark on the picture; empty for none.
    """

    name: str
    geometries: tuple[dict[str, Any], ...]
    parts: tuple[dict[str, Any], ...]
    bodies: int
    joints: tuple[tuple[str, int], ...]
    start: str
    goal: str | None
    targets: tuple[list[float], ...]
    regions: tuple[dict[str, Any], ...]
    runs: tuple[dict[str, Any], ...]
    bound: tuple[float | None, str]
    tool: dict[str, Any] | None = None
    several: bool = False
    note: str = ""

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready form."""
        return asdict(self)


class _Parts:
    """Collects parts, and every geometry only once."""

    def __init__(self) -> None:
        self.geometries: list[dict[str, Any]] = []
        self.parts: list[dict[str, Any]] = []
        self._known: dict[Hashable, int] = {}

    def geometry(self, key: Hashable, make: Callable[[], dict[str, Any]]) -> int:
        """Return the index of the geometry of `make`, which is called once per key."""
        if key not in self._known:
            self._known[key] = len(self.geometries)
            self.geometries.append(make())
        return self._known[key]

    def add(self, kind: str, name: str | tuple[str, str], body: int, X: pin.SE3, geometry: int, colour: Colour) -> None:
        """A part of set `kind` at pose X in `body`, drawn as this geometry in this colour.

        The name is also that of its owner, unless both are given.
        """
        name, owner = (name, name) if isinstance(name, str) else name
        pose = [round(float(x), 9) for x in pin.SE3ToXYZQUAT(X)]
        self.parts.append(
            {
                "set": kind,
                "name": name,
                "owner": owner,
                "body": body,
                "geometry": geometry,
                "pose": pose,
                "colour": list(colour),
            }
        )


def build_scene(problem: Problem, runs: Sequence[RunLike]) -> SceneData:
    """Build the data to draw a problem and play its runs together.

    Raises:
        OptiPlanError: a run whose trajectory moves another number of joints than the problem's robot has.
    """
    given = [ViewedRun(*run) for run in runs]
    seeds = [f"seed {(run.record or {}).get('seed')}" for run in given]
    labels = distinct_labels([run.label for run in given], seeds)
    viewed = [run._replace(label=label) for run, label in zip(given, labels, strict=True)]
    for run in viewed:
        if run.trajectory is not None and len(run.trajectory.joint_names) != problem.robot.n:
            found, n = len(run.trajectory.joint_names), problem.robot.n
            raise OptiPlanError(f"run '{run.label}' moves {found} joints; robot '{problem.robot.name}' has {n}")
    parts = _Parts()
    several = len({(run.problem or problem).hash for run in viewed}) > 1
    moved = moved_by(problem.task) if viewed else frozenset()  # each run draws what it moves
    moving = frozenset(problem.scene.names) if several else moved
    bare = not problem.robot.visual.geometryObjects and not problem.robot.geometry.geometryObjects
    (_add_frames if bare else _add_robot)(parts, problem.robot)
    _add_objects(parts, problem, moving)
    ends = [run.trajectory for run in viewed if run.trajectory is not None]
    bound = common_bound(problem, _reached(viewed))
    detail = Detail.of(sum(motion_of(problem, run) is not None for run in viewed))
    goal = ends[0](np.array([ends[0].duration]))[0] if ends else None
    for end in problem.goal:
        if goal is None and isinstance(end, JointGoal):
            goal = end.q
    poses, shown = Poses(problem), []
    for run in viewed:
        own = run.problem or problem
        names = sorted({*own.scene.names, *moved_by(own.task)}) if several else sorted(moving)
        seen = run_for_page(own, Poses(own) if several else poses, run, detail)
        shown.append(seen | {"objects": _moving_objects(parts, own, names, run.trajectory)})
    return SceneData(
        name=", ".join(dict.fromkeys((run.problem or problem).name for run in viewed)) if several else problem.name,
        geometries=tuple(parts.geometries),
        parts=tuple(parts.parts),
        bodies=problem.robot.model.njoints - 1,
        joints=_joints(problem.robot),
        start=base64_of(poses.of(problem.start[None])[0]),
        goal=None if goal is None else base64_of(poses.of(goal[None])[0]),
        targets=targets(problem),
        regions=regions(problem, goal),
        runs=tuple(shown),
        tool=_tool(problem.robot),
        bound=(None, "the runs are of several problems") if several else (bound.seconds, bound.words),
        several=several,
        note=_BARE.format(problem.robot.name) if bare else "",
    )


def robot_parts(robot: Robot) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Geometries and parts of a robot alone, as in `SceneData`."""
    parts = _Parts()
    bare = not robot.visual.geometryObjects and not robot.geometry.geometryObjects
    (_add_frames if bare else _add_robot)(parts, robot)
    return parts.geometries, parts.parts


def _reached(runs: Sequence[ViewedRun]) -> list[Array]:
    """Ends of the verified runs."""
    verified = [run.trajectory for run in runs if run.report is not None and run.report.get("verified") is True]
    return [trajectory.end for trajectory in verified if trajectory is not None]


def _tool(robot: Robot) -> dict[str, Any]:
    frame = robot.model.frames[robot.frame_id(robot.tool_frame)]
    return {"body": int(frame.parentJoint), "pose": pin.SE3ToXYZQUAT(frame.placement).tolist()}


def _joints(robot: Robot) -> tuple[tuple[str, int], ...]:
    bodies = [int(robot.model.getJointId(name)) for name in robot.joint_names]
    return tuple(zip(short_names(robot.joint_names), bodies, strict=True))


def _add_robot(parts: _Parts, robot: Robot) -> None:
    """Add collision geometry, and visual geometry of the links that have it; others show collision geometry."""
    seen: set[int] = set()
    frames = robot.model.frames
    for thing in robot.visual.geometryObjects:
        seen.add(thing.parentFrame)
        _add_visual(parts, thing, str(frames[thing.parentFrame].name))
    for k, thing in enumerate(robot.geometry.geometryObjects):
        name = str(thing.name), robot.link_of(k)
        key = (thing.meshPath, tuple(thing.meshScale), thing.name)
        drawn = parts.geometry(("collision", key), partial(encode, thing.geometry))
        parts.add("collision", name, thing.parentJoint, thing.placement, drawn, _COLLISION)
        if thing.parentFrame not in seen:
            parts.add("visual", name, thing.parentJoint, thing.placement, drawn, _PLAIN)


def _add_frames(parts: _Parts, robot: Robot) -> None:
    """Add rods from the origin of each body to its children and to the tool, and the three axes at each end."""
    model = robot.model
    tool = model.frames[model.getFrameId(robot.tool_frame)]
    joints = range(1, model.njoints)
    ends: list[tuple[str, int, pin.SE3, int | None]] = [
        *((model.names[j], model.parents[j], model.jointPlacements[j], j) for j in joints),
        (tool.name, tool.parentJoint, tool.placement, None),
    ]
    size = sum(float(np.linalg.norm(X.translation)) for _, _, X, _ in ends) or 1.0
    for name, parent, X_BE, body in ends:
        if np.linalg.norm(X_BE.translation) > _LEAST:
            _add_rod(parts, name, parent, pin.SE3.Identity(), X_BE.translation, _THICK * size, _ROD)
        held, X = (parent, X_BE) if body is None else (body, pin.SE3.Identity())  # a joint's axes turn with it
        for axis, colour in zip(np.eye(3), _AXES, strict=True):
            _add_rod(parts, name, held, X, _AXIS * size * axis, 0.5 * _THICK * size, colour)


def _add_rod(parts: _Parts, name: str, body: int, X_BF: pin.SE3, way: Array, radius: float, colour: Colour) -> None:
    """Add the cylinder from the origin of frame F to the point `way` (3,) in it, m."""
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), way)
    cylinder = coal.Cylinder(radius, float(np.linalg.norm(way)))
    drawn = parts.geometry(("frame", cylinder.radius, cylinder.halfLength), partial(encode, cylinder))
    parts.add("frame", name, body, X_BF * pin.SE3(turn.matrix(), 0.5 * way), drawn, colour)


def _add_visual(parts: _Parts, thing: pin.GeometryObject, link: str) -> None:
    given = tuple(float(c) for c in thing.meshColor)
    own: Colour = _PLAIN if given[:3] in ((1.0, 1.0, 1.0), (0.0, 0.0, 0.0)) else (given[0], given[1], given[2], 1.0)
    if not isinstance(thing.geometry, coal.BVHModelBase):
        drawn = parts.geometry(("visual", thing.name), partial(encode, thing.geometry))
        parts.add("visual", (thing.name, link), thing.parentJoint, thing.placement, drawn, own)
        return
    key = ("visual", thing.meshPath, tuple(thing.meshScale))
    for i, surface in enumerate(visual_surfaces(thing)):
        drawn = parts.geometry((*key, i), surface.encoded)
        colour = surface.colour or own
        parts.add("visual", (thing.name, link), thing.parentJoint, thing.placement, drawn, colour)


def _moving_objects(
    parts: _Parts, problem: Problem, names: Sequence[str], trajectory: Trajectory | None
) -> list[dict[str, Any]]:
    """Return the objects of these names of a run: geometry, colour, and where they are from when on."""
    taken, held = moved_by(problem.task), {one.name for one in problem.scene.attached}
    found = []
    for one in object_stays(problem, trajectory, names):
        drawn = parts.geometry(one.shape, partial(_encode_shape, one.shape))
        stays = [
            {"begin": stay.begin, "body": stay.body, "pose": np.round(pin.SE3ToXYZQUAT(stay.X_BO), 9).tolist()}
            | ({"absent": True} if stay.absent else {})
            | ({} if stay.motion is None else {"motion": stay.motion.to_data()})
            for stay in one.stays
        ]
        colour = _NAMED.get(one.name.partition("_")[0])
        if one.name in taken and colour is None:
            colour = _OBJECTS[sorted(taken).index(one.name) % len(_OBJECTS)]
        colour = colour or (_HELD if one.name in held else obstacle_colour(one.shape))
        look = {"geometry": drawn, "colour": list(colour), "name": one.name, "owner": one.name}
        found.append(look | {"stays": stays})
    return found


def _add_objects(parts: _Parts, problem: Problem, moving: frozenset[str]) -> None:
    model = problem.robot.model
    for held in (held for held in problem.scene.attached if held.name not in moving):
        frame = model.frames[model.getFrameId(held.link)]
        drawn = parts.geometry(held.shape, partial(_encode_shape, held.shape))
        parts.add("attached", held.name, frame.parentJoint, frame.placement * held.X_LO, drawn, _HELD)
    for obstacle in (one for one in problem.scene.obstacles if one.name not in moving):
        drawn = parts.geometry(obstacle.shape, partial(_encode_shape, obstacle.shape))
        parts.add("obstacle", obstacle.name, 0, obstacle.X_WO, drawn, obstacle_colour(obstacle.shape))
        if obstacle.motion is not None:
            parts.parts[-1]["motion"] = obstacle.motion.to_data()


def _encode_shape(shape: Shape) -> dict[str, Any]:
    return encode(build_geometry(shape))


def obstacle_colour(shape: Shape) -> Colour:
    """Colour of an obstacle: things are small, furniture is large."""
    if shape.endless:
        return _FURNITURE
    box = build_geometry(shape).aabb_local
    return _THING if float(np.max(box.max_ - box.min_)) < _THING_SIZE else _FURNITURE
