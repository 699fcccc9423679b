"""`tracking_error` of a problem: how far the robot's joints may be from the motion that is planned for them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array, is_finite
from optiplan.config.document import Document
from optiplan.config.simple_yaml import Place
from optiplan.errors import Issue, described, wrong_argument
from optiplan.robot.given_configurations import configuration, wrong_names
from optiplan.robot.limits import Limits
from optiplan.robot.robot import Robot

KEY = "tracking_error"

_SPARE = 1e-6
"""rad or m: what the verifier lets position limits be passed by is left to it."""

_ROUNDING = 0.5 * _SPARE
"""rad or m: motions that rest at a narrower limit end beyond it by less, and may be gone on from there."""

TrackingError = float | Sequence[float] | Mapping[str, float]
"""rad or m: one number for all joints, or a value for each."""


def error_of_joints(document: Document, robot: Robot, stated: TrackingError | None) -> tuple[Array, list[Issue]]:
    """Return the error of each joint (n,), rad or m, and what is wrong with it."""
    blank = np.zeros(robot.n)
    if stated is None or isinstance(stated, int | float):
        return blank + (stated or 0.0), []
    if isinstance(stated, Mapping):
        wrong = wrong_names(robot.joint_names, stated)
        issues = [document.issue((KEY, *([] if joint is None else [joint])), *words) for joint, *words in wrong]
        return (blank, issues) if issues else (np.array([stated[name] for name in robot.joint_names]), [])
    if len(stated) != robot.n:
        expected = f"one number, or {robot.n} values, one for each of {', '.join(robot.joint_names)}"
        return blank, [document.issue((KEY,), f"{len(stated)} values", expected)]
    return np.array(stated, dtype=float), []


def error_argument(function: str, robot: Robot, value: TrackingError | Array) -> Array:
    """Return the argument `tracking_error` of a function as the error of each joint (n,), rad or m.

    Raises:
        InputError: no number >= 0, and none for each joint.
    """
    try:
        error = configuration(robot.joint_names, {}, [value] * robot.n if is_finite(value) else value, function, KEY)
    except ValueError:
        raise wrong_argument(function, KEY, described(value), "numbers >= 0") from None
    if (error < 0.0).any():
        raise wrong_argument(function, KEY, described(value), "numbers >= 0, rad or m")
    return error


def room_at_limits(error: Array) -> Array:
    """Return how far motions stay from limits of position (n,), rad or m: where there is an error, 1e-6 more."""
    return np.where(error > 0.0, error + _SPARE, 0.0)


def narrower_limits(limits: Limits, error: Array, ends: Array) -> Limits:
    """Return the limits that motions keep with the error (n,); ends (k, n) beyond them by rounding are within."""
    room, off = room_at_limits(error), np.where(error > 0.0, _ROUNDING, 0.0)
    lower, upper = limits.lower + room, limits.upper - room
    return replace(
        limits,
        lower=np.clip(ends.min(axis=0), lower - off, lower),
        upper=np.clip(ends.max(axis=0), upper, upper + off),
    )


class StatedEnd(NamedTuple):
    """Values q (k,), rad or m, of some joints, and where they are stated."""

    place: Place
    q: Array
    joints: Sequence[str]


def nearer_than_error(
    document: Document, robot: Robot, limits: Limits, error: Array, alternatives: Iterable[Sequence[StatedEnd]]
) -> list[Issue]:
    """Report joint values nearer to a limit of position than the tracking error (n,), where all alternatives are."""
    issues = []
    for ends in alternatives:
        found = [_near(document, robot, limits, error, end) for end in ends]
        issues += [issue for near in found if all(found) for issue in near]
    return issues


def _near(document: Document, robot: Robot, limits: Limits, error: Array, end: StatedEnd) -> list[Issue]:
    """Values that are beyond a narrower limit by rounding are none of them: see `narrower_limits`."""
    issues, room = [], room_at_limits(error)
    for name, value in zip(end.joints, end.q.tolist(), strict=True):
        j = robot.joint_names.index(name)
        low, high = limits.lower[j] + room[j], limits.upper[j] - room[j]
        if error[j] > 0.0 and not low - _ROUNDING <= value <= high + _ROUNDING:
            found = f"{name} = {value:.10g}, nearer to its limit than the tracking error"
            fits = f"a value in [{low:.10g}, {high:.10g}]" if low <= high else "a smaller tracking error"
            issues.append(document.issue(end.place, found, fits))
    return issues
