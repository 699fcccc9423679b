"""Read which steps of a task go with something that moves, and what is waited for."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.config.simple_yaml import Place
from optiplan.geometry.obstacle_motion import ObstacleMotion
from optiplan.geometry.pose import pose_of
from optiplan.geometry.scene import Scene
from optiplan.kinematics.ik.numeric import joints_that_move
from optiplan.problem.builder import Compiler
from optiplan.problem.goals_and_vias import PoseGoal
from optiplan.problem.grasps.places import unbounded
from optiplan.problem.partial import fit, mapping
from optiplan.problem.regions.region import RegionGoal
from optiplan.problem.schema.scene import OF_LINES, TOOL, WORLD, MovingFrameSpec
from optiplan.problem.schema.task import ApproachSpec, RetreatSpec, StraightLineSpec, TaskStepSpec
from optiplan.problem.task.rides import LONGEST, Mover, Ride, WaitUntil, split_condition
from optiplan.problem.task.steps import Action, Attach, Detach, Dwell, Move, StraightLine
from optiplan.records import dataclass
from optiplan.robot.robot import Robot

FREE = frozenset({"move", "approach"})
"""Steps that begin a ride where their ends move, and end one where they do not."""

_ALONG = 1e-6
"""rad between a direction and the axis of a turn along which it counts as one along it."""


@dataclass(frozen=True, eq=False)
class RideState:
    """What a `RideReader` knows before a step."""

    now: Ride | None
    motions: Mapping[str, ObstacleMotion | None]
    unclear: bool

    @property
    def at_rest(self) -> bool:
        """Whether the arm goes with nothing."""
        return self.now is None


class RideReader:
    """With what the arm goes while the steps of a task are read.

    Attributes:
        now: the ride of the step before; None: that step was done in the world.
        motions: of objects that are no longer where the file puts them: None where they stand, or are held.
    """

    def __init__(self, compiler: Compiler, scene: Scene) -> None:
        self._compiler = compiler
        self.movers = {name: _mover(name, said) for name, said in _frames(compiler).items()}
        for body in scene.dynamic_obstacles:
            if body.motion is not None:
                self.movers[body.name] = Mover(body.name, body.motion, body.X_WO)
        self.now: Ride | None = None
        self._unclear = False
        self.motions: Mapping[str, ObstacleMotion | None] = {one.name: one.motion for one in scene.obstacles}

    @property
    def state(self) -> RideState:
        """What is known now."""
        return RideState(self.now, self.motions, self._unclear)

    @state.setter
    def state(self, state: RideState) -> None:
        self.now, self.motions, self._unclear = state.now, state.motions, state.unclear

    def ridden(self, robot: Robot, place: Place, spec: TaskStepSpec, action: Action) -> tuple[Action, Ride | None]:
        """Return the action, and with what the step goes; what does not fit is reported."""
        if isinstance(action, Move) and spec.kind in FREE:
            self._unclear = False
            self.now = self._begun(robot, place, getattr(spec, spec.kind), action)
            return action, self.now
        ride = self.now
        if ride is not None and not robot.model.existFrame(ride.frame):
            found = f"a {spec.kind} after '{ride.frame}', which went with '{ride.mover.name}', is released"
            self._report(place, found, "a move, that does not go with it")
        if isinstance(action, StraightLine):
            self._line(place, getattr(spec, spec.kind), action)
        elif isinstance(action, Attach):
            self._attach(place, action)
            self.motions = {**self.motions, action.body: None}
        elif isinstance(action, Detach):
            mover = None if ride is None else ride.mover
            self.motions = {**self.motions, action.body: None if mover is None else mover.motion}
            return replace(action, mover=mover), ride
        elif ride is not None and isinstance(action, Move):
            if shared := set(action.joints) & set(ride.joints):
                found = f"{min(shared)}, a joint that goes with '{ride.mover.name}'"
                self._report((*place, "group"), found, "other joints, such as those of the fingers")
        elif ride is not None and not isinstance(action, Dwell | WaitUntil):
            found = f"a {spec.kind} while the arm goes with '{ride.mover.name}'"
            self._report(place, found, "a move before, that does not go with it")
        return action, ride

    def axes(self, place: Place, name: str) -> Array | None:
        """Return the axes (3, 3) of the frame that a line says its direction in; None: those of the tool."""
        if name == TOOL:
            return None
        if name != WORLD and name not in self.movers:
            self._compiler.unknown((*place, "in"), "frame", name, [*OF_LINES, *self.movers])
        elif name != WORLD and (self.now is None or self.now.mover.motion.key != self.movers[name].motion.key):
            found = f"'{name}', which moves, while the arm does not go with it"
            self._report((*place, "in"), found, f"a move or an approach to a pose `in: {name}` before")
        return np.asarray(self.movers[name].X_WO.rotation) if name in self.movers else np.eye(3)

    def waited(self, place: Place, text: str) -> WaitUntil | None:
        """Return a condition that comes true some time."""
        parts = split_condition(text)
        if parts is None:
            expected = "NAME.x > NUMBER: a frame or obstacle that moves; x, y, z, m, or angle, rad; >, >=, < or <="
            self._report(place, f"'{text}'", expected)
            return None
        name, axis, relation, value = parts
        mover = self.movers.get(name)
        if mover is None:
            self._compiler.unknown(place, "moving frame or obstacle", name, self.movers or ["none: nothing moves"])
            return None
        if axis == "angle" and mover.motion.axis is None:
            self._report(place, f"the angle of '{name}', which does not turn", "x, y or z")
            return None
        found = WaitUntil(mover, axis, relation, value)
        if not math.isfinite(value) or found.first(0.0) is None:
            self._report(place, f"'{text}', which never comes true", f"what holds within {LONGEST:g} s")
            return None
        return found

    def end(self, place: Place) -> None:
        """Report a task that ends while the arm goes with something."""
        if self.now is not None:
            found = f"a task that ends while the arm goes with '{self.now.mover.name}'"
            self._report(place, found, "a move at the end, in which it comes to rest")

    def of_object(self, name: str) -> Mover | None:
        """Return what moves an object that the file puts somewhere; None where it stands."""
        return self.movers.get(name) if self.motions.get(name) is not None else None

    def _begun(self, robot: Robot, place: Place, spec: Any, action: Move) -> Ride | None:
        name, mover = spec.rides, None
        if isinstance(spec, ApproachSpec) and spec.grasps is not None:
            mover = self.of_object(spec.grasps.object)
        if name is not None:
            mover = self.movers.get(name)
            if mover is None:
                known = self.movers or ["none: nothing moves"]
                if name not in mapping(mapping(self._compiler.document.data).get("frames")):  # else it is unreadable
                    self._compiler.unknown((*place, "rides"), "moving frame or obstacle", name, known)
                self._unclear = True
        if mover is None:
            return None
        frames = {end.frame for end in action.goal if isinstance(end, PoseGoal | RegionGoal)}
        if len(frames) != 1 or not all(isinstance(end, PoseGoal | RegionGoal) for end in action.goal):
            self._report(place, f"ends that cannot move with '{mover.name}'", "poses or regions of one frame")
            self._unclear = True
            return None
        for i, end in enumerate(action.goal):
            if isinstance(end, RegionGoal) and (endless := unbounded(end)):
                at = (*place, *(() if spec.any_of is None else ("any_of", i)), "region", "along")
                self._report(at, f"a region with no bound {endless}", "a bound along each axis, m, where it moves")
        if action.vias:
            self._report((*place, "via"), f"vias on the way to '{mover.name}', which moves", "a move of its own before")
        frame = frames.pop()
        lead = zip(robot.joint_names, joints_that_move(robot, frame), strict=True)
        return Ride(mover, frame, tuple(name for name, leads in lead if leads and name in action.joints))

    def _line(self, place: Place, spec: StraightLineSpec | ApproachSpec | RetreatSpec, action: StraightLine) -> None:
        ride, rides = self.now, getattr(spec, "rides", None)
        line = isinstance(spec, StraightLineSpec)
        if rides is not None and line:
            mover = self.movers.get(rides)
            if mover is None or ride is None or mover.motion.key != ride.mover.motion.key:
                found = f"a pose in '{rides}', which moves, while the arm does not go with it"
                self._report((*place, "pose"), found, f"a move or an approach to a pose `in: {rides}` before")
                return
        if ride is None:
            return
        if line and action.by is None and rides is None:
            found = f"a pose in the world while the arm goes with '{ride.mover.name}'"
            self._report((*place, "pose"), found, f"`in: {ride.mover.name}`, or a move before")
        turning = ride.mover.motion.axis
        if turning is not None and action.by is not None and getattr(spec, "in_", "") == WORLD:
            if np.linalg.norm(np.cross(action.by, turning)) > _ALONG * np.linalg.norm(action.by):
                found = f"a direction in the world while the arm goes with '{ride.mover.name}', which turns"
                self._report((*place, "in"), found, f"`in: {ride.mover.name}`, or a direction along the axis")
        if action.frame != ride.frame or not set(ride.joints) <= set(action.joints):
            found = f"a line of '{action.frame}' while '{ride.frame}' goes with '{ride.mover.name}'"
            self._report(place, found, "a line of the same frame with the same joints")
        if action.blend:
            self._report((*place, "blend"), f"a blend while the arm goes with '{ride.mover.name}'", "exact corners")

    def _attach(self, place: Place, action: Attach) -> None:
        motion, ride = self.motions.get(action.body), self.now
        if motion is None and ride is not None:
            found = f"'{action.body}', which stands, while the arm goes with '{ride.mover.name}'"
            self._report((*place, "object"), found, "an object that moves along")
        elif motion is not None and (ride is None or motion.key != ride.mover.motion.key):
            found = f"'{action.body}', which moves, while the arm does not go with it"
            expected = f"an approach before to a pose `in: {action.body}`, or in what moves along with it"
            self._report((*place, "object"), found, expected)

    def _report(self, place: Place, found: str, expected: str) -> None:
        """Report what does not fit; nothing where it is not clear with what the arm goes, which has been reported."""
        if not self._unclear:
            self._compiler.report(place, found, expected)


def _frames(compiler: Compiler) -> dict[str, MovingFrameSpec]:
    """Return the valid frames that move."""
    said = mapping(mapping(compiler.document.data).get("frames"))
    found = {str(name): fit(MovingFrameSpec, one) for name, one in said.items()}
    return {name: spec for name, spec in found.items() if spec is not None}


def _mover(name: str, spec: MovingFrameSpec) -> Mover:
    return Mover(name, spec.motion.about(spec.position), pose_of(spec))
