"""Joint torques: can the motors hold the arm, and how slowly must a trajectory run for its torques to hold?"""

from itertools import pairwise

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.model.robot import Robot
from optiplan.trajectory.trajectory import Trajectory

_STEP = 1e-3  # s, at most, between samples
_LEAST = 33  # samples in a piece
_MOST = 100_000  # samples in all, but for the least: a motion of hours is slow, so its torque changes slowly
_RESERVE = 1e-3  # share of the limit kept free for what happens between samples


class Gravity:
    """Can the motors hold the arm still? The limits (n,) are in N·m or N; one object a thread."""

    def __init__(self, robot: Robot, limit: Array, reserve: float = _RESERVE) -> None:
        self.joint_names, self.limit, self._allowed = robot.joint_names, limit, limit * (1.0 - reserve)
        self._model, self._data = robot.model, robot.model.createData()
        self._limited = bool(np.isfinite(limit).any())

    def too_much(self, q: Array) -> bool:
        """Whether holding the arm at q (n,) takes more than the limits, less the reserve (a share of them)."""
        return self._limited and bool((self.torque(q) > self._allowed).any())

    def torque(self, q: Array) -> Array:
        """|g(q)|, (n,), at q (n,)."""
        torque: Array = np.abs(pin.computeGeneralizedGravity(self._model, self._data, q))
        return torque


def torque_scale(robot: Robot, limit: Array, trajectory: Trajectory) -> float:
    """Factor s >= 1 on the duration at which |tau| <= limit (n,); inf where gravity exceeds it.

    Holds at: samples at most 1 ms apart (in motions of up to 100 s), and 33 in every polynomial piece, however short.

    Run s times slower, the same path needs tau(s) = g(q) + (tau(1) - g(q)) / s^2: inertial and Coriolis torques scale
    alike (Hollerbach 1984, Dynamic scaling of manipulator trajectories). Friction and carried loads are not modelled.
    """
    if not np.isfinite(limit).any():
        return 1.0
    step = max(_STEP, trajectory.duration / _MOST)
    t = np.concatenate([_grid(a, b, step) for a, b in pairwise(trajectory.breakpoints)])
    Q, V, A = (trajectory(t, order) for order in range(3))
    data = robot.model.createData()
    tau = np.array([pin.rnea(robot.model, data, q, v, a) for q, v, a in zip(Q, V, A, strict=True)])
    gravity = np.array([pin.computeGeneralizedGravity(robot.model, data, q) for q in Q])
    motion, allowed = tau - gravity, limit * (1.0 - _RESERVE)
    if (np.abs(gravity) > allowed).any():
        return float("inf")
    with np.errstate(divide="ignore", invalid="ignore"):
        squared = np.abs(motion) / (allowed - np.sign(motion) * gravity)
    return max(1.0, float(np.sqrt(np.nanmax(squared, initial=0.0))))


def _grid(a: float, b: float, step: float) -> Array:
    """Samples of one piece and its ends: torques peak at breakpoints, or within the short pieces at the ends."""
    return np.linspace(a, b, max(_LEAST, int(np.ceil((b - a) / step)) + 1))
