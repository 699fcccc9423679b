"""What planners are given where the robot's joints may be off the motion: narrower limits and constraints."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from optiplan.arrays import Array
from optiplan.problem.goals_and_vias import JointGoal
from optiplan.problem.problem import Problem, derived
from optiplan.problem.tracking_error import narrower_limits
from optiplan.robot.robot import Robot

if TYPE_CHECKING:
    from optiplan.problem.constraints.statements import PathConstraint


_LEFT = 0.2
"""Share of a tolerance that planners have at least: the bounds here hold anywhere, the verifier's where the arm is."""


def planned_in_tube(problem: Problem) -> Problem:
    """Return the problem that a planner is given: its motions keep the limits and constraints of `problem` in the tube.

    Position limits are narrower by the error; tolerances of path constraints by what it can do to a frame anywhere:
    those of a task's steps where the planner knows what the robot holds by then. The clearance is that of the planners'
    collision models, which know the error. The verifier has `problem` itself.
    """
    if not problem.tracking_error.any():
        return problem
    ends = [one.q for one in (*problem.goal, *(via.at for via in problem.vias)) if isinstance(one, JointGoal)]
    narrower = narrower_limits(problem.limits, problem.tracking_error, np.array([problem.start, *ends]))
    return derived(problem, limits=narrower, path_constraints=constraints_in_tube(problem))


def constraints_in_tube(problem: Problem) -> "tuple[PathConstraint, ...]":
    """Return the constraints of a problem, with tolerances that are narrower by its tracking error."""
    stated = problem.path_constraints
    return tuple(_narrowed(problem, one) for one in stated) if problem.tracking_error.any() else stated


def _narrowed(problem: Problem, one: "PathConstraint") -> "PathConstraint":
    from optiplan.collision.named_pairs import NamedPairs
    from optiplan.problem.constraints.motions import JointCoupling, PairClearance
    from optiplan.problem.constraints.points import OnArc, OnCircle, OnLine, OnPlane, PositionBox
    from optiplan.problem.constraints.poses import FixedOrientation, LookAt, OnScrew, OrientationCone, RelativePose
    from optiplan.problem.constraints.statements import frame_of

    robot, error = problem.robot, problem.tracking_error
    frame = frame_of(one)
    travel, turn = (0.0, 0.0) if frame is None else _of_frame(robot, frame, error)
    if isinstance(one, RelativePose):
        travel, turn = np.add((travel, turn), _of_frame(robot, one.to, error)).tolist()
    changed: Mapping[str, Any] = {}
    match one:
        case OrientationCone() | FixedOrientation():
            changed = {"within": _less(one.within, turn)}
        case LookAt():
            changed = {"within": _less(one.within, 2.0 * turn)}
        case OnPlane() | OnLine() | OnCircle() | OnArc():
            changed = {"within": _less(one.within, travel)}
        case PositionBox():
            changed = {"size": np.array([_less(size, 2.0 * travel) for size in one.size])}
        case RelativePose() | OnScrew():
            share = 2.0 if isinstance(one, OnScrew) else 1.0  # the nearest pose of a screw turns along
            orientation = _less(one.orientation, share * turn)
            changed = {"position": _less(one.position, share * travel), "orientation": orientation}
        case JointCoupling():
            off = sum(abs(c) * error[robot.joint_names.index(name)] for name, c in one.joints.items())
            changed = {"within": _less(one.within, float(off))}
        case PairClearance():
            arms = NamedPairs(robot, problem.scene, one.pairs).bounds.moment_arms(robot.limits.stroke)
            changed = {"at_least": one.at_least + float((arms[:, : robot.n] @ error).max(initial=0.0))}
    return replace(one, **changed) if changed else one  # type: ignore[type-var]  # dataclasses


def _less(tolerance: float, by: float) -> float:
    return max(tolerance - by, _LEFT * tolerance)


def _of_frame(robot: Robot, frame: str, error: Array) -> tuple[float, float]:
    """Bound how far a frame moves, m, and how far it turns, rad, with joints off by up to `error` (n,)."""
    placed = robot.model.frames[robot.frame_id(frame)]
    kinematics, joint = robot.kinematics, int(placed.parentJoint)
    arms = kinematics.moment_arms(joint, np.array(placed.placement.translation)[None], robot.limits.stroke)
    turns = kinematics.carries[joint] * kinematics.revolute
    return float(kinematics.planned_bound(arms) @ error), float(kinematics.planned_bound(turns) @ error)
