"""Whole turns: a revolute joint with a wide range reaches the same pose at several angles."""

from itertools import product

import numpy as np

from optiplan.arrays import Array
from optiplan.robot.robot import Robot

_TURN = 2.0 * np.pi

MOST_TURNS = 100.0
"""Turns from the nearest image within which others are listed: files know limits of 1e30 rad."""


def images(robot: Robot, q: Array, near: Array) -> list[Array]:
    """For each joint, all values within its limits that equal that of q (n,) up to whole turns, the nearest first.

    Every combination reaches the same pose. A joint without limits has the image nearest to `near` (n,) and those one
    turn from it; one that cannot come within its limits, and a sliding joint outside, have none.
    A joint that another follows at a broken number of turns has no other image.
    """
    return [_of_joint(robot, j, float(q[j]), float(near[j])) for j in range(robot.n)]


def whole_turns(robot: Robot, q: Array, near: Array, count: int) -> list[Array]:
    """Up to `count` configurations that equal q (n,) up to whole turns, the soonest reached from `near` (n,) first.

    Of each joint the two images nearest to `near`; q itself stays for a joint that has none.
    """
    every = [values[:2] if len(values) else q[j : j + 1] for j, values in enumerate(images(robot, q, near))]
    return _soonest(robot, every, near)[:count]


def endless_turns(robot: Robot, q: Array, near: Array) -> list[Array]:
    """Configurations that equal q (n,) up to whole turns of joints without limits, the soonest from `near` (n,) first.

    Of each such joint the two images nearest to `near`; the others stay as they are.
    """
    endless = robot.endless
    if not endless.any():
        return [q]
    every = [_of_joint(robot, j, q[j], near[j])[:2] if endless[j] else q[j : j + 1] for j in range(robot.n)]
    return _soonest(robot, every, near)


def _soonest(robot: Robot, every: list[Array], near: Array) -> list[Array]:
    """Return all combinations of the joints' values, the soonest reached from `near` (n,) first."""
    speed = robot.limits.velocity
    found = [np.array(image) for image in product(*every)]
    return sorted(found, key=lambda image: float((np.abs(image - near) / speed).max()))


def _of_joint(robot: Robot, j: int, value: float, near: float) -> Array:
    lower, upper = float(robot.limits.lower[j]), float(robot.limits.upper[j])
    if not robot.whole_turns[j]:
        return np.array([value] if lower <= value <= upper else [])
    low, high = np.ceil((lower - value) / _TURN), np.floor((upper - value) / _TURN)
    most = MOST_TURNS if np.isfinite(high - low) else 1.0
    middle = np.clip(np.round((near - value) / _TURN), low, high)
    values = value + _TURN * np.arange(max(low, middle - most), min(high, middle + most) + 1.0)
    return np.asarray(values[np.argsort(np.abs(values - near), kind="stable")])
