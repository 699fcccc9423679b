"""How slowly must a trajectory run for its torques to hold?"""

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.model.robot import Robot
from optiplan.trajectory.samples import sample_times
from optiplan.trajectory.trajectory import Trajectory

_RESERVE = 1e-3  # share of the limit kept free for what happens between samples


def torque_scale(robot: Robot, limit: Array, trajectory: Trajectory) -> float:
    """Factor s >= 1 on the duration at which |tau| <= limit (n,); inf where gravity exceeds it.

    Holds at: `sample_times`.

    Run s times slower, the same path needs tau(s) = g(q) + (tau(1) - g(q)) / s^2: inertial and Coriolis torques scale
    alike (Hollerbach 1984, Dynamic scaling of manipulator trajectories). Friction and carried loads are not modelled.
    """
    if not np.isfinite(limit).any():
        return 1.0
    t = sample_times(trajectory)
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
