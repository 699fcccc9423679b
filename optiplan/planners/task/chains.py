"""Do the steps that follow a move and leave no choice: lines, grippers, attaching, detaching, dwelling."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import zip_longest
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.collision.named_pairs import NamedPairs
from optiplan.geometry.poses import pose_error
from optiplan.planners.base import Budget, Failure
from optiplan.planners.cartesian.differential_ik import LIMIT_AVOIDANCES, Aim, Tracker, coupled_frames
from optiplan.planners.cartesian.path_following import follow
from optiplan.planners.cartesian.tool_path import FollowedPath, ToolPath, line
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.common.failures import end_collides, line_too_heavy
from optiplan.planners.common.gravity import Gravity
from optiplan.planners.task.blends import BlendedLine, Corner, LineSegment
from optiplan.planners.task.planned_steps import PlannedMotion, PlannedStep
from optiplan.planners.task.stages import Stage, Stages, WorldState
from optiplan.problem.problem import JointGoal
from optiplan.problem.task.scene_change import scene_after
from optiplan.problem.task.steps import (
    PARKED,
    Action,
    Attach,
    ChangeTool,
    Detach,
    Dwell,
    Event,
    Move,
    StraightLine,
    TaskStep,
)
from optiplan.records import dataclass
from optiplan.robot.frames import frame_pose
from optiplan.robot.robot import Robot
from optiplan.trajectory.timing.stops import stop_at_corners
from optiplan.trajectory.trajectory import Trajectory

_SAMPLES = 50
"""Configurations along a line at which gravity is checked."""

_STANDING = 1e-4
"""m: a lifted object stands on a body that is nearer than this."""

_ROUNDED = (1.0, 0.4, 0.0)
"""Shares of the blends of lines that are tried, in this order."""


@dataclass(frozen=True, eq=False)
class Chain:
    """Steps done one after another, and why the next cannot be, if it cannot."""

    steps: tuple[PlannedStep, ...]
    failure: Failure | None = None

    def after(self, before: WorldState) -> WorldState:
        """Return the state after the steps, from the state before them."""
        return self.steps[-1].after if self.steps else before

    def far(self) -> tuple[int, float]:
        """Return how far it came: steps, and the share of the one that failed."""
        share = 1.0 if self.failure is None else float(self.failure.witness.get("fraction", 0.0))
        return len(self.steps), share


def is_chained(step: TaskStep) -> bool:
    """Whether a step leaves no choice: any but a move of the arm."""
    return not isinstance(step.action, Move) or step.kind == "gripper"


def do_chain(stages: Stages, state: WorldState, steps: Sequence[TaskStep], budget: Budget) -> Chain:
    """Do steps without choice from a state, as far as they can be done.

    Corners are rounded by the radii of the steps, or less, or not at all where that fails.
    """
    blends = any(isinstance(step.action, StraightLine) and step.action.blend for step in steps)
    for share in _ROUNDED if blends else (0.0,):
        chain = _do_all(stages, state, steps, budget, share)
        if chain.failure is None or budget.over:
            break
    return chain


def _do_all(stages: Stages, state: WorldState, steps: Sequence[TaskStep], budget: Budget, rounded: float) -> Chain:
    """Do them with corners rounded by a share of the radii of the steps."""
    done: list[PlannedStep] = []
    corner: Corner | None = None
    for step, after in zip_longest(steps, steps[1:]):
        goes_on = after is not None and after.arm == step.arm and not after.waits
        found = _do(stages, state, step, budget, _LineEnds(corner, after.action if goes_on else None, rounded))
        if isinstance(found, Failure):
            return Chain(tuple(done), of_step(found, step, state, stages.problem.robot))
        done.append(found)
        state, corner = found.after, found.corner if isinstance(found, PlannedMotion) else None
    return Chain(tuple(done))


@dataclass(frozen=True, eq=False)
class _LineEnds:
    """The corner in which a line begins, what its arm goes on with, and the share of its blend that is used."""

    begins: Corner | None
    after: Action | None
    rounded: float

    def of(self, action: StraightLine, X: pin.SE3) -> tuple[ToolPath | BlendedLine, Corner | None]:
        """Return the path of a line from the frame's pose X, and the corner in which it ends."""
        start = X if self.begins is None else self.begins.X_WC
        end = line_end(action, start)
        if not action.blend * self.rounded or not isinstance(self.after, StraightLine):
            corner = None
        else:
            ways = LineSegment.between(start, end), LineSegment.between(end, line_end(self.after, end))
            corner = Corner.of(*ways, action.blend * self.rounded)
        way = self.begins.after if self.begins is not None else None if corner is None else corner.before
        return (line(start, end) if way is None else BlendedLine(way, self.begins, corner)), corner


def of_step(failure: Failure, step: TaskStep, state: WorldState, robot: Robot, stage: Stage | None = None) -> Failure:
    """Return a failure that names its step, with the configuration of the whole robot as its witness."""
    failure = failure if stage is None else stage.of_all_joints(failure, state)
    witness: dict[str, Any] = {**failure.witness, "step": step.number, "step_name": step.name}
    if "motion" in witness and stage is not None and len(stage.columns) < len(state.q):
        del witness["motion"]
    return replace(
        failure, detail=f"{step.words}: {failure.detail}{_remedy(failure, step, state, robot)}", witness=witness
    )


