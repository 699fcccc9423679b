"""Inverse dynamics of many states in one call."""

import threading
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.robot.robot import Robot


class _OfOneThread(threading.local):
    """Pinocchio's memory for each model: while it computes, other threads run."""

    def __init__(self) -> None:
        self.pools: WeakKeyDictionary[pin.Model, pin.ModelPool] = WeakKeyDictionary()


_kept = _OfOneThread()


def inverse_dynamics(robot: Robot, Q: Array, V: Array, A: Array) -> Array:
    """Torques tau = M(q) a + b(q, v), with gravity and without friction: (K, n), N·m (sliding joints: N).

    Args:
        robot: with its load.
        Q: K configurations (K, n), rad or m.
        V: velocities (K, n), rad/s or m/s.
        A: accelerations (K, n), rad/s² or m/s².
    """
    return torques_of(robot.model, Q, V, A)


def torques_of(model: pin.Model, Q: Array, V: Array, A: Array) -> Array:
    """Return the same of the joints of a model."""
    pool = _kept.pools.get(model)
    if pool is None:
        pool = _kept.pools[model] = pin.ModelPool(model, 1)
    tau = np.empty(Q.shape)
    if len(tau):
        pin.rneaInParallel(1, pool, Q.T, V.T, A.T, tau.T)
    return tau
