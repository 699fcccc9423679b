"""Scale a trajectory in time until its torques are within limits."""

import numpy as np
import pinocchio as pin

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.robot.native_tree import native_tree
from optiplan.robot.robot import Robot
from optiplan.trajectory.samples import sample_times
from optiplan.trajectory.trajectory import Trajectory

RESERVE = 1e-3  # share of the limit kept free for what happens between samples
_NEAR = 0.9  # share of the largest demand above which the gaps beside a sample are looked into
_FINER = 9  # instants within such a gap


def torque_scale(robot: Robot, limit: Array, trajectory: Trajectory) -> float:
    """Factor s >= 1 on the duration at which |tau| <= limit (n,); inf where gravity exceeds it.

    Holds at: `sample_times`, and ten times finer where torques are near the largest: within a millisecond of full jerk
    the acceleration can go from one limit to the other.

    Run s times slower, the same path needs tau(s) = g(q) + (tau(1) - g(q)) / s^2: inertial and Coriolis torques scale
    alike (Hollerbach 1984, Dynamic scaling of manipulator trajectories). Friction and carried loads are not modelled.
    """
    if not np.isfinite(limit).any():
        return 1.0
    t = sample_times(trajectory)
    demand = _demand(robot, limit, trajectory, t)
    peak = float(demand.max())
    if not np.isfinite(peak) or peak == 0.0:
        return max(1.0, peak)
    near = demand >= _NEAR * peak
    gaps = np.flatnonzero(near[1:] | near[:-1])
    inside = np.linspace(0.0, 1.0, _FINER + 2)[1:-1]
    finer = (t[gaps, None] + inside * np.diff(t)[gaps, None]).ravel()
    return float(np.sqrt(max(1.0, peak, _demand(robot, limit, trajectory, finer).max(initial=0.0))))


def _demand(robot: Robot, limit: Array, trajectory: Trajectory, t: Array) -> Array:
    """The largest (tau - g) / (limit - g) of all joints at times t (k,): (k,), s² of the slow-down it asks for."""
    tau, gravity = _torques(robot.model, *(trajectory(t, order) for order in range(3)))
    motion, allowed = tau - gravity, limit * (1.0 - RESERVE)
    if (np.abs(gravity) > allowed).any():
        return np.full(len(t), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        squared = np.abs(motion) / (allowed - np.sign(motion) * gravity)
    return np.asarray(np.nan_to_num(squared, nan=0.0, posinf=np.inf).max(axis=1))


def torque_share(robot: Robot, limit: Array, trajectory: Trajectory, t: Array | None = None) -> float:
    """Return the largest |tau| / limit (n,) at times t (N,), s, or at `sample_times`."""
    t = sample_times(trajectory) if t is None else t
    tau, _ = _torques(robot.model, *(trajectory(t, order) for order in range(3)))
    return float((np.abs(tau) / limit).max())


def _torques(model: pin.Model, Q: Array, V: Array, A: Array) -> tuple[Array, Array]:
    """Torques of states (k, n), and those that hold the robot there, each (k, n); in the native core where built."""
    if core is not None:
        tree = native_tree(model)
        Q, V, A = (np.ascontiguousarray(part) for part in (Q, V, A))
        return core.InverseDynamics(tree).torques(Q, V, A), tree.gravity(Q)
    data = model.createData()
    tau = np.array([pin.rnea(model, data, q, v, a) for q, v, a in zip(Q, V, A, strict=True)])
    gravity = np.array([pin.computeGeneralizedGravity(model, data, q) for q in Q])
    return tau.reshape(Q.shape), gravity.reshape(Q.shape)
