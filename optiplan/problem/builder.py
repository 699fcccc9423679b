"""Build models and arrays from the parts of a problem file, checked against the robot; collect every issue."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.config.document import Document, Number
from optiplan.config.messages import choices, describe
from optiplan.config.simple_yaml import Place
from optiplan.config.values import FileName, Name, NamePair, Vector
from optiplan.errors import InputError, Issue, UnknownChoiceError, os_reason
from optiplan.files import hindrance
from optiplan.geometry.file_shapes import FileShape
from optiplan.geometry.meshes.reading import open_mesh
from optiplan.geometry.pose import PoseGoalSpec, PoseSpec, ToleranceSpec, pose_of
from optiplan.geometry.scene import Attachment, Obstacle, Scene
from optiplan.geometry.shape import Shape
from optiplan.geometry.shapes import ShapeSpec, build_geometry, shape_from_spec
from optiplan.problem.goals_and_vias import AllOfGoal, GoalEnd, JointGoal, PoseGoal, Via
from optiplan.problem.partial import (
    LocatedValue,
    alternatives,
    fit,
    fits,
    mapping,
    stated_constraints,
    stated_steps,
    stated_tools,
)
from optiplan.problem.regions.region import RegionGoal
from optiplan.problem.regions.schema import RegionSpec
from optiplan.problem.schema.ends import RATES, AlternativeSpec, ConfigurationSpec, PlacedFrameSpec, StartSpec, ViaSpec
from optiplan.problem.schema.scene import AttachedSpec, ObstacleSpec
from optiplan.robot.frames import frame_names, link_names
from optiplan.robot.mounting import GRAVITY, Mounting
from optiplan.robot.reference import ROBOTS
from optiplan.robot.robot import DESCRIPTION, Robot, load_robot, robot_file

if TYPE_CHECKING:
    from optiplan.problem.constraints.statements import PathConstraint, PathConstraintSpec


RobotLoader = Callable[[str | Mapping[str, Any], Path | None, Mapping[str, float] | None, str | None], Robot]
"""`load_robot`, or what stands in for it: reference, folder it is relative to, locked joints, group."""

HIT = 1e-6
"""Default tolerance of a via, rad or m."""


class Compiler:
    """One pass over a problem file; errors go to `issues`, and the part concerned becomes None.

    Each part is read by itself: none hides what is wrong with another. `main_joints` are those of the problem's own
    group, once there is a robot. `followed` are the frames that goals and constraints name;
    `sound_tools` says whether every tool is as it should be: where one is not, nothing is said of steps that name it.
    """

    def __init__(self, document: Document, base: Path, data: Any) -> None:
        """Read `data`, that of the document or a whole `ProblemSpec`; meshes are relative to `base`."""
        self.document, self.base = document, base
        self.issues: list[Issue] = []
        self.main_joints: tuple[str, ...] = ()
        self.followed: set[str] = set()
        root = mapping(data)
        scene = mapping(root.get("scene"))
        self._robot = fit(FileName | dict[str, Any], root.get("robot"))
        self._group = fit(Name, root.get("group"))
        self._locked: Mapping[str, float] = fit(dict[str, Number], root.get("locked", {})) or {}
        self._base, self._gravity = fit(PoseSpec, root.get("base")), fit(Vector, root.get("gravity"))
        self.start_spec: StartSpec | None = fit(StartSpec, root.get("start"))
        self.goal_specs = alternatives(root.get("goal"))
        self.task = stated_steps(root.get("task"))
        self._vias = fits(("via",), ViaSpec, root.get("via"))
        self._constraints = stated_constraints(root.get("path_constraints"))
        self._obstacles = fits(("scene", "obstacles"), ObstacleSpec, scene.get("obstacles"))
        self._attached = fits(("scene", "attached"), AttachedSpec, scene.get("attached"))
        self.tools = stated_tools(root)
        own = [name for place, name, _ in self.tools if place == ("tool",)]
        self.mounted_tool: str | None = own[0] if own else fit(Name, root.get("tool"))
        named, first = mapping(root.get("tools")), root.get("tool")
        self.sound_tools = len(self.tools) == len(named) + (first is not None and not isinstance(first, str))
        self._allowed = fits(("scene", "allowed_collisions"), NamePair, scene.get("allowed_collisions"))

    def report(self, place: Place, found: str, expected: str) -> None:
        """Record one issue."""
        self.issues.append(self.document.issue(place, found, expected))

    def robot(self, load: RobotLoader = load_robot) -> Robot | None:
        """The robot, with the joints that the problem locks; those of all groups that a task moves are planned."""
        if self._robot is None:
            return None
        try:
            file = None if isinstance(self._robot, Mapping) else robot_file(self._robot, self.base)
            if file is not None and (why := hindrance(file)):
                valid = "a robot of `optiplan robots`, or the path of a robot.yaml"
                self.report(("robot",), f"'{self._robot}', but {why}", valid)
                return None
            robot = load(self._robot, self.base, self._locked, self._group)
            self.main_joints = robot.joint_names
            more = self._more_groups(robot)
            if more and robot.group is None:
                self.report(("group",), "no name of a group", f"one to plan besides {' and '.join(more)}")
                return None
            if more:
                locked = {name: q for name, q in self._locked.items() if name not in _joints(robot, more)}
                robot = load(self._robot, self.base, locked, "+".join([str(robot.group), *more]))
            return robot
        except UnknownChoiceError as error:
            place = (error.kind,) if error.kind in ("robot", "group") else ("locked",)
            self.report(place, f"unknown {error.kind} '{error.found}'", choices(error.found, error.choices))
        except OSError as error:  # a name that no file can have
            found = f"{describe(self._robot)} ({os_reason(error)})"
            self.report(("robot",), found, "a robot of `optiplan robots`, or the path of a robot.yaml")
        except InputError as error:
            self.issues.extend(map(self._relocated, error.issues))
        return None

    def joints_at(self, robot: Robot, place: Place) -> tuple[str, ...] | None:
        """Return the joints whose values stand at a place, in the robot's order; None where no such group is known."""
        if place[0] != "task":
            return robot.joint_names
        step = self.document.data["task"][place[1]]
        group = step[place[2]].get("group", step.get("arm"))
        known = group is None or (isinstance(group, str) and group in robot.groups)
        return self.joints_of(robot, group) if known else None

    def joints_of(self, robot: Robot, group: str | None) -> tuple[str, ...]:
        """Return the joints of a group, in the robot's order; those of the problem without a group."""
        if group is None:
            return self.main_joints
        return tuple(name for name in robot.joint_names if name in set(robot.groups[group]))

    def _more_groups(self, robot: Robot) -> list[str]:
        """Return the groups that steps of the task name and that are not planned anyway."""
        named: list[str] = []
        for part in self.task:
            group = getattr(getattr(part.value, part.value.kind), "group", None) or ""
            if group in robot.groups and not set(robot.groups[group]) <= set(robot.joint_names):
                named.append(group)
        return list(dict.fromkeys(named))

    def _relocated(self, issue: Issue) -> Issue:
        """Attribute the robot reader's issues about locked joints or an inline robot to the problem file."""
        inline = isinstance(self._robot, Mapping) and Path(issue.file).name == DESCRIPTION
        of_arms = isinstance(self._robot, Mapping) and ROBOTS in self._robot and issue.path[:1] == ("locked",)
        if inline and not of_arms:
            return self.document.issue(("robot", *issue.path), issue.found, issue.expected)
        if issue.path not in [("locked", name) for name in self._locked]:
            return issue
        return self.document.issue(issue.path, issue.found, issue.expected)

    def start(self, robot: Robot) -> JointGoal | None:
        """The state at the start."""
        return None if self.start_spec is None else self._state(robot, LocatedValue(("start",), self.start_spec))

    def goal(self, robot: Robot) -> list[LocatedValue[GoalEnd]]:
        """Return the valid alternatives."""
        ends = [(part.place, self.alternative(robot, part)) for part in self.goal_specs]
        return [LocatedValue(place, end) for place, end in ends if end is not None]

    def vias(self, robot: Robot) -> list[LocatedValue[Via]]:
        """Return the valid vias."""
        vias: list[LocatedValue[Via]] = []
        for part in self._vias:
            at, velocity = self.passed(robot, part), self._velocity(robot, part)
            if at is not None:
                vias.append(LocatedValue(part.place, Via(at, velocity, part.value.time)))
        return vias

    def constraints(
        self, robot: Robot, scene: Scene, parts: "Sequence[LocatedValue[PathConstraintSpec]] | None" = None
    ) -> "list[LocatedValue[PathConstraint]]":
        """Return the valid path constraints: those of the whole motion, or `parts`."""
        if not (parts := self._constraints if parts is None else parts):
            return []
        from optiplan.problem.constraints.motions import WheelSpeed
        from optiplan.problem.constraints.statements import KINDS

        found: list[LocatedValue[PathConstraint]] = []
        valid = {
            "frame": {*frame_names(robot.model), robot.tool_frame},
            "body": {*link_names(robot.model), *scene.names},
            "joint": set(robot.joint_names),
        }
        for part in parts:
            place = (*part.place, part.value.kind)
            one = KINDS[part.value.kind].of(part.value.value, robot.tool_frame)
            wrong = [mention for mention in one.mentioned() if mention.name not in valid[mention.kind]]
            for where, kind, name in wrong:
                self.unknown((*place, *where), kind, name, valid[kind])
            self.followed.update(mention.name for mention in one.mentioned() if mention.kind == "frame")
            wheelless = isinstance(one, WheelSpeed) and robot.mecanum is None
            if wheelless:
                self.report(place, f"{robot.name}, which has no wheels", "a robot file with `mecanum`")
            if not wrong and not wheelless:
                found.append(LocatedValue(place, one))
        return found

    def passed(self, robot: Robot, part: LocatedValue[ViaSpec]) -> JointGoal | PoseGoal | None:
        """Return where a via is passed, if that is valid."""
        spec = part.value
        tolerance = HIT if spec.tolerance is None else spec.tolerance
        if spec.pose is None:
            q = self.configuration(robot, part.place, spec)
            return None if q is None else JointGoal(q, tolerance)
        both = spec.pose.tolerance or ToleranceSpec(position=tolerance, orientation=tolerance)
        pose = PoseGoalSpec(**spec.pose.model_dump(exclude={"tolerance"}), tolerance=both)
        return self.pose_goal(robot, (*part.place, "pose"), pose)

    def _velocity(self, robot: Robot, part: LocatedValue[ViaSpec]) -> Array | None:
        if part.value.velocity is None:
            return None
        place, v, limit = (*part.place, "velocity"), np.array(part.value.velocity, float), robot.limits.velocity
        if not self._one_each(robot, place, v):
            return None
        for j in np.flatnonzero(np.abs(v) > limit):
            found = f"{robot.joint_names[j]} = {v[j]:.10g} {robot.unit('velocity', int(j))}, beyond its limit"
            self.report((*place, int(j)), found, f"a value in [{-limit[j]:.10g}, {limit[j]:.10g}]")
        return v

    def alternative(self, robot: Robot, part: LocatedValue[AlternativeSpec]) -> GoalEnd | None:
        """Return one end, if it is valid."""
        if part.value.all_of is not None:
            return self._all_of(robot, (*part.place, "all_of"), part.value.all_of)
        if part.value.region is not None:
            return self.region(robot, (*part.place, "region"), part.value.region)
        if part.value.pose is None:
            return self._state(robot, part)
        return self.pose_goal(robot, (*part.place, "pose"), part.value.pose)

    def _all_of(self, robot: Robot, place: Place, specs: Sequence[PlacedFrameSpec]) -> AllOfGoal | None:
        """Return the goal of several frames, if each is valid."""
        parts: list[PoseGoal | RegionGoal | None] = []
        for k, spec in enumerate(specs):
            if spec.pose is not None:
                pose = spec.pose if spec.frame is None else spec.pose.model_copy(update={"frame": spec.frame})
                parts.append(self.pose_goal(robot, (*place, k, "pose"), pose))
            elif spec.region is not None:
                region = spec.region if spec.frame is None else spec.region.model_copy(update={"frame": spec.frame})
                parts.append(self.region(robot, (*place, k, "region"), region))
        found = tuple(part for part in parts if part is not None)
        return AllOfGoal(found) if len(found) == len(parts) else None

    def _state(self, robot: Robot, part: LocatedValue[StartSpec] | LocatedValue[AlternativeSpec]) -> JointGoal | None:
        """A configuration with its velocity and acceleration, of as many values."""
        q = self.configuration(robot, part.place, part.value)
        rates: list[Array | None] = []
        for key in RATES:
            said, rate = getattr(part.value, key), part.value.rates(key)
            rates.append(None if rate is None else np.array(rate, float))
            if said is not None and not self._one_each(robot, (*part.place, key), said):
                q = None
        return None if q is None else JointGoal(q, velocity=rates[0], acceleration=rates[1])

    def pose_goal(self, robot: Robot, place: Place, spec: PoseGoalSpec) -> PoseGoal | None:
        """Return the goal of a pose, if its frame is known."""
        frame, tolerance = self.frame(robot, place, spec.frame), spec.tolerance
        return None if frame is None else PoseGoal(frame, pose_of(spec), tolerance.position, tolerance.orientation)

    def region(self, robot: Robot, place: Place, spec: RegionSpec) -> RegionGoal | None:
        """Return the goal of a region, if its frame is known."""
        frame = self.frame(robot, place, spec.frame)
        return None if frame is None else RegionGoal(frame, *spec.region())

    def frame(self, robot: Robot, place: Place, name: str | None) -> str | None:
        """Return the frame of a goal, the tool frame without a name, if it is known."""
        frame = robot.tool_frame if name is None else name
        if frame != robot.tool_frame and frame not in frame_names(robot.model):
            self.unknown((*place, "frame"), "frame", frame, frame_names(robot.model))
            return None
        self.followed.add(frame)
        return frame

    def configuration(self, robot: Robot, place: Place, spec: ConfigurationSpec) -> Array | None:
        """Return the joint values of one of `CONFIGURATIONS`, (n,), rad or m, if there are n within the limits."""
        place = (*place, spec.way)
        if spec.configuration is not None:
            if spec.configuration not in robot.configurations:
                self.unknown(place, "configuration", spec.configuration, robot.configurations)
                return None
            q = np.array(robot.configurations[spec.configuration], float)
        else:
            q = np.array(getattr(spec, spec.way), float)
        if not self._one_each(robot, place, q):
            return None
        if spec.joints_deg is not None:
            q = np.where(robot.revolute, np.deg2rad(q), q)
        return q if self._within_limits(robot, place, q) else None

    def _one_each(self, robot: Robot, place: Place, values: Sequence[float] | Array) -> bool:
        expected = f"{robot.n} values, one for each of {', '.join(robot.joint_names)}"
        if len(values) != robot.n:
            self.report(place, f"{len(values)} values", expected)
        return len(values) == robot.n

    def _within_limits(self, robot: Robot, place: Place, q: Array) -> bool:
        lower, upper = robot.limits.lower, robot.limits.upper
        outside = np.flatnonzero(robot.limits.outside(q)).tolist()
        for j in outside:
            at = (*place, j) if place[-1] in ("joints", "joints_deg") else place
            degrees = place[-1] == "joints_deg" and bool(robot.revolute[j])
            value, low, high = np.rad2deg([q[j], lower[j], upper[j]]) if degrees else (q[j], lower[j], upper[j])
            unit = "degrees" if degrees else robot.unit("position", j)
            meant = "; for degrees: joints_deg" if not degrees and unit == "rad" and abs(q[j]) > 2.0 * np.pi else ""
            found = f"{robot.joint_names[j]} = {value:.10g} {unit}, outside its limits"
            self.report(at, found, f"a value in [{low:.10g}, {high:.10g}] {unit}{meant}")
        return len(outside) == 0

    def scene(self, robot: Robot | None) -> Scene:
        """Return the valid bodies, and the allowed pairs whose names are known."""
        obstacles, attached = [], []
        for part in self._obstacles:
            shape = self.shape((*part.place, "shape"), part.value.shape)
            if shape is not None:
                motion, at = part.value.motion, part.value.pose.position
                moves = None if motion is None else motion.about(at)
                obstacles.append(Obstacle(part.value.name, shape, *stated_pose(part.value.pose), moves))
        for held in self._attached:
            shape = self.shape((*held.place, "shape"), held.value.shape)
            touch = frozenset(held.value.touch)
            if shape is not None:
                X_LO, stated = stated_pose(held.value.pose)
                spec = held.value
                weight = spec.mass, spec.centre, spec.inertia
                body = Attachment(spec.name, shape, spec.link, X_LO, touch, stated, *weight)
                if self.weighable(held.place, body):
                    attached.append(body)
        if robot is not None:
            self._names(robot)
        allowed = frozenset(frozenset(pair.value) for pair in self._allowed)
        return Scene(tuple(obstacles), tuple(attached), allowed)

    def weighable(self, place: Place, body: Attachment) -> bool:
        """Whether the body has an inertia, if it has a mass."""
        try:
            body.inertia_in_link()
        except ValueError as error:
            self.report((*place, "mass"), str(error), "`centre` and `inertia` beside the mass")
            return False
        return True

    def mounted(self, robot: Robot, scene: Scene) -> Robot:
        """The robot where it stands, with what it carries."""
        links = set(link_names(robot.model))
        payload = [(held.link, held.inertia_in_link()) for held in scene.attached if held.mass and held.link in links]
        gravity = GRAVITY if self._gravity is None else self._gravity
        X_WB = pin.SE3.Identity() if self._base is None else pose_of(self._base)
        return robot.mounted(Mounting(X_WB, np.array(gravity), tuple(payload)))

    def shape(self, place: Place, spec: ShapeSpec) -> Shape | None:
        """Return a shape; None where its file cannot be read."""
        shape = shape_from_spec(spec)
        return self._from_file((*place, spec.kind, "file"), shape) if isinstance(shape, FileShape) else shape

    def _from_file(self, place: Place, stated: FileShape) -> FileShape | None:
        valid = stated.wanted
        try:
            file = (self.base / stated.file).resolve()
        except (OSError, ValueError) as error:  # a name that no file can have
            reason = (isinstance(error, OSError) and error.strerror) or str(error)
            self.report(place, f"{describe(str(stated.file))} ({reason.lower()})", valid)
            return None
        try:
            shape = replace(stated, file=file, key=open_mesh(file, stated.kind).key)
            build_geometry(shape)
        except ValueError as error:
            missing = isinstance(error.__cause__, FileNotFoundError)
            self.report(place, f"'{stated.file}', but there is no file {file}" if missing else str(error), valid)
            return None
        return shape

    def _names(self, robot: Robot) -> None:
        """Check that names are unique among links, obstacles and attachments, and that names referred to exist."""
        links = link_names(robot.model)
        taken = dict.fromkeys(links, "a link of the robot")
        bodies = [(part.place, part.value.name, "an obstacle") for part in self._obstacles]
        bodies += [(part.place, part.value.name, "an attached object") for part in self._attached]
        for place, name, kind in bodies:
            if name in taken:
                found = f"'{name}', which is already the name of {taken[name]}"
                self.report((*place, "name"), found, "a name of its own")
            taken.setdefault(name, kind)
        taken |= {body: "a tool" for _, name, spec in self.tools for body in spec.bodies_of(name)}
        for held in self._attached:
            if held.value.link not in links:
                self.unknown((*held.place, "link"), "link", held.value.link, links)
            for i, name in enumerate(held.value.touch):
                if name not in links:
                    self.unknown((*held.place, "touch", i), "link", name, links)
        for pair in self._allowed:
            for i, name in enumerate(pair.value):
                if name not in taken:
                    self.unknown((*pair.place, i), "body", name, taken)

    def unknown(self, place: Place, kind: str, found: str, valid: Iterable[str]) -> None:
        """Record a name that is not among the valid ones."""
        self.report(place, f"unknown {kind} '{found}'", choices(found, sorted(valid)))


def _joints(robot: Robot, groups: Iterable[str]) -> set[str]:
    return {name for group in groups for name in robot.groups[group]}


def stated_pose(spec: PoseSpec) -> tuple[pin.SE3, dict[str, Any]]:
    """A pose, and the words in which it was said."""
    return pose_of(spec), spec.model_dump(mode="json", exclude_none=True)
