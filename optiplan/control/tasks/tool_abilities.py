"""How fast, and how much faster within a second, a robot's joints move a frame: limits of what a task may ask for."""

from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array
from optiplan.kinematics.manipulability import ToolKinematics
from optiplan.robot.robot import Robot

_SAMPLES = 200
_SHARE = 0.25
"""Quantile over configurations: what is found is exceeded at three quarters of them."""
_RESPONSES = (0.01, 0.2)
_RESERVE = 0.5
"""Share of the accelerations that slowing down may take; the rest is for steering."""


class Ability(NamedTuple):
    """Speed that a frame can have in every direction, m/s or rad/s, and how quickly it can lose it, per s."""

    speed: float = np.inf
    brake: float = np.inf


def tool_abilities(robot: Robot, frame: str) -> tuple[Ability, Ability]:
    """What a frame can do in translation and in rotation.

    At configurations spread over the limits (their seed is fixed), with J the rows of translation or of rotation, an
    acceleration of any direction u needs J⁺ u of the joints: |u| <= 1 / max_j |row j of J⁺| / limit_j.
    """
    rng = np.random.default_rng(0)
    limits = robot.limits
    low, high = np.maximum(limits.lower, -np.pi), np.minimum(limits.upper, np.pi)
    Q = rng.uniform(np.minimum(low, high), np.maximum(low, high), (_SAMPLES, robot.n))
    J = ToolKinematics(robot, frame).evaluate(Q)[1]
    moves, turns = (
        Ability(_largest_rate(part, limits.velocity), _RESERVE * _largest_rate(part, limits.acceleration))
        for part in (J[:, :3], J[:, 3:])
    )
    return moves, turns


def _largest_rate(J: Array, limit: Array) -> float:
    """Of Jacobians (N, 3, n) and limits (n,); infinity where the rows never move, or nothing is limited."""
    inverse = np.linalg.pinv(J, rcond=1e-3)  # (N, n, 3)
    need = (np.linalg.norm(inverse, axis=2) / limit).max(axis=1)
    moves = need > 0.0
    return float(np.quantile(1.0 / need[moves], _SHARE)) if moves.any() else np.inf


def response_time(robot: Robot) -> float:
    """The time, s, in which a robot's joints can follow a change of velocity: the largest sqrt(velocity / 2 jerk).

    A law that asks for a velocity within a time T asks for accelerations up to v / T, and for changes of them up to
    v / T², which jerk limits have to allow. Between 10 and 200 ms.
    """
    limits = robot.limits
    with np.errstate(invalid="ignore"):
        times = np.sqrt(np.where(np.isfinite(limits.jerk), 0.5 * limits.velocity / limits.jerk, 0.0))
    return float(np.clip(np.nanmax(times, initial=0.0), *_RESPONSES))


def default_gain(robot: Robot) -> float:
    """1/s: a quarter of one over the response time, with which an error falls without overshooting."""
    return 0.25 / response_time(robot)
