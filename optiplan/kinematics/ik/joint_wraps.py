"""Whole turns: a revolute joint with a wide range reaches the same pose at several angles."""

from itertools import product

import numpy as np

from optiplan.arrays import Array, Flags
from optiplan.robot.limits import Limits
from optiplan.robot.robot import Robot

_TURN = 2.0 * np.pi

ROUNDING = 1e-9
"""rad or m: a value that is outside its limits by no more stands on them."""

MOST_TURNS = 100.0
"""Images within so many turns of the nearest one are listed: some files have limits of 1e30 rad."""


def images(robot: Robot, q: Array, near: Array) -> list[Array]:
    """Return for each joint all values within its limits that equal that of q (n,) up to whole turns, nearest first.

    Every combination reaches the same pose. A joint without limits has the image nearest to `near` (n,) and the images
    one turn from it. A joint has no image if none is within its limits. A prismatic joint, or the leader of a
    fractional follower, has no other image than q.
    """
    return [_of_joint(robot, j, float(q[j]), float(near[j])) for j in range(robot.n)]


def images_within(robot: Robot, limits: Limits, Q: Array, near: Array) -> Array:
    """Return configurations (m, n) within limits of position that equal those of Q (k, n) up to whole turns.

    Of each those whose joints are nearest to `near` (n,), and those with one joint a turn farther. Joints that turn
    are brought into their own ranges, which need not hold the angles from -pi to pi.
    """
    turning = robot.whole_turns
    low, high = _turns_within(limits, Q)
    turns = np.clip(np.round((near - Q) / _TURN), low, high)
    base = np.where(turning & (low <= high), Q + _TURN * turns, Q)
    steps = _TURN * np.eye(robot.n)[turning & (limits.upper - limits.lower >= _TURN)]
    farther = np.stack([-steps, steps], axis=1).reshape(-1, robot.n)
    every = (base + np.concatenate([np.zeros((1, robot.n)), farther])[:, None]).reshape(-1, robot.n)
    every = _on_limits(limits, every)
    return np.asarray(every[~limits.outside(every).any(axis=1)])


def whole_turns(robot: Robot, q: Array, near: Array, count: int, moving: Flags | None = None) -> list[Array]:
    """Return up to `count` configurations equal to q (n,) up to whole turns, the soonest from `near` (n,) first.

    Each joint takes its two images nearest to `near`; a joint without images keeps its value in q, and so does one that
    is not among the `moving` (n,), where these are given.
    """
    turning = robot.whole_turns if moving is None else robot.whole_turns & moving
    low, high = _turns_within(robot.limits, q)
    if not (turning & (low < high)).any():  # most arms: no joint has a choice
        return [_on_limits(robot.limits, np.where(turning & (low == high), q + _TURN * low, q))][:count]
    found = [values if turning[j] else values[:1] for j, values in enumerate(images(robot, q, near))]
    every = [values[:2] if len(values) else q[j : j + 1] for j, values in enumerate(found)]
    return _soonest(robot, every, near, count)


def apart(robot: Robot, q: Array, other: Array) -> float:
    """Return the largest difference of a joint, rad or m, between configurations (n,), up to whole turns."""
    difference = np.abs(q - other)
    turned = np.abs(np.remainder(difference + np.pi, _TURN) - np.pi)
    return float(np.where(robot.whole_turns, turned, difference).max(initial=0.0))


def endless_turns(robot: Robot, q: Array, near: Array, count: int) -> list[Array]:
    """Return up to `count` configurations equal to q (n,) up to whole turns of endless joints.

    The soonest from `near` (n,) come first. Each endless joint takes its two images nearest to `near`; the others keep
    their values.
    """
    endless = robot.endless
    if not endless.any():
        return [q]
    every = [_of_joint(robot, j, q[j], near[j])[:2] if endless[j] else q[j : j + 1] for j in range(robot.n)]
    return _soonest(robot, every, near, count)


def _turns_within(limits: Limits, Q: Array) -> tuple[Array, Array]:
    """Return the least and the largest number of whole turns, (..., n) each, that keep Q (..., n) within limits.

    Where none does, the least is the larger one.
    """
    return np.ceil((limits.lower - ROUNDING - Q) / _TURN), np.floor((limits.upper + ROUNDING - Q) / _TURN)


def _on_limits(limits: Limits, Q: Array) -> Array:
    """Return Q (..., n) with values that rounding took out of their limits put on them."""
    inside = np.clip(Q, limits.lower, limits.upper)
    return np.where(np.abs(inside - Q) <= ROUNDING, inside, Q)


def _soonest(robot: Robot, every: list[Array], near: Array, count: int) -> list[Array]:
    """Return up to `count` combinations of one or two values of each joint, the soonest from `near` (n,) first.

    A combination takes as long as its slowest joint. So of k joints whose second values are the soonest, all 2^k >=
    `count` combinations take no longer than any in which another joint has its second value.
    """
    speed = robot.limits.velocity
    second = {j: abs(values[1] - near[j]) / speed[j] for j, values in enumerate(every) if len(values) > 1}
    soonest = sorted(second, key=second.__getitem__)[: (count - 1).bit_length()]
    choices = [values if j in soonest else values[:1] for j, values in enumerate(every)]
    found = [np.array(image) for image in product(*choices)]
    return sorted(found, key=lambda image: float((np.abs(image - near) / speed).max()))[:count]


def _of_joint(robot: Robot, j: int, value: float, near: float) -> Array:
    lower, upper = float(robot.limits.lower[j]), float(robot.limits.upper[j])
    if not robot.whole_turns[j]:
        held = min(max(value, lower), upper)
        return np.array([held] if abs(held - value) <= ROUNDING else [])
    low, high = np.ceil((lower - ROUNDING - value) / _TURN), np.floor((upper + ROUNDING - value) / _TURN)
    most = MOST_TURNS if np.isfinite(high - low) else 1.0
    middle = np.clip(np.round((near - value) / _TURN), low, high)
    turns = np.arange(max(low, middle - most), min(high, middle + most) + 1.0)
    values = np.clip(value + _TURN * turns, lower, upper)
    return np.asarray(values[np.argsort(np.abs(values - near), kind="stable")])
