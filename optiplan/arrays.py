"""The array types of the project, whose shape and unit stand in the docstring of what uses them; and unit vectors."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeGuard, TypeVar

import numpy as np
import numpy.typing as npt

from optiplan.errors import described, wrong_argument

Array = npt.NDArray[np.float64]
"""Array of float64."""

Flags = npt.NDArray[np.bool_]
"""Array of truth values."""

Index = npt.NDArray[np.intp]
"""Array of indices."""

Kind = TypeVar("Kind", bound=npt.NDArray[Any])

UNIT_TOLERANCE = 1e-3
"""How far the length of a unit vector or quaternion written by hand may be from 1; it is normalised then."""


class ReadOnlyArrays:
    """What has arrays that nobody may write into, also as a deep copy, or as it comes from another process.

    Of a frozen dataclass the attributes that are arrays are copied.
    """

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if isinstance(value, np.ndarray) and value.flags.writeable:
                object.__setattr__(self, name, read_only(value.copy()))

    def __setstate__(self, state: dict[str, Any]) -> None:
        _protect(state.values())
        self.__dict__.update(state)


def read_only(array: Kind) -> Kind:
    """Return the array itself, which nobody may write into from now on."""
    array.flags.writeable = False
    return array


def _protect(values: Iterable[Any]) -> None:
    """Make arrays read-only, also those in tuples and mappings."""
    for value in values:
        if isinstance(value, np.ndarray):
            read_only(value)
        elif isinstance(value, tuple | dict):
            _protect(value.values() if isinstance(value, dict) else value)


def is_finite(value: Any) -> TypeGuard[float]:
    """Whether it is a number that a float can hold, of Python or numpy: no truth value, NaN or infinity."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number of hundreds of digits
        return False


def finite_or_none(value: float) -> float | None:
    """Return a number as JSON has it; NaN and the infinities are null there."""
    return float(value) if math.isfinite(value) else None


def is_listed(value: Any) -> bool:
    """Whether it is a list of whatever kind: no text, mapping, or array of a single number."""
    shape: Any = getattr(value, "shape", None)
    return isinstance(value, Iterable) and not isinstance(value, str | bytes | Mapping) and shape != ()


def number_argument(
    function: str,
    argument: str,
    value: Any,
    expected: str,
    least: float = -math.inf,
    *,
    above: float = -math.inf,
    most: float = math.inf,
) -> float:
    """Return an argument as a float.

    Raises:
        InputError: it is no finite number, less than `least`, not above `above`, or more than `most`.
    """
    if not is_finite(value) or not least <= value <= most or value <= above:
        raise wrong_argument(function, argument, described(value), expected)
    return float(value)


def parts_of(counts: Index) -> tuple[Index, Index]:
    """Of K wholes cut into `counts` (K,) parts each: the whole of each part, and its place in it, (N,) each."""
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)


def distinct(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The values of an array, rising, each once: `np.unique`, whose first call imports masked arrays (5 ms)."""
    ordered = np.sort(values, axis=None)
    return ordered[np.concatenate([[True], ordered[1:] != ordered[:-1]])] if len(ordered) else ordered


def cross(a: Array, b: Array) -> Array:
    """Vector products (..., 3) along the last axis: `np.cross`, whose checks take ten times longer on a few rows."""
    found = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.subtract(a[..., j] * b[..., k], a[..., k] * b[..., j], out=found[..., i])
    return found


def unit_vector(values: Sequence[float]) -> Array:
    """The vector or quaternion, of shape (k,), divided by its length.

    Raises:
        ValueError: its length is not 1 within `UNIT_TOLERANCE`.
    """
    vector = np.asarray(values, float)
    length = math.hypot(*vector)  # no overflow for numbers that are huge by mistake
    if not abs(length - 1.0) <= UNIT_TOLERANCE:  # written so that NaN is refused too
        raise ValueError(f"found length {length:.6g}; expected unit length (1 ± {UNIT_TOLERANCE:g})")
    return vector / length
