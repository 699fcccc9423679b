"""Read the steps of a task, checked against the robot, the scene and each other."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import zip_longest
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.config.messages import choices
from optiplan.config.simple_yaml import Place
from optiplan.geometry.pose import PoseGoalSpec
from optiplan.geometry.scene import Attachment, Obstacle, Scene
from optiplan.problem.builder import Compiler
from optiplan.problem.constraints.base import WHOLE, unit
from optiplan.problem.constraints.statements import PathConstraint, frame_of
from optiplan.problem.goals_and_vias import Goal, JointGoal, PoseGoal, Via
from optiplan.problem.grasps.places import places
from optiplan.problem.grasps.reading import ending_region, grasp_ends
from optiplan.problem.partial import LocatedValue
from optiplan.problem.schema.ends import ENDS, RATES, AlternativeSpec, ViaSpec
from optiplan.problem.schema.seam import SeamSpec
from optiplan.problem.schema.task import (
    ApproachSpec,
    AttachSpec,
    DetachSpec,
    GripperSpec,
    MoveSpec,
    RetreatSpec,
    StraightLineSpec,
    TaskStepSpec,
)
from optiplan.problem.schema.tour import TourSpec
from optiplan.problem.seams.actions import SeamPath
from optiplan.problem.seams.reading import read_path
from optiplan.problem.task.arms import steps_of_arms
from optiplan.problem.task.arms_reading import with_arms
from optiplan.problem.task.choices_reading import ChoiceReader, InHand
from optiplan.problem.task.rides import WaitUntil
from optiplan.problem.task.rides_reading import RideReader
from optiplan.problem.task.scene_change import held_body
from optiplan.problem.task.steps import (
    Action,
    Attach,
    ChangeTool,
    Detach,
    Dwell,
    Event,
    Move,
    StraightLine,
    TargetTour,
    TaskStep,
)
from optiplan.problem.task.tour_reading import read_tour
from optiplan.problem.tools.reading import ToolsInUse
from optiplan.problem.tools.tool import NONE, stated_alone
from optiplan.robot.frames import frame_names, link_names, with_tool_of
from optiplan.robot.robot import Robot

Located = LocatedValue[TaskStepSpec]

_BESIDE_LINES = ("gripper", "dwell")
"""Steps that lead no tool: constraints in them are about that of their arm."""


class TaskReader:
    """Turns the steps of a file into statements; errors go to the compiler's issues."""

    def __init__(self, compiler: Compiler, robot: Robot, scene: Scene, tools: ToolsInUse) -> None:
        """Read steps of a robot without the frames of what it has in hand, which `tools` know."""
        self.compiler, self.scene, self.tools = compiler, scene, tools
        self._mounted, self.robot = robot, tools.seen(robot)
        own = stated_alone(scene)
        self._held = {held.name for held in own.attached}
        self._free = {obstacle.name for obstacle in own.obstacles}
        self._moved: set[str] = set()
        self.rides = RideReader(compiler, own)
        self._choices = ChoiceReader(compiler, self._state, self._restore)

    def steps(self) -> list[LocatedValue[TaskStep]]:
        """Return the valid steps; an approach gives two."""
        found: list[LocatedValue[TaskStep]] = []
        kinds = {part.value.kind for part in self.compiler.task}
        if kinds and kinds <= {"attach", "detach", "tool"}:
            self.compiler.report(("task",), "steps that take no time", "one besides that does, such as a dwell")
        for part in self.compiler.task:
            spec, number = part.value, int(part.place[-1]) + 1
            self._choices.at(part.place, part.value.option)
            kept = [
                LocatedValue((*part.place, "path_constraints", i), one) for i, one in enumerate(spec.path_constraints)
            ]
            group = getattr(getattr(spec, spec.kind), "group", None)
            robot = self._with_tool_of((spec.arm if spec.kind in _BESIDE_LINES else None) or group)
            located = self.compiler.constraints(robot, self.scene, kept)
            constraints = tuple(one.value for one in located)
            allowed = self._allowed(part)
            name = spec.name or _name(spec)
            for said in self._actions(part):
                action, ride = self.rides.ridden(robot, (*part.place, spec.kind), spec, said)
                self._whole_step(spec.kind, action, located)
                if isinstance(action, Event):
                    self.robot = self.tools.seen(self._mounted)
                freely = spec.kind == "approach" and isinstance(action, Move)  # contact is for the line
                touch = frozenset[frozenset[str]]() if freely else allowed
                option = None if spec.option is None else (spec.option[0], spec.option[1])
                step = TaskStep(
                    number, spec.kind, name, action, touch, constraints, spec.arm or "", ride=ride, option=option
                )
                found.append(LocatedValue(part.place, step))
        if found:
            self._choices.at(found[-1].place, None)
            self.rides.end(found[-1].place)
        self._choices.check([one.value for one in found])
        found = with_arms(self.compiler, self.robot, self.scene, found)
        for own in steps_of_arms([one.value for one in found]).values():
            for k, after in zip_longest(own, own[1:]):
                alike = after is not None and found[after].value.option == found[k].value.option
                self._corner(found[k], found[after].value.action if alike and after is not None else None)
        return [one._replace(value=self._with_frame(one.value)) for one in found]

    def _whole_step(self, kind: str, action: Action, constraints: Sequence[LocatedValue[PathConstraint]]) -> None:
        """Report constraints on a part of a step that is several motions: each of these would have that part."""
        several = _several(kind, action)
        for one in constraints if several else ():
            if tuple(one.value.during) != WHOLE:
                found = f"{list(one.value.during)} of {several}, which is several motions"
                self.compiler.report((*one.place, "during"), found, "no `during`: the whole step")

    def _state(self) -> InHand:
        tools, rides = self.tools, self.rides
        return InHand(set(self._held), set(self._free), set(self._moved), tools.now, dict(tools.held), rides.state)

    def _restore(self, state: InHand) -> None:
        self._held, self._free, self._moved = set(state.held), set(state.free), set(state.moved)
        self.tools.now, self.tools.held = state.tool, dict(state.links)
        self.rides.state = state.ride
        self.robot = self.tools.seen(self._mounted)

    def check_whole(self, constraints: Iterable[LocatedValue[PathConstraint]]) -> None:
        """Report constraints of the whole motion on a frame that is gone once a step releases its object.

        And on a tool frame that is not named, which is another one once a step changes the tool.
        """
        changes = any(part.value.kind == "tool" for part in self.compiler.task)
        released = {part.value.detach.object for part in self.compiler.task if part.value.detach is not None}
        for part in constraints:
            frame, (key, k, kind) = frame_of(part.value), part.place
            if changes and frame is not None and self.compiler.document.data[key][k][kind].get("frame") is None:
                expected = f"`frame`, such as '{frame}', or the constraint in each step"
                self.compiler.report(part.place, "no `frame`, in a task that changes the tool", expected)
            for mention in part.value.mentioned():
                if mention.kind == "frame" and mention.name in released:
                    found = f"'{mention.name}', which a step of the task releases"
                    expected = "the constraint in each step that holds it, or a frame of the robot"
                    self.compiler.report((*part.place, *mention.place), found, expected)

    def _with_frame(self, step: TaskStep) -> TaskStep:
        """Return a step that takes an object with its frame, where goals or constraints are about that."""
        action = step.action
        if not isinstance(action, Attach) or action.body not in self.compiler.followed:
            return step
        return replace(step, action=replace(action, framed=True))

    def _corner(self, part: LocatedValue[TaskStep], after: Action | None) -> None:
        """Report a blend without a line of the same frame and joints after it."""
        action = part.value.action
        if not isinstance(action, StraightLine) or not action.blend:
            return
        if isinstance(after, StraightLine) and (after.frame, after.joints) == (action.frame, action.joints):
            return
        other = "a line of other joints or another frame" if isinstance(after, StraightLine) else "no line"
        found = f"a blend, and {other} after it"
        expected = f"a line or retreat of '{action.frame}', with the same joints, right after it"
        self.compiler.report((*part.place, part.value.kind, "blend"), found, expected)

    def _allowed(self, part: Located) -> frozenset[frozenset[str]]:
        tools = [body.name for tool in self.tools.by_name.values() for body in tool.bodies]
        bodies = {*link_names(self.robot.model), *self.scene.names, *tools}
        for k, pair in enumerate(part.value.allowed_collisions):
            for i, name in enumerate(pair):
                if name not in bodies and self.compiler.sound_tools:
                    self.compiler.unknown((*part.place, "allowed_collisions", k, i), "body", name, bodies)
        return frozenset(frozenset(pair) for pair in part.value.allowed_collisions)

    def _actions(self, part: Located) -> Iterator[Action]:
        readers: dict[str, Callable[[Place, Any], Iterator[Action]]] = {
            "move": self._move,
            "line": self._line,
            "approach": self._approach,
            "retreat": self._retreat,
            "attach": self._attach,
            "detach": self._detach,
            "gripper": self._gripper,
            "dwell": lambda _, seconds: iter([Dwell(seconds)]),
            "tour": partial(self._along, read_tour),
            "tool": self._tool,
            "path": partial(self._along, read_path),
            "wait_until": self._wait,
        }
        kind = part.value.kind
        return readers[kind]((*part.place, kind), getattr(part.value, kind))

    def _wait(self, place: Place, condition: str) -> Iterator[WaitUntil]:
        found = self.rides.waited(place, condition)
        if found is not None:
            yield found

    def _along(
        self, read: Callable[..., TargetTour | SeamPath | None], place: Place, spec: TourSpec | SeamSpec
    ) -> Iterator[TargetTour | SeamPath]:
        """Yield the tour or the path of a step."""
        joints = self._joints(place, spec.group)
        found = read(self.compiler, self._with_tool_of(spec.group), place, spec, joints or ())
        if found is not None and joints is not None:
            yield found

    def _joints(self, place: Place, group: str | None) -> tuple[str, ...] | None:
        """Return the joints of a group, in the robot's order; None where there is none of that name."""
        if group is not None and group not in self.robot.groups:
            self.compiler.unknown((*place, "group"), "group", group, self.robot.groups)
            return None
        return self.compiler.joints_of(self.robot, group)

    def _with_tool_of(self, group: str | None) -> Robot:
        """Return the robot with the tool frame of a group, if that is not the problem's and has one of its own."""
        return with_tool_of(self.robot, group, self.compiler.main_joints)

    def _alone(self, joints: Sequence[str], group: str | None) -> Robot:
        """Return the robot with only these joints planned; where the others stand does not matter here."""
        names, limits = self.robot.joint_names, self.robot.limits
        places = zip(names, np.clip(np.zeros(len(names)), limits.lower, limits.upper), strict=True)
        return self._with_tool_of(group).holding({name: q for name, q in places if name not in joints})

    def _move(self, place: Place, spec: MoveSpec) -> Iterator[Move]:
        joints = self._joints(place, spec.group)
        if joints is None:
            return
        alone = self._alone(joints, spec.group)
        goal = self._ends(alone, place, spec)
        vias = self._vias(alone, place, spec.via)
        if goal:
            yield Move(joints, goal, vias)

    def _ends(self, robot: Robot, place: Place, spec: MoveSpec) -> Goal:
        if spec.any_of is not None:
            parts = [LocatedValue((*place, "any_of", i), one) for i, one in enumerate(spec.any_of)]
            for part in parts:
                for rate in RATES:
                    if part.value.rates(rate) is not None:
                        self.compiler.report((*part.place, rate), f"{rate} at the end of a step", "an end at rest")
        else:
            kind = next(kind for kind in ENDS if getattr(spec, kind) is not None)
            parts = [LocatedValue(place, AlternativeSpec(**{kind: getattr(spec, kind)}))]
        found = [self.compiler.alternative(robot, part) for part in parts]
        return tuple(end for end in found if end is not None)

    def _vias(self, robot: Robot, place: Place, specs: Sequence[ViaSpec]) -> tuple[Via, ...]:
        found = []
        for k, spec in enumerate(specs):
            at = self.compiler.passed(robot, LocatedValue((*place, "via", k), spec))
            for wish in ("velocity", "time"):
                if getattr(spec, wish) is not None:
                    self.compiler.report((*place, "via", k, wish), "a wish", "none in a task: its times are free")
            if at is not None:
                found.append(Via(at))
        return tuple(found)

    def _pose(self, place: Place, spec: PoseGoalSpec, group: str | None) -> PoseGoal | None:
        return self.compiler.pose_goal(self._with_tool_of(group), place, spec)

    def _line(self, place: Place, spec: StraightLineSpec) -> Iterator[StraightLine]:
        joints = self._joints(place, spec.group)
        speed, blend = _speed(spec), spec.blend or 0.0
        if spec.pose is not None:
            end = self._pose((*place, "pose"), spec.pose, spec.group)
            if end is not None and joints is not None:
                yield StraightLine(joints, end.frame, (end,), speed=speed, blend=blend)
            return
        frame = self._frame(place, spec)
        by, axes = np.array(spec.by, float), self.rides.axes(place, spec.in_)
        by = by if axes is None else axes @ by
        if not np.linalg.norm(by) > 0.0:
            self.compiler.report((*place, "by"), "no distance at all", "a vector of some length, m")
        elif frame is not None and joints is not None:
            yield StraightLine(joints, frame, (), by, axes is None, speed, blend)

    def _approach(self, place: Place, spec: ApproachSpec) -> Iterator[Move | StraightLine]:
        joints = self._joints(place, spec.group)
        given = [((*place, "pose"), spec.pose)] if spec.pose is not None else []
        given += [((*place, "any_of", i), one) for i, one in enumerate(spec.any_of or ())]
        ends = tuple(end for at, one in given if (end := self._pose(at, one, spec.group)) is not None)
        robot, along = self._with_tool_of(spec.group), unit(spec.along)
        if spec.grasps is not None:
            stated = (*place, "grasps"), spec.grasps, along
            ends = grasp_ends(self.compiler, robot, stated, self.scene, self._moved)
        region = None if spec.region is None else ending_region(self.compiler, robot, (*place, "region"), spec.region)
        ends += () if region is None else tuple(places(region))
        if joints is None or not ends or len(ends) < len(given):
            return
        vias = self._vias(self._alone(joints, spec.group), place, spec.via)
        if len({end.frame for end in ends}) > 1:
            self.compiler.report((*place, "any_of"), "poses of several frames", "poses of one frame")
            return
        X_GB = pin.SE3(np.eye(3), -spec.distance * along)
        yield Move(joints, tuple(replace(end, X_WG=end.X_WG * X_GB) for end in ends), vias)
        line = StraightLine(joints, ends[0].frame, ends, speed=_speed(spec), blend=spec.blend or 0.0)
        yield replace(line, X_GB=X_GB, region=region)

    def _retreat(self, place: Place, spec: RetreatSpec) -> Iterator[StraightLine]:
        joints, frame = self._joints(place, spec.group), self._frame(place, spec)
        if joints is not None and frame is not None:
            axes = self.rides.axes(place, spec.in_)
            by = spec.distance * unit(spec.along or (0.0, 0.0, -1.0 if axes is None else 1.0))
            by = by if axes is None else axes @ by
            yield StraightLine(joints, frame, (), by, axes is None, _speed(spec), spec.blend or 0.0)

    def _frame(self, place: Place, spec: StraightLineSpec | RetreatSpec) -> str | None:
        if spec.frame is None or spec.frame in frame_names(self.robot.model):
            self.compiler.followed.update([spec.frame] if spec.frame else [])
            return spec.frame or self._with_tool_of(spec.group).tool_frame
        self.compiler.unknown((*place, "frame"), "frame", spec.frame, frame_names(self.robot.model))
        return None

    def _gripper(self, place: Place, spec: GripperSpec) -> Iterator[Move]:
        joints = self._joints(place, spec.group)
        if joints is None:
            return
        q = self.compiler.configuration(self._alone(joints, spec.group), place, spec)
        if q is not None:
            yield Move(joints, (JointGoal(q),))

    def _tool(self, place: Place, name: str) -> Iterator[ChangeTool]:
        """Change the tool; from one rack to another takes a step for each."""
        if not self.compiler.sound_tools:
            return
        names, now = [*self.tools.by_name, NONE], NONE if self.tools.now is None else self.tools.now.name
        if name not in names or name == now:
            found = f"'{name}', which is mounted here" if name == now != NONE else f"unknown tool '{name}'"
            found = "no tool to leave" if name == now == NONE else found
            self.compiler.report(place, found, choices(name, [one for one in names if one != now]))
            return
        change = self.tools.change(name)
        if len(change.racks) == 2:
            found = f"'{name}' in place of '{now}', which have racks of their own"
            self.compiler.report(place, found, f"`tool: {NONE}` where '{now}' is parked, and later `tool: {name}`")
        yield change

    def _attach(self, place: Place, spec: AttachSpec) -> Iterator[Attach]:
        links = link_names(self.robot.model)
        for at, name in [(("link",), spec.link), *((("touch", i), name) for i, name in enumerate(spec.touch))]:
            if name not in links:
                self.compiler.unknown((*place, *at), "link", name, links)
        if not self._known((*place, "object"), spec.object, "attached", self._held, self._free):
            return
        bodies: list[Obstacle | Attachment] = [*self.scene.obstacles, *self.scene.attached]
        body = next(one for one in bodies if one.name == spec.object)
        if body.shape.endless:
            self.compiler.report((*place, "object"), f"'{body.name}', a half-space", "a shape that ends somewhere")
            return
        taken = Attach(spec.object, spec.link, frozenset(spec.touch), spec.mass, spec.centre, spec.inertia)
        if not self.compiler.weighable(place, held_body(body, taken, pin.SE3.Identity())):
            return
        self.tools.take(spec.object, spec.link)
        self._moved.add(spec.object)
        if spec.link in links:
            yield taken

    def _detach(self, place: Place, spec: DetachSpec) -> Iterator[Detach]:
        if self._known((*place, "object"), spec.object, "released", self._free, self._held):
            self.tools.held.pop(spec.object, None)
            yield Detach(spec.object)

    def _known(self, place: Place, name: str, done: str, there: set[str], needed: set[str]) -> bool:
        """Record that an object is moved from one set of names to the other; False, and an issue, if it cannot be."""
        if name in needed:
            needed.remove(name)
            there.add(name)
            return True
        found = f"unknown object '{name}'"
        if name in there:
            found = f"'{name}', which is {'held already' if done == 'attached' else 'not held here'}"
        self.compiler.report(place, found, choices(name, sorted(needed)))
        return False


def _several(kind: str, action: Action) -> str:
    """Return what a step that is several motions is called, at the last of its actions; empty for any other."""
    if isinstance(action, TargetTour):
        return "a tour"
    if isinstance(action, SeamPath) and action.events:
        return "a path with events"
    return "an approach" if kind == "approach" and isinstance(action, StraightLine) else ""


def _speed(spec: StraightLineSpec | ApproachSpec | RetreatSpec) -> float:
    return np.inf if spec.speed is None else spec.speed


def _name(spec: TaskStepSpec) -> str:
    """Return what a step without a name of its own is called."""
    about = {"attach": spec.attach, "detach": spec.detach}.get(spec.kind)
    if spec.kind == "tool":
        return f"tool {spec.tool}"
    return spec.kind if about is None else f"{spec.kind} {about.object}"
