"""Numeric inverse kinematics: damped least squares from many starts, within joint limits."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.poses import pose_error
from optiplan.kinematics.ik.joint_wraps import apart
from optiplan.kinematics.ik.levenberg_marquardt import Descent
from optiplan.kinematics.ik.null_space import Preference, improve
from optiplan.robot.batched.kinematics import carrying_joints
from optiplan.robot.mimic_joints import coupling
from optiplan.robot.robot import Robot

_PATIENT_GAIN = 1e-4
"""Gain (see `GAIN`) below which the descent for the nearest miss ends."""

_POOL_SIZE = 5000


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


@dataclass(frozen=True, eq=False)
class IkBatch:
    """One configuration for each of N poses.

    Attributes:
        q: (N, n) the first solution found, where there is none the nearest miss.
        solved: (N,) whether q is a solution.
        error: (N, 2) distance (m) and angle (rad) that remain.
    """

    q: Array
    solved: npt.NDArray[np.bool_]
    error: Array


class SeedPool:
    """Configurations within the limits with the poses that they have, so that a descent can start near its target."""

    def __init__(self, robot: Robot, frame: str, rng: np.random.Generator, size: int = _POOL_SIZE) -> None:
        self.frame = frame
        self._Q = np.array(random_seeds(robot, np.zeros(robot.n), rng, size))
        self._features = np.empty((size, 12))
        descent = Descent(robot, frame)
        for q, row in zip(self._Q, self._features, strict=True):
            row[:] = _feature(descent.place(q))
        self._halves = 0.5 * (self._features**2).sum(axis=1)

    def near(self, X_WG: pin.SE3, count: int) -> Array:
        """The configurations (count, n) with the poses X nearest to X_WG, by |p - p_G|^2 + (0.35 m |R - R_G|)^2.

        The norm of matrices is that of Frobenius; the nearest comes first.
        """
        distances = self._halves - self._features @ _feature(X_WG)
        count = min(count, len(distances))
        first = np.argpartition(distances, count - 1)[:count]
        return np.asarray(self._Q[first[np.argsort(distances[first])]])


def solve_ik(robot: Robot, frame: str, X_WG: pin.SE3, seeds: Iterable[Array], options: IkOptions) -> IkResult:
    """Find configurations within the joint limits that put `frame` at X_WG, by one descent from each seed (n,).

    Raises:
        ValueError: there is no seed.
    """
    return _solve(robot, Descent(robot, frame, options.orientation < np.pi), X_WG, seeds, options)


def solve_ik_batch(
    robot: Robot, X_WG: Array, pool: SeedPool, options: IkOptions | None = None, starts: int = 50
) -> IkBatch:
    """Find one solution for each of many poses X_WG (N, 4, 4), from the `starts` nearest configurations of `pool`.

    The frame is that of the pool; `count` and `distinct` of the options have no meaning here.
    """
    options = replace(options or IkOptions(), count=1)
    descent = Descent(robot, pool.frame, options.orientation < np.pi)
    result = IkBatch(np.empty((len(X_WG), robot.n)), np.zeros(len(X_WG), dtype=bool), np.empty((len(X_WG), 2)))
    for k, homogeneous in enumerate(X_WG):
        target = pin.SE3(homogeneous)
        found = _solve(robot, descent, target, pool.near(target, starts), options)
        result.solved[k] = bool(found.solutions)
        result.q[k] = found.solutions[0] if found.solutions else found.nearest
        result.error[k] = pose_error(descent.place(result.q[k]), target)
    return result


def _solve(robot: Robot, descent: Descent, X_WG: pin.SE3, seeds: Iterable[Array], options: IkOptions) -> IkResult:
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


def _feature(X: pin.SE3) -> Array:
    """Twelve numbers whose distance is that of poses: p, m, and 0.35 m R."""
    return np.concatenate([X.translation, 0.35 * X.rotation.ravel()])
