"""The schema of a goal region in a problem file."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

import numpy as np
import pinocchio as pin
from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from optiplan.arrays import Array
from optiplan.config.document import Strict
from optiplan.config.values import Coordinate, Length, Name
from optiplan.geometry.pose import PoseSpec, ToleranceSpec
from optiplan.geometry.poses import pose_from_data

FREE: Literal["free"] = "free"

AXES = ("x", "y", "z")

MOST_TURN = 3.0
"""rad; rotation vectors are unique below pi only."""

_RANGE = "a number > 0 (either way), [from, to] of numbers or `free`, or `free`"


def _ordered(value: Any) -> Any:
    low, high = value
    if low != FREE and high != FREE and not low < high:
        raise ValueError(f"found [{low:g}, {high:g}]; expected [from, to] with from < to")
    if low == high == FREE:
        raise ValueError("found [free, free]; expected `free`")
    return value


def _known(value: Any) -> Any:
    if isinstance(value, bool) or (isinstance(value, str) and value != FREE) or isinstance(value, Mapping):
        raise ValueError(f"found {value!r}; expected {_RANGE}")
    if isinstance(value, list | tuple) and len(value) != 2:
        raise ValueError(f"found {len(value)} values; expected {_RANGE}")
    return tuple(value) if isinstance(value, list) else value


_End = Coordinate | Literal["free"]
Range = Annotated[
    Length | Literal["free"] | Annotated[tuple[_End, _End], AfterValidator(_ordered)],
    BeforeValidator(_known, json_schema_input_type=Length | Literal["free"] | tuple[_End, _End]),
]
"""How far a coordinate may be off: by a number either way, between two (either may be `free`), or `free`."""


def _all_alike(value: Any) -> Any:
    return dict.fromkeys(AXES, FREE) if value == FREE else value


class AxesSpec(Strict):
    """One range for each axis; an axis that is not named has the tolerance of a pose goal."""

    x: Range | None = None
    y: Range | None = None
    z: Range | None = None

    def bounds(self, usual: float) -> Array:
        """Return low and high of each axis, (2, 3), infinite where free."""
        return np.array([_bounds(getattr(self, axis) or usual) for axis in AXES]).T

    def free(self) -> int:
        """Return how many axes are free."""
        return sum(getattr(self, axis) == FREE for axis in AXES)


_Axes = Annotated[AxesSpec, BeforeValidator(_all_alike, json_schema_input_type=AxesSpec | Literal["free"])]


class RegionSpec(PoseSpec):
    """Poses of `frame` (default: the tool frame): `offset` from one anywhere in a region.

    The pose is that of the region in the world. `along` its axes a displacement may be so large, m, and `about` them a
    rotation, rad: one, or all three, may be free; beside one that is free the others say how far its axis tilts.
    """

    frame: Name | None = None
    offset: PoseSpec = PoseSpec.model_construct()
    along: _Axes = Field(default_factory=AxesSpec)
    about: _Axes = Field(default_factory=AxesSpec)

    @model_validator(mode="after")
    def _sensible(self) -> Self:
        free = self.about.free()
        if free == 2:
            raise ValueError("found rotations free about two axes; expected one of them, or `about: free`")
        if free == 3 and self.along.free() == 3:
            raise ValueError("found everything free; expected a bound along or about some axis")
        for axis in AXES:
            said = getattr(self.about, axis)
            if said not in (None, FREE):
                self._turn(axis, _bounds(said))
        return self

    @staticmethod
    def _turn(axis: str, ends: tuple[float, float]) -> None:
        if not max(map(abs, ends)) <= MOST_TURN:
            found = ", ".join("free" if math.isinf(end) else f"{end:g}" for end in ends)
            raise ValueError(
                f"found [{found}] about {axis}; expected rotations of at most {MOST_TURN:g} rad, or `free`"
            )

    def region(self) -> tuple[pin.SE3, pin.SE3, Array, Array]:
        """Return X_WR, X_RF, low (6,) and high (6,): metres, then rad."""
        usual = ToleranceSpec()
        low, high = np.hstack([self.along.bounds(usual.position), self.about.bounds(usual.orientation)])
        return pose_from_data(dict(self)), pose_from_data(dict(self.offset)), low, high


def _bounds(said: Any) -> tuple[float, float]:
    if said == FREE:
        return -math.inf, math.inf
    if isinstance(said, tuple):
        low, high = said
        return (-math.inf if low == FREE else low), (math.inf if high == FREE else high)
    return -said, said


def axes_data(low: Array, high: Array) -> dict[str, Any]:
    """Return the ranges of three axes as a problem file says them: the inverse of `AxesSpec.bounds`."""
    data: dict[str, Any] = {}
    for axis, least, most in zip(AXES, low.tolist(), high.tolist(), strict=True):
        if math.isinf(least) and math.isinf(most):
            data[axis] = FREE
        elif least == -most:
            data[axis] = most
        else:
            data[axis] = [FREE if math.isinf(end) else end for end in (least, most)]
    return data
