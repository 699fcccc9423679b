"""Checks of what tasks and limits are given; errors name the class and the argument."""

import math

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array, Flags, number_argument
from optiplan.errors import UnknownChoiceError, described, wrong_argument
from optiplan.robot.robot import Robot


def squares_are_finite(*arrays: Array) -> bool:
    """Whether there is no NaN and no infinity in arrays, nor a number whose square is none; in every step of a loop."""
    if core is not None:
        return core.is_finite(*arrays)
    return math.isfinite(sum(float(np.vdot(array, array)) for array in arrays))


def checked_number(owner: object, argument: str, value: object, least: float) -> float:
    """A finite number of at least `least`.

    Raises:
        InputError: it is none.
    """
    return number_argument(type(owner).__name__, argument, value, f"a finite number >= {least:g}", least)


def checked_vector(owner: object, argument: str, value: object, size: int, least: float = -np.inf) -> Array:
    """Numbers (size,), all finite; one number stands for all.

    Raises:
        InputError: other than that.
    """
    if (
        type(value) is np.ndarray
        and value.dtype == np.float64
        and value.shape == (size,)
        and least == -np.inf
        and squares_are_finite(value)
    ):
        return value.copy()
    expected = f"{size} finite numbers" + ("" if least == -np.inf else f" >= {least:g}")
    vector = spread_vector(owner, argument, value, size, expected)
    return _good(owner, argument, vector, np.isfinite(vector) & (vector >= least), expected)


def positive_vector(owner: object, argument: str, value: object, size: int) -> Array:
    """Numbers > 0 (size,), of which infinity is one; one number stands for all.

    Raises:
        InputError: other than that.
    """
    expected = f"{size} numbers > 0"
    vector = spread_vector(owner, argument, value, size, expected)
    return _good(owner, argument, vector, vector > 0.0, expected)


def spread_vector(owner: object, argument: str, value: object, size: int, expected: str) -> Array:
    """Numbers (size,), of any value; one number stands for all.

    Raises:
        InputError: no numbers, or another count of them.
    """
    try:
        return np.array(np.broadcast_to(np.asarray(value, dtype=np.float64), (size,)))
    except (TypeError, ValueError, OverflowError):
        raise wrong_argument(type(owner).__name__, argument, described(value), expected) from None


def _good(owner: object, argument: str, vector: Array, good: Flags, expected: str) -> Array:
    for k in np.flatnonzero(~good)[:1].tolist():
        raise wrong_argument(type(owner).__name__, f"{argument}[{k}]", f"{vector[k]:g}", expected)
    return vector


def checked_direction(owner: object, argument: str, value: object, expected: str) -> Array:
    """The direction (3,) of a vector of any length > 0.

    Raises:
        InputError: other than three finite numbers, or a length of 0.
    """
    vector = checked_vector(owner, argument, value, 3)
    length = float(np.linalg.norm(vector))
    if length == 0.0:
        raise wrong_argument(type(owner).__name__, argument, "a vector of length 0", expected)
    return vector / length


def pose_cost(owner: object, position: object, orientation: object) -> Array:
    """Weights (6,) of a pose: `position_cost` per metre, one or three, then `orientation_cost` per radian.

    Raises:
        InputError: other than finite numbers >= 0.
    """
    parts = {"position_cost": position, "orientation_cost": orientation}
    return np.concatenate([checked_vector(owner, name, value, 3, least=0.0) for name, value in parts.items()])


def frame_index(owner: object, argument: str, robot: Robot, name: str) -> int:
    """Index of a frame of the robot.

    Raises:
        InputError: there is none of that name.
    """
    try:
        return robot.frame_id(name)
    except UnknownChoiceError as error:
        raise error.of_argument(type(owner).__name__, argument) from None


def robot_with_masses(owner: object, robot: Robot) -> None:
    """Refuse a robot without masses.

    Raises:
        InputError: its description has none.
    """
    if not robot.has_inertia:
        expected = "a robot with masses in its description"
        raise wrong_argument(type(owner).__name__, "robot", f"'{robot.name}', which has none", expected)
