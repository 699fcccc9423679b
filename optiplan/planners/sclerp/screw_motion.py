"""Find the joint path of the chosen scheme along one screw, or the place of its failure."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget, Failure
from optiplan.planners.cartesian.diagnosis import Ending, at_limit, limit_crossing, stuck
from optiplan.planners.cartesian.differential_ik import Aim, Tracker
from optiplan.planners.cartesian.tool_path import screw
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.common.failures import contact_witness
from optiplan.planners.common.refused_path import refused_path
from optiplan.planners.sclerp.interpolation import on_screw, through
from optiplan.planners.sclerp.options import SclerpOptions
from optiplan.planners.sclerp.qp_stepping import ScrewMotion, ScrewStepper, SteppedPath
from optiplan.planners.sclerp.schemes import SchemeResult, iterate_scheme
from optiplan.planners.sclerp.screw_kinematics import ScrewTool
from optiplan.trajectory.trajectory import Trajectory

_GOAL_TOLERANCE = 1e-6  # rad or m


@dataclass(frozen=True, eq=False)
class ScrewTask:
    """From `start` (n,), rad or m, to X_WG; a redundant arm is led to `goal` (n,), and must end there if `exact`.

    `info`, JSON-ready, is filled in on the way: steps of the scheme, quadratic programs, knots of the path.
    """

    tool: ScrewTool
    start: Array
    X_WG: pin.SE3
    goal: Array | None
    exact: bool
    info: dict[str, Any]

    def failure(self, ending: Ending) -> Failure:
        """Return the failure of a motion that ends so, with the pose of the tool there."""
        return ending.failure(self.tool.pose(ending.q))

    def at_limit(self, s: float, q: Array, joint: int) -> Failure:
        """Return the failure where joint limits do not let the tool go on."""
        return self.failure(at_limit(self.tool.robot, s, q, joint, "is at"))


def attempt(model: CollisionModel, task: ScrewTask, options: SclerpOptions, budget: Budget) -> Trajectory | Failure:
    """Return a free joint path q(s) within limits, twice continuously differentiable, or the failure.

    Under `qp` the tool is within 1e-6 m and rad of its screw for all s; other schemes promise no tolerance.
    """
    find = _by_quadratic_programs if options.scheme == "qp" else _by_iteration
    path = find(task, options, budget)
    if isinstance(path, Failure):
        return path
    crossing = limit_crossing(path, task.tool.robot.limits)
    if crossing is not None:
        s, joint = crossing
        refused = task.at_limit(s / path.duration, path(np.array([s]))[0], joint)
        return _shown(refused, path, s, model)
    touch = first_contact(model, path, lambda: budget.over)
    if touch is None:
        return path
    s, q, more = touch.t / path.duration, touch.q, contact_witness(touch.q, touch.contact)
    refused = task.failure(Ending(s, q, "collision", "obstacle", touch.contact.meeting, more))
    return _shown(refused, path, touch.t, model)


def _shown(failure: Failure, path: Trajectory, s: float, model: CollisionModel) -> Failure:
    """Return the failure with the path that was refused at s, as a motion."""
    shown = refused_path([path], 0, s, model.robot.limits)
    return replace(failure, witness={**failure.witness, **shown})


def _by_quadratic_programs(task: ScrewTask, options: SclerpOptions, budget: Budget) -> Trajectory | Failure:
    stepper = ScrewStepper(task.tool, ScrewMotion(task.tool.pose(task.start), task.X_WG), options, task.goal)
    stepped = stepper.step_along(task.start, options.iterations, lambda: budget.over)
    task.info.update(iterations=len(stepped.s) - 1, programs=stepped.programs)
    if not stepped.complete:
        return _stopped(task, stepper, stepped, options)
    end = stepped.Q[-1]
    if task.goal is not None and task.exact and np.abs(end - task.goal).max() > _GOAL_TOLERANCE:
        j = int(np.argmax(np.abs(end - task.goal)))
        name = task.tool.robot.joint_names[j]
        words = f"the screw ends in another configuration, '{name}' at {end[j]:.4g} instead of {task.goal[j]:.4g}"
        more = {"joint": name, "goal": task.goal.tolist()}
        return task.failure(Ending(1.0, end, "no-path", "branch", words, more))
    path = on_screw(stepper, stepped, lambda: budget.over)
    task.info["knots"] = len(path.breakpoints)
    return path


def _stopped(task: ScrewTask, stepper: ScrewStepper, stepped: SteppedPath, options: SclerpOptions) -> Failure:
    s, q = float(stepped.s[-1]), stepped.Q[-1]
    if stepped.blocked is not None:
        return task.at_limit(s, q, stepped.blocked)
    if len(stepped.s) > options.iterations:
        return _used_up(task, s, q, options)
    tool = task.tool
    ahead = screw(stepper.screw.X_W0, task.X_WG)
    return stuck(Tracker(tool.robot, tool.frame, ahead, Aim()), s, q)


def _by_iteration(task: ScrewTask, options: SclerpOptions, budget: Budget) -> Trajectory | Failure:
    try:
        found = iterate_scheme(task.tool, task.start, task.X_WG, options, lambda: budget.over)
    except np.linalg.LinAlgError:
        words = "J Jᵀ has no inverse: singular, or fewer than six joints"
        return task.failure(Ending(0.0, task.start, "singularity", "singularity", words, {}))
    task.info.update(iterations=found.iterations, error=found.error, limit_hits=int(found.hits.any(axis=1).sum()))
    if found.converged:
        return through(task.tool.robot.joint_names, found.Q)
    s, q = _share(task, found), found.Q[-1]
    if not np.isfinite(q).all() or not found.hits[-1:].any():
        return _used_up(task, s, found.Q[0] if not np.isfinite(q).all() else q, options)
    return task.at_limit(s, q, int(np.argmax(found.hits.sum(axis=0) * found.hits[-1])))


def _used_up(task: ScrewTask, s: float, q: Array, options: SclerpOptions) -> Failure:
    words = f"{options.iterations} steps of the scheme '{options.scheme}' do not lead to the goal"
    return task.failure(Ending(s, q, "no-path", "iterations", words, {}))


def _share(task: ScrewTask, found: SchemeResult) -> float:
    """Return the share of the way made from start to goal, by the length of the twist that is left; 0 to 1."""
    left, whole = (
        float(np.linalg.norm(pin.log6(task.tool.pose(q).actInv(task.X_WG)))) for q in (found.Q[-1], found.Q[0])
    )
    return max(0.0, 1.0 - left / whole) if whole > 0.0 else 0.0
