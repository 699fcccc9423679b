"""Descents of the numeric inverse kinematics, of one frame or several: damped least squares within joint limits."""

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from eigenpy import LDLT  # three times as quick as NumPy on such matrices, and SciPy takes 0.1 s to import

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.robot.native_tree import native_tree
from optiplan.robot.robot import Robot

if TYPE_CHECKING:
    from optiplan._core._core_base import PoseDescent

_CONVERGED_ERROR = 1e-9
"""m and rad; a descent ends below this error."""

_DAMPING, _LEAST_DAMPING = 0.05, 1e-12

_LONGEST_STEP = 0.8
"""rad or m, of any joint."""

_PATIENCE = 5
"""Steps after which the error must have fallen by `GAIN`."""

GAIN = 0.3
"""Share by which the error must fall within `_PATIENCE` steps; else a fresh start is the better use of time."""


class Descent:
    """Work space for one frame of one robot; `aim` sets the target.

    Error e = (p_G - p_F, log(R_WG R_WF^T)) in world axes, m and rad. The Jacobian of the frame stands for its
    derivative: they differ only off the axis of the remaining rotation, and less the nearer the target is.
    """

    def __init__(self, robot: Robot, frame: str, orientation: bool = True) -> None:
        """Prepare; without `orientation` only the position of the frame counts."""
        self._model, self._data = robot.model, robot.model.createData()
        self._frame = robot.model.getFrameId(frame)
        self._low, self._high = robot.limits.lower, robot.limits.upper
        self._rows = 6 if orientation else 3
        self._e = np.zeros(6)
        self._diagonal = slice(None, None, self._rows + 1)

    @cached_property
    def _native(self) -> "PoseDescent | None":
        """The same descent in the core; made by the first, for many only place frames."""
        if core is None:
            return None
        frame = self._model.frames[self._frame]
        rules = np.array([_CONVERGED_ERROR, _DAMPING, _LEAST_DAMPING, _LONGEST_STEP, float(_PATIENCE)])
        tree, X_JF = native_tree(self._model), frame.placement.homogeneous
        return core.PoseDescent(tree, frame.parentJoint, X_JF, self._rows, rules)

    def hold_within(self, lower: Array, upper: Array) -> None:
        """Keep configurations within these bounds (n,) from now on, which lie within the limits, rad or m."""
        self._low, self._high = lower, upper

    def aim(self, X_WG: pin.SE3) -> None:
        """Choose the pose that the frame should have."""
        self._p, self._R = X_WG.translation.copy(), X_WG.rotation.copy()

    def place(self, q: Array) -> pin.SE3:
        """X_WF at q (n,)."""
        pin.framesForwardKinematics(self._model, self._data, q)
        return self._data.oMf[self._frame]

    def jacobian(self, q: Array) -> Array:
        """Return the frame's Jacobian in world axes, linear rows first: (6, n), or (3, n) for the position alone."""
        J = pin.computeFrameJacobian(self._model, self._data, q, self._frame, pin.LOCAL_WORLD_ALIGNED)
        return np.asarray(J.reshape(6, -1)[: self._rows])  # of one joint it is (6,)

    def inside(self, q: Array) -> Array:
        """The nearest configuration within the limits, (n,)."""
        return np.asarray(np.minimum(np.maximum(q, self._low), self._high))

    def held(self, q: Array, step: Array, slack: float = 0.0) -> npt.NDArray[np.bool_]:
        """Return which joints (n,) are at a limit, or within `slack` of it, and would pass it by `step`."""
        low, high = self._low + slack, self._high - slack
        return np.asarray(((q <= low) & (step < 0.0)) | ((q >= high) & (step > 0.0)))

    def distance_to_limits(self, q: Array, direction: Array) -> float:
        """The largest t with q + t direction within the limits, when q (n,) is."""
        bound = np.where(direction > 0.0, self._high, self._low)
        moving = np.abs(direction) > 0.0
        return float(np.min((bound - q)[moving] / direction[moving], initial=np.inf))

    def descend(self, seed: Array, iterations: int, gain: float = GAIN) -> Array:
        """Run Levenberg–Marquardt with damping 0.05 |e|^2 from a seed (n,) and return its end; inside the limits.

        The core does the same in a twentieth of the time. Source of the damping: Sugihara, "Solvability-unconcerned
        inverse kinematics", T-RO 2011.
        """
        if self._native is not None:
            X_WG = pin.SE3(self._R, self._p).homogeneous
            bounds = np.ascontiguousarray(self._low), np.ascontiguousarray(self._high)
            return self._native.descend(X_WG, *bounds, np.ascontiguousarray(seed, dtype=float), iterations, gain)
        q = self.inside(seed)
        best, best_error, milestone = q, np.inf, np.inf
        for k in range(iterations):
            e, J = self._linearise(q)
            error = float(e @ e)  # squared
            if error < best_error:
                best, best_error = q, error
            if error < _CONVERGED_ERROR**2:
                break
            if k % _PATIENCE == 0:
                if best_error > (1.0 - gain) ** 2 * milestone:
                    break
                milestone = best_error
            q = self._step(q, e, J, _DAMPING * error + _LEAST_DAMPING)
        return best

    def settle(self, q: Array, position: float, orientation: float, iterations: int = 4) -> Array | None:
        """Return nearly the nearest configuration whose error is at most `position`, m, and `orientation`, rad.

        Each step removes the excess error; None if `iterations` steps are not enough.
        """
        for _ in range(iterations):
            e, J = self._linearise(q)
            excess = np.concatenate([_excess(e[:3], position), _excess(e[3:], orientation)])
            if not excess.any():
                return q
            q = self._step(q, excess, J, _LEAST_DAMPING)
        return None

    def error(self, q: Array) -> tuple[Array, Array]:
        """The error (6,) or (3,) at q (n,), and the Jacobian of the frame; both are the caller's."""
        e, J = self._linearise(q)
        return e.copy(), J

    def reached(self, q: Array) -> bool:
        """Return whether q (n,) puts the frame at the target, to ten times what `descend` aims for."""
        return float(np.linalg.norm(self._linearise(q)[0])) < 10.0 * _CONVERGED_ERROR

    def _linearise(self, q: Array) -> tuple[Array, Array]:
        J = self.jacobian(q)
        X_WF = pin.updateFramePlacement(self._model, self._data, self._frame)
        self._e[:3] = self._p - X_WF.translation
        if self._rows == 6:
            self._e[3:] = pin.log3(self._R @ X_WF.rotation.T)
        return self._e[: self._rows], J

    def _step(self, q: Array, e: Array, J: Array, damping: float) -> Array:
        """One damped step; joints that it would push through a limit are held there and the rest is solved again."""
        step = self._least_squares(J, e, damping)
        held = self.held(q, step)
        for _ in range(2):
            if not held.any():
                break
            step = self._least_squares(np.where(held, 0.0, J), e, damping)
            pushed = self.held(q, step)
            if not pushed.any():
                break
            held |= pushed
        largest = float(np.abs(step).max())
        return self.inside(q + step * (_LONGEST_STEP / largest) if largest > _LONGEST_STEP else q + step)

    def _least_squares(self, J: Array, e: Array, damping: float) -> Array:
        """J^T (J J^T + damping I)^-1 e, (n,)."""
        A = J @ J.T
        A.flat[self._diagonal] += damping
        return np.asarray(J.T @ LDLT(A).solve(e))