def _remedy(failure: Failure, step: TaskStep, state: WorldState, robot: Robot) -> str:
    """Return a remedy where an object touches the body that it stands on; empty for any other failure."""
    pair = list(failure.witness.get("pair", ()))
    taken = [step.action.body] if isinstance(step.action, Attach) else [one.name for one in state.scene.attached]
    body = next((name for name in taken if name in pair), None)
    if body is None:
        return ""
    other = next((name for name in pair if name != body), body)
    if other not in {one.name for one in state.scene.obstacles}:
        return ""
    if isinstance(step.action, Attach):
        distance, steps = float(failure.witness["distance"]), "this step and in that which lifts it"
    else:
        found = NamedPairs(robot, state.scene, [(body, other)]).clearance(state.q)
        distance, steps = np.inf if found is None else found.distance, "this step"
    if distance > _STANDING:
        return ""
    higher = 1e3 * (_STANDING + max(0.0, -distance))
    allowed = f"`allowed_collisions: [[{body}, {other}]]` in {steps}"
    return f"; '{body}' stands on '{other}': write {allowed}, or place '{body}' {higher:.3g} mm away from it"


def _do(stages: Stages, state: WorldState, step: TaskStep, budget: Budget, ends: _LineEnds) -> PlannedStep | Failure:
    action = step.action
    if isinstance(action, Event):
        return _event(stages, state, step, action)
    if isinstance(action, Dwell):
        return PlannedStep(step, state, state)
    if not isinstance(action, Move | StraightLine):
        raise TypeError("a tour or a path is planned as a section of its own")
    stage = stages.at(state, step, action.joints)
    corner: Corner | None = None
    if isinstance(action, Move):
        curve = _straight(stage, action)
    else:
        path, corner = ends.of(action, frame_pose(stage.problem.robot, stage.problem.start, action.frame))
        curve = _line(stage, action.frame, path, budget)
    if isinstance(curve, Failure):
        return stage.of_all_joints(curve, state)
    return PlannedMotion(step, state, stage.arrived(curve.end, state), stage.ending(curve.end), curve, corner)


def _event(stages: Stages, state: WorldState, step: TaskStep, action: Event) -> PlannedStep | Failure:
    if isinstance(action, ChangeTool) and (far := _beside_rack(stages.problem.robot, state, action)):
        return Failure("goal-unreachable", far, {"q": state.q.tolist()})
    scene = scene_after(state.scene, action, stages.problem.robot, state.q)
    after = WorldState(state.q, scene)
    stage = stages.at(after, step, stages.problem.robot.joint_names)
    failure = line_too_heavy(Gravity(stage.problem.robot, stage.problem.limits.torque), state.q[None], "there")
    if stage.model.collides(state.q):
        failure = end_collides(stage.model, state.q, "goal")
    if failure is None:
        return PlannedStep(step, state, after)
    words = failure.detail.removeprefix("goal configuration: ")
    return replace(failure, detail=f"as soon as '{action.body}' is {_PAST_TENSE[type(action)]}, {words}")


def _beside_rack(robot: Robot, state: WorldState, action: ChangeTool) -> str:
    """Return in words how far a link is from where a tool is parked; empty where it is there."""
    for tool, X_WP in action.racks:
        position, angle = pose_error(frame_pose(robot, state.q, tool.link), X_WP)
        if position > PARKED[0] or angle > PARKED[1]:
            return (
                f"'{tool.link}' is {1e3 * position:.3g} mm and {angle:.3g} rad from where '{tool.name}' is parked; "
                f"a line or move of the frame '{tool.link}' to that pose leads there"
            )
    return ""


_PAST_TENSE = {Attach: "held", Detach: "released", ChangeTool: "changed"}


def _straight(stage: Stage, action: Move) -> Trajectory | Failure:
    """Move the joints of a gripper straight to their goal."""
    goal = action.goal[0]
    assert isinstance(goal, JointGoal)
    problem = stage.problem
    motion = stop_at_corners(np.array([problem.start, goal.q]), problem.limits, problem.robot.joint_names)
    touch = first_contact(stage.ending(goal.q).model, motion)
    return motion if touch is None else Failure("collision", touch.words, touch.witness())


def _line(stage: Stage, frame: str, path: FollowedPath, budget: Budget) -> Trajectory | Failure:
    """Follow a line, and check gravity along it; a redundant arm tries several avoidances of limits."""
    problem = stage.problem
    gravity = Gravity(problem.robot, problem.limits.torque)
    failures: list[Failure] = []
    touching = stage.touching
    for avoidance in LIMIT_AVOIDANCES[: 2 if problem.robot.n > 6 else 1]:
        aim = Aim(None, avoidance, coupled=coupled_frames(problem, frame))
        tracker = Tracker(problem.robot, problem.limits, frame, path, aim)
        found = follow(touching.model, tracker, problem.start, budget)
        if isinstance(found, Trajectory):
            refused = line_too_heavy(gravity, found(np.linspace(0.0, found.duration, _SAMPLES)))
            refused = refused or _too_near(stage, touching, found)
            if refused is None:
                return found
            found = refused
        failures.append(found)
    return failures[0]


def _too_near(stage: Stage, touching: Stage, curve: Trajectory) -> Failure | None:
    """Return where a curve that touches nothing comes nearer than is asked; None where it does not."""
    if touching is stage:
        return None
    touch = first_contact(stage.ending(curve.end).model, curve)
    return None if touch is None else Failure("collision", touch.words, touch.witness())


def line_end(action: StraightLine, start: pin.SE3) -> pin.SE3:
    """Return the pose at which a line from `start` ends: that before which it begins, or `start` moved by `by`."""
    if action.by is None:
        X_GB = pin.SE3.Identity() if action.X_GB is None else action.X_GB
        return min((end.X_WG for end in action.ends), key=lambda X: _miss(start, X * X_GB))
    by: Array = start.rotation @ action.by if action.in_tool else action.by
    return pin.SE3(start.rotation, start.translation + by)


def _miss(X: pin.SE3, other: pin.SE3) -> float:
    position, angle = pose_error(X, other)
    return position + angle
