"""Find the joint path of the chosen scheme along one screw, or the place of its failure."""

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.planners.base import Budget, Failure
from optiplan.planners.cartesian.diagnosis import Ending, at_limit, first_refusal, other_branch, stuck
from optiplan.planners.cartesian.differential_ik import Aim, Tracker
from optiplan.planners.cartesian.tool_path import screw
from optiplan.planners.sclerp.interpolation import on_screw, through
from optiplan.planners.sclerp.options import SclerpOptions
from optiplan.planners.sclerp.qp_stepping import ScrewMotion, ScrewStepper, SteppedPath
from optiplan.planners.sclerp.schemes import SchemeResult, iterate_scheme
from optiplan.planners.sclerp.screw_kinematics import ScrewTool
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory


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
    refused = first_refusal(model, task.tool.robot, path, budget)
    return path if refused is None else task.failure(replace(refused, s=refused.s / path.duration))


def _by_quadratic_programs(task: ScrewTask, options: SclerpOptions, budget: Budget) -> Trajectory | Failure:
    stepper = ScrewStepper(task.tool, ScrewMotion(task.tool.pose(task.start), task.X_WG), options, task.goal)
    stepped = stepper.step_along(task.start, options.iterations, lambda: budget.over)
    task.info.update(iterations=len(stepped.s) - 1, programs=stepped.programs)
    if not stepped.complete:
        return _stopped(task, stepper, stepped, options)
    ending = other_branch(task.tool.robot, stepped.Q[-1], task.goal if task.exact else None)
    if ending is not None:
        return task.failure(ending)
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
    return stuck(Tracker(tool.robot, tool.robot.limits, tool.frame, ahead, Aim()), s, q)


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
