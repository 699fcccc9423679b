"""Do the steps that follow a move and leave no choice: lines, grippers, what is held, dwelling."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.kinematics.ik.numeric import pose_error
from optiplan.kinematics.jacobians import frame_pose
from optiplan.planners.base import Budget, Failure
from optiplan.planners.cartesian.differential_ik import Aim, gone_together
from optiplan.planners.cartesian.path_following import follow
from optiplan.planners.cartesian.tool_path import line
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.common.failures import end_collides
from optiplan.planners.task.stages import Situation, Stage, Stages
from optiplan.problem.problem import JointGoal
from optiplan.problem.task.scene_change import scene_after
from optiplan.problem.task.steps import Attach, Detach, Dwell, Move, StraightLine, TaskStep
from optiplan.trajectory.timing.stops import stop_at_corners
from optiplan.trajectory.trajectory import Trajectory

_AVOIDANCES = (4.0, 20.0)  # of limits, by arms with more joints than they need; tried in this order


@dataclass(frozen=True, eq=False)
class Done:
    """A step that can be done.

    Attributes:
        step: the step.
        before: state in which it begins.
        after: state in which it ends.
        stage: of the joints that move; None where none does.
        curve: their motion: timed, or of a line its path over s from 0 to 1; None where none moves.
    """

    step: TaskStep
    before: Situation
    after: Situation
    stage: Stage | None = None
    curve: Trajectory | None = None

    @property
    def is_line(self) -> bool:
        """Whether `curve` is the path of a line."""
        return isinstance(self.step.action, StraightLine)


@dataclass(frozen=True, eq=False)
class Chain:
    """Steps done one after another, and why the next cannot be, if it cannot."""

    done: tuple[Done, ...]
    failure: Failure | None = None

    def far(self) -> tuple[int, float]:
        """How far it came: steps, and the share of the one that failed."""
        share = 1.0 if self.failure is None else float(self.failure.witness.get("fraction", 0.0))
        return len(self.done), share


def is_chained(step: TaskStep) -> bool:
    """Whether a step leaves nothing to be chosen: anything but a move that is not a gripper's."""
    return not isinstance(step.action, Move) or step.kind == "gripper"


def do_chain(stages: Stages, state: Situation, steps: Sequence[TaskStep], budget: Budget) -> Chain:
    """Do steps without choice from a state, as far as they can be done."""
    done: list[Done] = []
    for step in steps:
        found = _do(stages, state, step, budget)
        if isinstance(found, Failure):
            return Chain(tuple(done), of_step(found, step, state))
        done.append(found)
        state = found.after
    return Chain(tuple(done))


def of_step(failure: Failure, step: TaskStep, state: Situation, stage: Stage | None = None) -> Failure:
    """Return a failure that names its step, with the configuration of the whole robot as its witness."""
    witness: dict[str, Any] = {**failure.witness, "step": step.number, "step_name": step.name}
    q = witness.get("q")
    if q is not None and stage is not None and len(q) == len(stage.columns):
        witness["q"] = stage.whole(np.asarray(q, float), state).tolist()
    if "motion" in witness and stage is not None and len(stage.columns) < len(state.q):
        del witness["motion"]
    return replace(failure, detail=f"{step.words}: {failure.detail}", witness=witness)


def _do(stages: Stages, state: Situation, step: TaskStep, budget: Budget) -> Done | Failure:
    action = step.action
    if isinstance(action, Attach | Detach):
        return _event(stages, state, step, action)
    if isinstance(action, Dwell):
        return Done(step, state, state)
    stage = stages.at(state, step, action.joints)
    curve = _straight(stage, action) if isinstance(action, Move) else _line(stage, action, state, budget)
    if isinstance(curve, Failure):
        q = curve.witness.get("q")
        if q is not None and len(q) == len(stage.columns):
            whole = stage.whole(np.asarray(q, float), state).tolist()
            return replace(curve, witness={**curve.witness, "q": whole})
        return curve
    return Done(step, state, Situation(stage.whole(curve.end, state), state.scene), stage, curve)


def _event(stages: Stages, state: Situation, step: TaskStep, action: Attach | Detach) -> Done | Failure:
    scene = scene_after(state.scene, action, stages.problem.robot, state.q)
    after = Situation(state.q, scene)
    stage = stages.at(after, step, stages.problem.robot.joint_names)
    if stage.model.collides(state.q):
        failure = end_collides(stage.model, state.q, "goal")
        words = failure.detail.removeprefix("goal configuration: ")
        return replace(failure, detail=f"as soon as '{action.body}' is {_PAST[type(action)]}, {words}")
    return Done(step, state, after)


_PAST = {Attach: "held", Detach: "released"}


def _straight(stage: Stage, action: Move) -> Trajectory | Failure:
    """Move the joints of a gripper straight to where they shall be."""
    goal = action.goal[0]
    assert isinstance(goal, JointGoal)
    problem = stage.problem
    motion = stop_at_corners(np.array([problem.start, goal.q]), problem.limits, problem.robot.joint_names)
    touch = first_contact(stage.model, motion)
    if touch is None:
        return motion
    pair = touch.contact.pair
    return Failure("collision", f"'{pair.name_a}' meets '{pair.name_b}'", touch.witness())


def _line(stage: Stage, action: StraightLine, state: Situation, budget: Budget) -> Trajectory | Failure:
    """Follow the line; a redundant arm tries several ways to use its freedom."""
    problem = stage.problem
    start = frame_pose(problem.robot, problem.start, action.frame)
    path = line(start, line_end(action, start))
    first: Failure | None = None
    for avoidance in _AVOIDANCES[: 2 if problem.robot.n > 6 else 1]:
        aim = Aim(None, avoidance, together=gone_together(problem, action.frame))
        found = follow(stage.model, path, (action.frame, problem.start), budget, aim)
        if isinstance(found, Trajectory):
            return found
        first = first or found
    assert first is not None
    return first


def line_end(action: StraightLine, start: pin.SE3) -> pin.SE3:
    """Return the pose at which a line from `start` ends: the nearest of its ends, or `start` moved by its vector."""
    if action.by is None:
        return min((end.X_WG for end in action.ends), key=lambda X: _miss(start, X))
    by: Array = start.rotation @ action.by if action.in_tool else action.by
    return pin.SE3(start.rotation, start.translation + by)


def _miss(X: pin.SE3, other: pin.SE3) -> float:
    position, angle = pose_error(X, other)
    return position + angle
