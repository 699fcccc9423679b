"""Numeric inverse kinematics: damped least squares from many starts, within joint limits."""

from collections.abc import Callable, Iterable
from dataclasses import field

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.poses import pose_error
from optiplan.kinematics.ik.joint_wraps import apart
from optiplan.kinematics.ik.levenberg_marquardt import Descent
from optiplan.kinematics.ik.null_space import Preference, improve
from optiplan.records import dataclass
from optiplan.robot.batched.kinematics import carrying_joints
from optiplan.robot.mimic_joints import coupling
from optiplan.robot.robot import Robot

_PATIENT_GAIN = 1e-4
"""Gain (see `GAIN`) below which the descent for the nearest miss ends."""


@dataclass(frozen=True)
class IkOptions:
    """Options of the numeric solver.

    Attributes:
        position: translation error that still is a solution, m.
        orientation: angle error that still is a solution, rad; pi or more leaves the orientation free.
        count: stop after so many distinct solutions.
        iterations: steps from one start, at most.
        distinct: solutions differ when some joint differs by more than this, rad or m, up to whole turns.
        stop: polled between starts.
        prefer: among solutions of a redundant arm; each solution moves to a local minimum of this cost at its pose.
    """

    position: float = 1e-8
    orientation: float = 1e-8
    count: int = 8
    iterations: int = 60
    distinct: float = 0.1
    stop: Callable[[], bool] = field(default=lambda: False)
    prefer: Preference | None = None


@dataclass(frozen=True, eq=False)
class IkResult:
    """All solutions found, and the nearest miss.

    Attributes:
        solutions: each (n,), in the order found.
        nearest: (n,) configuration with the smallest error of all starts.
        position_error: of `nearest`, m.
        orientation_error: of `nearest`, rad.
    """

    solutions: list[Array]
    nearest: Array
    position_error: float
    orientation_error: float


def solve_ik(robot: Robot, frame: str, X_WG: pin.SE3, seeds: Iterable[Array], options: IkOptions) -> IkResult:
    """Find configurations within the joint limits that put `frame` at X_WG, by one descent from each seed (n,).

    Raises:
        ValueError: there is no seed.
    """
    descent = Descent(robot, frame, options.orientation < np.pi)
    descent.aim(X_WG)
    solutions: list[Array] = []
    nearest: IkResult | None = None
    for seed in seeds:
        q = descent.descend(seed, options.iterations)
        position, orientation = pose_error(descent.place(q), X_WG)
        if position <= options.position and orientation <= options.orientation:
            q = q if options.prefer is None else improve(descent, robot.limits, q, options.prefer)
            if all(apart(robot, q, other) > options.distinct for other in solutions):
                solutions.append(q)
        if nearest is None or position + orientation < nearest.position_error + nearest.orientation_error:
            nearest = IkResult(solutions, q, position, orientation)
        if len(solutions) >= options.count or options.stop():
            break
    if nearest is None:
        raise ValueError("inverse kinematics needs at least one seed")
    if solutions:
        return nearest
    # With patience, so that the reported miss is a local minimum.
    q = descent.descend(nearest.nearest, options.iterations, _PATIENT_GAIN)
    return IkResult([], q, *pose_error(descent.place(q), X_WG))


def random_seeds(robot: Robot, near: Array, rng: np.random.Generator, count: int) -> list[Array]:
    """Draw uniform configurations within the limits; a joint without bounds is within pi of `near` (n,)."""
    return list(rng.uniform(*robot.limits.range_about(near, near), (count, robot.n)))


def joints_that_move(robot: Robot, frame: str) -> npt.NDArray[np.bool_]:
    """Return which joints (n,), or their followers, are between the base and a frame.

    The other columns of its Jacobian are zero everywhere.
    """
    model = robot.model
    carrying = carrying_joints(model)[model.frames[model.getFrameId(frame)].parentJoint]
    return np.asarray(carrying @ np.abs(coupling(model)[0]) > 0.0)
