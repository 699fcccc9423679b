"""What moves seen at rest: the robot on a carriage that goes the other way, so that every check holds in that frame.

Where everything in a frame is at M(t) X at time t, a link of the robot at X_WL(q) is at M(t)^-1 X_WL(q) as seen from
there. M(t)^-1 = Rot(axis through point, -a(t)) Trans(-d(t)) is done by joints below the base of the robot, whose
positions are polynomials of time too. So measures, bounds and proofs for a robot in the world are those in the frame.
"""

from dataclasses import fields, replace

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Index
from optiplan.geometry.obstacle_motion import SLIDES, ObstacleMotion
from optiplan.problem.problem import Problem, derived
from optiplan.robot.limits import Limits
from optiplan.robot.robot import Robot
from optiplan.trajectory.joining import names_beside, with_obstacles
from optiplan.trajectory.trajectory import Trajectory

_SLIDES = (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ)


def on_carriage(problem: Problem, motion: ObstacleMotion) -> Problem:
    """Return a problem without ends whose world is the frame that moves: its robot has the carriage's joints first."""
    robot = _carried(problem.robot, motion)
    count = motion.size
    fixed = {"start": np.append(np.zeros(count), problem.start), "limits": robot.limits}
    error = np.append(np.zeros(count), problem.tracking_error)
    return derived(problem, robot=robot, **fixed, tracking_error=error, goal=(), vias=(), path_constraints=())


def seen_from(trajectory: Trajectory, motion: ObstacleMotion, begin: float, robot: Robot) -> Trajectory:
    """Return a part of a motion that begins at a time, s, as one of the `robot` on the carriage."""
    left = motion.until - begin
    rows = motion.from_times(np.array([begin]))[0]
    later = replace(motion, coefficients=rows, until=left if left > 0.0 else np.inf)
    whole = with_obstacles(trajectory, [later])
    order = np.concatenate([_places(motion) + trajectory.n, np.arange(trajectory.n)])
    coefficients = np.array(whole.coefficients[:, :, order])
    coefficients[:, :, : motion.size] *= -1.0
    return Trajectory(robot.joint_names, whole.breakpoints, coefficients)


def state_seen_from(states: tuple[Array, Array], motion: ObstacleMotion, t: float) -> tuple[Array, Array]:
    """Return q and dq/dt (n,) of a robot at time t, s, with the joints of the carriage first."""
    at, places = np.array([t]), _places(motion)
    found = [np.append(-motion.at(at, order)[0][places], states[order]) for order in range(2)]
    return found[0], found[1]


def _places(motion: ObstacleMotion) -> Index:
    """Return the rows of a motion in the order of the carriage's joints: the turn is undone first."""
    return np.array([*range(SLIDES)] if motion.axis is None else [SLIDES, *range(SLIDES)], dtype=np.intp)


def _carried(robot: Robot, motion: ObstacleMotion) -> Robot:
    turn = () if motion.axis is None else ("carriage turn",)
    names = names_beside([*turn, *(f"carriage {axis}" for axis in "xyz")], robot.model.names)
    carriage, joint = pin.Model(), 0
    placement = pin.SE3.Identity()
    if motion.axis is not None:
        joint = carriage.addJoint(0, pin.JointModelRZ(), motion.joint_frame, names[0])
        placement = motion.joint_frame.inverse()
    for name, slide in zip(names[-SLIDES:], _SLIDES, strict=True):
        joint = carriage.addJoint(joint, slide(), placement, name)
        placement = pin.SE3.Identity()
    mount = carriage.addFrame(pin.Frame("carriage", joint, placement, pin.FrameType.OP_FRAME))
    model = pin.appendModel(carriage, robot.model, mount, pin.SE3.Identity())
    model.gravity.linear = np.array(robot.model.gravity.linear)
    endless = {one.name: np.full(motion.size, -np.inf if one.name == "lower" else np.inf) for one in fields(Limits)}
    limits = Limits(*(np.append(endless[one.name], getattr(robot.limits, one.name)) for one in fields(Limits)))
    return replace(robot, model=model, joint_names=(*names, *robot.joint_names), limits=limits, bare=None)