def _excess(e: Array, radius: float) -> Array:
    """Return the part of a vector outside a ball about zero, aiming a little inside."""
    length = float(np.linalg.norm(e))
    return e * (1.0 - 0.98 * radius / length) if length > radius else np.zeros(len(e))


class SeveralFrames(Descent):
    """Work space for several frames of one robot: the errors and Jacobians of `Descent`, one below the other.

    Attributes:
        parts: of each frame, `(name, whether its orientation counts)`; they place frames and hold their targets.
    """

    def __init__(self, robot: Robot, frames: Sequence[tuple[str, bool]]) -> None:
        super().__init__(robot, frames[0][0])
        self.parts = [Descent(robot, frame, oriented) for frame, oriented in frames]
        self._rows = sum(6 if oriented else 3 for _, oriented in frames)
        self._diagonal = slice(None, None, self._rows + 1)

    @property
    def _native(self) -> None:
        """The core's descent knows one frame."""

    def aim_all(self, targets: Sequence[pin.SE3]) -> None:
        """Choose the pose X_WG that each frame should have."""
        for part, X_WG in zip(self.parts, targets, strict=True):
            part.aim(X_WG)

    def places(self, q: Array) -> list[pin.SE3]:
        """Return the poses X_WF of all frames at q (n,)."""
        return [part.place(q).copy() for part in self.parts]

    def _linearise(self, q: Array) -> tuple[Array, Array]:
        found = [part.error(q) for part in self.parts]
        return np.concatenate([e for e, _ in found]), np.vstack([J for _, J in found])
