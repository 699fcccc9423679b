"""Arrays of a trajectory's polynomial pieces: what is wrong with them, and how they are read from JSON."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from optiplan.arrays import Array
from optiplan.errors import InputError, Issue

_MOST_DEGREE = 31  # powers of time beyond that leave no digits


class Defect(NamedTuple):
    """Why arrays are no trajectory."""

    field: str
    found: str
    expected: str


class Pieces(NamedTuple):
    """Joint names (n), breakpoints (m + 1,), s, and coefficients (m, degree + 1, n) of a trajectory."""

    joint_names: tuple[str, ...]
    breakpoints: Array
    coefficients: Array


def defect(joint_names: tuple[str, ...], breakpoints: Array, coefficients: Array) -> Defect | None:
    """Return why these arrays are no valid Trajectory, or None."""
    m, n = len(breakpoints) - 1 if breakpoints.ndim == 1 else 0, len(joint_names)
    if m < 1:
        return Defect("breakpoints", f"shape {breakpoints.shape}", "two times or more")
    if n < 1 or len(set(joint_names)) < n:
        return Defect("joint_names", f"{joint_names!r:.120}", "one or more different names")
    if not "".join(map(str, joint_names)).isprintable():  # they stand in programs that are exported
        return Defect("joint_names", f"{joint_names!r:.120}", "names without control characters or unusual blanks")
    if coefficients.ndim != 3 or coefficients.shape[::2] != (m, n) or coefficients.shape[1] < 1:
        expected = f"({m}, degree + 1, {n}) for {m} pieces and {n} joints"
        return Defect("coefficients", f"shape {coefficients.shape}", expected)
    if coefficients.shape[1] > _MOST_DEGREE + 1:
        return Defect("coefficients", f"degree {coefficients.shape[1] - 1}", f"at most {_MOST_DEGREE}")
    if not np.isfinite(breakpoints).all():
        return Defect("breakpoints", f"{breakpoints[~np.isfinite(breakpoints)][0]}", "finite numbers")
    if not np.isfinite(coefficients).all():
        return Defect("coefficients", f"{coefficients[~np.isfinite(coefficients)][0]}", "finite numbers")
    if breakpoints[0] != 0.0:
        return Defect("breakpoints", f"first {breakpoints[0]}", "the first to be 0")
    if not (np.diff(breakpoints) > 0).all():
        i = int(np.argmin(np.diff(breakpoints)))
        return Defect("breakpoints", f"{breakpoints[i]} followed by {breakpoints[i + 1]}", "increasing times")
    return None


def lasting(breakpoints: Array, coefficients: Array) -> tuple[Array, Array]:
    """Return breakpoints (m + 1,) and coefficients (m, …) without pieces whose two times rounding has made one."""
    lasts = np.diff(breakpoints) > 0.0
    if lasts.all():
        return breakpoints, coefficients
    return breakpoints[np.append(True, lasts)], coefficients[lasts]


def read_pieces(data: Any, file: str) -> Pieces:
    """Return the pieces of a trajectory from parsed JSON.

    Raises:
        InputError: naming the field that is missing, misshapen, not finite or out of order.
    """
    pieces = data.get("pieces") if isinstance(data, Mapping) else None
    if not isinstance(pieces, Mapping):
        raise InputError([Issue(file, None, "pieces", "nothing", "{breakpoints, coefficients}")])
    names = joint_names_in(data, file)
    breakpoints = json_array(pieces.get("breakpoints"), file, "pieces.breakpoints")
    coefficients = json_array(pieces.get("coefficients"), file, "pieces.coefficients")
    problem = defect(tuple(names), breakpoints, coefficients)
    if problem is not None:
        field = problem.field if problem.field == "joint_names" else f"pieces.{problem.field}"
        raise InputError([Issue(file, None, field, problem.found, problem.expected)])
    return Pieces(tuple(names), breakpoints, coefficients)


def joint_names_in(data: Mapping[str, Any], file: str, usual: list[str] | None = None) -> list[str]:
    """Return the names of the joints in parsed JSON, or the usual ones where it has none.

    Raises:
        InputError: it is no list of names.
    """
    names = data.get("joint_names", usual)
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise InputError([Issue(file, None, "joint_names", f"{names!r:.120}", "a list of names")])
    return names


def json_array(value: Any, file: str, field: str) -> Array:
    """Return parsed JSON as an array.

    Raises:
        InputError: it holds anything but numbers, or rows of different lengths.
    """
    expected = "nested lists of numbers, all rows of one length"
    try:
        array = np.array(value)
    except ValueError:
        raise InputError([Issue(file, None, field, "rows of different lengths", expected)]) from None
    if array.dtype.kind not in "if" or _holds_truth(value):
        found = "nothing" if value is None else "other things than numbers"
        raise InputError([Issue(file, None, field, found, expected)])
    return array.astype(float)


def _holds_truth(value: Any) -> bool:
    """Return whether nested lists hold true or false, which Python takes for 1 and 0."""
    return isinstance(value, bool) or (isinstance(value, list) and any(map(_holds_truth, value)))
