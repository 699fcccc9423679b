"""Numeric inverse kinematics: damped least squares from many starts, within joint limits."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.model.robot import Robot

_CONVERGED = 1e-9  # m and rad
_DAMPING = 0.05
_PATIENCE = 5  # steps after which the error must have fallen …
_GAIN = 0.3  # … by this share, or a fresh start is the better use of time


@dataclass(frozen=True)
class IkOptions:
    """How to solve.

    Attributes:
        position: translation error that still is a solution, m.
        orientation: angle error that still is a solution, rad; pi or more leaves the orientation free.
        count: stop after so many distinct solutions.
        iterations: steps from one start, at most.
        distinct: solutions differ when some joint differs by more than this, rad or m.
        stop: polled between starts.
    """

    position: float = 1e-8
    orientation: float = 1e-8
    count: int = 8
    iterations: int = 60
    distinct: float = 0.1
    stop: Callable[[], bool] = field(default=lambda: False)


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
    """Configurations within the joint limits that put `frame` at X_WG, one attempt a seed (n,) until `count` are found.

    Raises:
        ValueError: there is no seed.
    """
    solver = _Solver(robot, frame, X_WG, options)
    solutions: list[Array] = []
    nearest: tuple[float, float, Array] | None = None
    for seed in seeds:
        q = solver.descend(seed)
        position, orientation = pose_error(solver.place(q), X_WG)
        solved = position <= options.position and orientation <= options.orientation
        if solved and all(np.abs(q - other).max() > options.distinct for other in solutions):
            solutions.append(q)
        if nearest is None or position + orientation < nearest[0] + nearest[1]:
            nearest = position, orientation, q
        if len(solutions) >= options.count or options.stop():
            break
    if nearest is None:
        raise ValueError("inverse kinematics needs at least one seed")
    if solutions:
        return IkResult(solutions, nearest[2], nearest[0], nearest[1])
    q = solver.descend(nearest[2], gain=1e-4)  # patience, so that the miss reported is the least in its surroundings
    return IkResult([], q, *pose_error(solver.place(q), X_WG))


def pose_error(X_WF: pin.SE3, X_WG: pin.SE3) -> tuple[float, float]:
    """Distance of the origins (m) and angle of the rotation (rad) between two poses."""
    angle = np.linalg.norm(pin.log3(X_WF.rotation.T @ X_WG.rotation))
    return float(np.linalg.norm(X_WG.translation - X_WF.translation)), float(angle)


def random_seeds(robot: Robot, near: Array, rng: np.random.Generator, count: int) -> list[Array]:
    """Uniform configurations within the limits; a joint without bounds is drawn within pi of `near` (n,)."""
    low = np.where(np.isfinite(robot.limits.lower), robot.limits.lower, near - np.pi)
    high = np.where(np.isfinite(robot.limits.upper), robot.limits.upper, near + np.pi)
    return list(rng.uniform(low, high, (count, robot.n)))


class _Solver:
    """Work space of one target.

    Error e = (p_G - p_F in the world, log(R_WF^T R_WG)); its Jacobian is -(J_p, Jlog3 R^T J_w) with R = R_WF^T R_WG,
    J_p the linear part in world axes, J_w the angular part in the frame's own.
    """

    def __init__(self, robot: Robot, frame: str, X_WG: pin.SE3, options: IkOptions) -> None:
        self._model, self._data = robot.model, robot.model.createData()
        self._frame = robot.model.getFrameId(frame)
        self._X_WG, self._options = X_WG, options
        self._low, self._high = robot.limits.lower, robot.limits.upper
        self._rows = 3 if options.orientation >= np.pi else 6

    def place(self, q: Array) -> pin.SE3:
        """X_WF at q (n,)."""
        pin.framesForwardKinematics(self._model, self._data, q)
        return self._data.oMf[self._frame]

    def descend(self, seed: Array, gain: float = _GAIN) -> Array:
        """Where Levenberg–Marquardt with damping 0.05 |e|^2 ends from a seed; inside the limits.

        Source of the damping: Sugihara, "Solvability-unconcerned inverse kinematics", T-RO 2011.
        """
        q = np.clip(seed, self._low, self._high)
        best, best_error, milestone = q, np.inf, np.inf
        for k in range(self._options.iterations):
            e, J = self._linearise(q)
            error = float(np.linalg.norm(e))
            if error < best_error:
                best, best_error = q, error
            if error < _CONVERGED:
                break
            if k % _PATIENCE == 0:
                if best_error > (1.0 - gain) * milestone:
                    break
                milestone = best_error
            q = self._step(q, e, J)
        return best

    def _linearise(self, q: Array) -> tuple[Array, Array]:
        pin.computeJointJacobians(self._model, self._data, q)
        X_WF = pin.updateFramePlacement(self._model, self._data, self._frame)
        J = pin.getFrameJacobian(self._model, self._data, self._frame, pin.LOCAL)
        e, columns = np.empty(6), np.empty_like(J)
        e[:3] = self._X_WG.translation - X_WF.translation
        columns[:3] = X_WF.rotation @ J[:3]
        if self._rows == 6:
            R = X_WF.rotation.T @ self._X_WG.rotation
            e[3:] = pin.log3(R)
            columns[3:] = pin.Jlog3(R) @ R.T @ J[3:]
        return e[: self._rows], columns[: self._rows]

    def _step(self, q: Array, e: Array, J: Array) -> Array:
        """One damped step; joints that it would push through a limit are held there and the rest is solved again."""
        damping = (_DAMPING * float(e @ e) + 1e-12) * np.eye(self._rows)
        free = np.ones(len(q), dtype=bool)
        step = np.zeros(len(q))
        for _ in range(3):
            A = J[:, free]
            step[free] = A.T @ np.linalg.solve(A @ A.T + damping, e)
            pushed = free & (((q <= self._low) & (step < 0.0)) | ((q >= self._high) & (step > 0.0)))
            if not pushed.any():
                break
            free &= ~pushed
            step[:] = 0.0
        largest = np.abs(step).max()
        return np.asarray(np.clip(q + step * min(1.0, 0.8 / max(largest, 1e-12)), self._low, self._high))
