"""Gravity torques against the torque limits."""

from functools import cached_property

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.robot.loaded_robots import once_for_each
from optiplan.robot.robot import Robot

_RESERVE = 1e-3  # share of the limit reserved for the motion between samples
_UPRIGHT = 1e-9  # sine of the angle between an axis and gravity, below which they count as parallel
_ROUNDING = 1e-6  # share of a bound, and N·m or N


class Gravity:
    """Compare the gravity torques with the limits (n,), N·m or N; one object per thread.

    Attributes:
        allowed: the limits (n,), less the reserve; None where gravity exceeds them nowhere.
    """

    def __init__(self, robot: Robot, limit: Array, reserve: float = _RESERVE) -> None:
        self.joint_names, self.limit = robot.joint_names, limit
        heavy = np.isfinite(limits_at_rest(robot, limit, reserve)).any()
        self.allowed: Array | None = limit * (1.0 - reserve) if heavy else None
        self._model = robot.model

    @cached_property
    def _data(self) -> pin.Data:
        return self._model.createData()

    def too_much(self, q: Array) -> bool:
        """Return whether |g(q)| at q (n,) exceeds the limits, less the reserve (a share of them)."""
        return self.allowed is not None and bool((self.torque(q) > self.allowed).any())

    def torque(self, q: Array) -> Array:
        """Return |g(q)|, (n,), at q (n,)."""
        torque: Array = np.abs(pin.computeGeneralizedGravity(self._model, self._data, q))
        return torque


def limits_at_rest(robot: Robot, limit: Array, reserve: float = _RESERVE) -> Array:
    """Return the torque limits (n,), N·m or N, infinite where gravity never takes more than all but the `reserve`."""
    return np.where(greatest_gravity(robot) > limit * (1.0 - reserve), limit, np.inf)


@once_for_each
def greatest_gravity(robot: Robot) -> Array:
    """Bounds (n,) on |g(q)|, N·m (sliding joints: N); huge where a sliding joint without limits moves masses away.

    Holds at: every configuration within the position limits. A joint with the direction a has at most f_j sum_k m_k
    l_kj: l_kj is the greatest distance of the centre of mass k from its axis (1 of a joint that slides). f_j is
    |a x gravity| (|a . gravity|) where the joints before it turn about verticals only, else |gravity|.
    """
    model, kinematics = robot.model, robot.kinematics
    pull = np.array(model.gravity.linear)
    strongest = float(np.linalg.norm(pull))
    directions = kinematics.axes(kinematics.poses(np.zeros((1, len(robot.joint_names)))))[0][0]  # (J, 3)
    share, upright = np.full(len(directions), strongest), np.zeros(len(directions), dtype=bool)
    for j, (direction, turns) in enumerate(zip(directions, kinematics.revolute > 0.5, strict=True)):
        before = kinematics.carries[model.parents[j + 1]]
        if not (before & (kinematics.revolute > 0.5) & ~upright).any():
            across = float(np.linalg.norm(np.cross(direction, pull)))
            upright[j] = across <= _UPRIGHT * strongest
            share[j] = across + _UPRIGHT * strongest if turns else abs(float(direction @ pull))
    levers = [
        inertia.mass * kinematics.moment_arms(joint, np.array(inertia.lever)[None], robot.limits.stroke)
        for joint, inertia in enumerate(model.inertias)
    ]
    torque: Array = kinematics.planned_bound(share * np.sum(levers, axis=0)) * (1.0 + _ROUNDING) + _ROUNDING
    return torque
