"""How far a configuration is from each alternative of a goal, by one forward kinematics."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.poses import pose_error
from optiplan.kinematics.ik.joint_wraps import endless_turns
from optiplan.problem.problem import JointGoal, Problem
from optiplan.problem.regions.region import RegionGoal


@dataclass(frozen=True)
class GoalError:
    """Distance of a configuration from one alternative of the goal.

    Attributes:
        joint: largest joint error, rad or m, of a joint goal; None for a pose goal.
        position: distance, m, of a pose goal or from a region; None for a joint goal.
        orientation: angle, rad, of a pose goal or from a region; None for a joint goal.
        reached: whether all of them are within tolerance.
    """

    joint: float | None
    position: float | None
    orientation: float | None
    reached: bool


def goal_residual(problem: Problem, q: Array) -> list[GoalError]:
    """Return the errors of q (n,) with respect to every alternative of the goal, in their order."""
    model = problem.robot.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    errors = []
    for goal in problem.goal:
        if isinstance(goal, JointGoal):
            joint = float(np.abs(q - endless_turns(problem.robot, goal.q, q, 1)[0]).max())
            errors.append(GoalError(joint, None, None, joint <= goal.tolerance))
        elif isinstance(goal, RegionGoal):
            excess = goal.excess(data.oMf[model.getFrameId(goal.frame)])
            position, angle = (float(np.linalg.norm(part)) for part in (excess[:3], excess[3:]))
            errors.append(GoalError(None, position, angle, not excess.any()))
        else:
            position, angle = pose_error(data.oMf[model.getFrameId(goal.frame)], goal.X_WG)
            errors.append(GoalError(None, position, angle, position <= goal.position and angle <= goal.orientation))
    return errors
