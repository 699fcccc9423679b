"""Scale a trajectory in time until its torques are within limits."""

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array, Index
from optiplan.robot.batched.dynamics import inverse_dynamics
from optiplan.robot.native_tree import native_tree
from optiplan.robot.robot import Robot
from optiplan.trajectory.samples import samples_of_pieces
from optiplan.trajectory.trajectory import Trajectory

RESERVE = 1e-3  # share of the limit kept free for what happens between samples
_STEP = 8e-3  # s between samples, at most
_LEAST = 9  # samples of a piece: within one the acceleration is a low polynomial, only its ends may bend or jump
_NEAR = 0.93, 0.99  # shares of the largest demand: gaps beside larger samples are refined, in two rounds
_FINER = 9  # instants within such a gap
_CURVED = 8.0  # times the curvature seen beside a gap that it may have


def torque_scale(robot: Robot, limit: Array, trajectory: Trajectory) -> float:
    """Return the factor s >= 1 on the duration at which |tau| <= limit (n,); inf where gravity exceeds it.

    Holds at: nine instants of every piece, 8 ms apart at most, and a hundred times finer where torques are largest.
    Within a millisecond of full jerk the acceleration can go from one limit to the other; such a piece is as short.

    Run s times slower, the same path needs tau(s) = g(q) + (tau(1) - g(q)) / s^2: inertial and Coriolis torques scale
    alike (Hollerbach 1984, Dynamic scaling of manipulator trajectories). Friction is not modelled.
    """
    if not np.isfinite(limit).any():
        return 1.0
    demand = _Demand(robot, limit, trajectory)
    t = samples_of_pieces(trajectory, _STEP, _LEAST)
    found = demand.at(t)
    peak = float(found.max())
    for near in _NEAR:
        if not np.isfinite(peak) or peak < near:  # the motion is slow enough, or can never be
            break
        gaps = _gaps(t, found, near * peak, peak)
        t = (t[gaps, None] + np.linspace(0.0, 1.0, _FINER + 2) * np.diff(t)[gaps, None]).ravel()
        found = demand.at(t)
        peak = float(found.max())
    return float(np.sqrt(max(1.0, peak)))


def _gaps(t: Array, found: Array, near: float, peak: float) -> Index:
    """Return the gaps beside samples `found` (k,) >= `near`, at times t (k,), s, that may hold more than the peak.

    Between two samples a function exceeds both by at most gap² / 8 max |f''|; here `_CURVED` times that of the divided
    differences about them. Along a motion at its torque limit that leaves a few gaps of hundreds.
    """
    width = np.maximum(np.diff(t), np.finfo(float).tiny)
    curvature = np.zeros(len(t))
    slope = np.diff(found) / width
    curvature[1:-1] = 2.0 * np.abs(np.diff(slope)) / (width[1:] + width[:-1])
    curvature[[0, -1]] = curvature[[1, -2]]
    ends = np.maximum(found[1:], found[:-1])
    rise = _CURVED / 8.0 * width**2 * np.maximum(curvature[1:], curvature[:-1])
    return np.flatnonzero((ends >= near) & (ends + rise >= peak))


class _Demand:
    """The largest (tau - g) / (limit - g) of all joints along a trajectory: s² of the slow-down that it asks for."""

    def __init__(self, robot: Robot, limit: Array, trajectory: Trajectory) -> None:
        self._robot, self._trajectory, self._allowed = robot, trajectory, limit * (1.0 - RESERVE)

    def at(self, t: Array) -> Array:
        """Return the demand (k,) at rising times t (k,); infinite where gravity is too much; natively where built."""
        motion, allowed = self._trajectory, self._allowed
        if core is not None:
            dynamics = core.InverseDynamics(native_tree(self._robot.model))
            coefficients = np.ascontiguousarray(motion.coefficients)
            return dynamics.demand(np.ascontiguousarray(motion.breakpoints), coefficients, allowed, t)
        tau, Q = _torques(self._robot, motion, t), motion(t)
        gravity = inverse_dynamics(self._robot, Q, *np.zeros((2, *Q.shape)))
        if (np.abs(gravity) > allowed).any():
            return np.full(len(t), np.inf)
        moving = tau - gravity
        with np.errstate(divide="ignore", invalid="ignore"):
            squared = np.abs(moving) / (allowed - np.sign(moving) * gravity)
        return np.asarray(np.nan_to_num(squared, nan=0.0, posinf=np.inf).max(axis=1))


def torque_share(robot: Robot, limit: Array, trajectory: Trajectory, t: Array | None = None) -> float:
    """Return the largest |tau| / limit (n,) at times t (N,), s, or at those of the pieces."""
    t = samples_of_pieces(trajectory, _STEP, _LEAST) if t is None else t
    return float((np.abs(_torques(robot, trajectory, t)) / limit).max())


def _torques(robot: Robot, motion: Trajectory, t: Array) -> Array:
    """Torques (k, n) at times t (k,); in the native core where built."""
    Q, V, A = (np.ascontiguousarray(motion(t, order)) for order in range(3))
    if core is not None:
        return core.InverseDynamics(native_tree(robot.model)).torques(Q, V, A)
    return inverse_dynamics(robot, Q, V, A)
