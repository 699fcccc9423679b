"""What all statements of path constraints share."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Self, TypeAlias

import numpy as np

from optiplan.arrays import Array

During: TypeAlias = tuple[float, float]
"""Part of the motion, as fractions of its duration."""

WHOLE: During = (0.0, 1.0)


class Statement(ABC):
    """A path constraint: what holds, in numbers, and how a problem file says it.

    Attributes:
        KEY: in a problem file.
        during: part of the motion.
    """

    KEY: ClassVar[str]

    during: During

    @classmethod
    @abstractmethod
    def of(cls, data: Mapping[str, Any], frame: str, during: During) -> Self:
        """Return the constraint of a validated entry of a file, all values there; `frame` is the one it is about."""

    @abstractmethod
    def to_data(self) -> dict[str, Any]:
        """Return its values as a problem file says them, `frame` and `during` aside."""


def unit(values: Any) -> Array:
    """Return the direction (3,) of unit length."""
    vector = np.array(values, float)
    return vector / float(np.linalg.norm(vector))


def circle_of(start: Array, through: Array, end: Array) -> tuple[Array, Array, float, float]:
    """Return centre (3,), unit normal (3,), radius and angle of the arc from one point to another through a third."""
    u, v = through - start, end - start
    normal = np.cross(u, v)
    centre = start + np.cross(normal, u * (v @ v) * -1.0 + v * (u @ u)) / (-2.0 * (normal @ normal))
    normal = normal / float(np.linalg.norm(normal))
    a, b = start - centre, end - centre
    angle = float(np.arctan2(normal @ np.cross(a, b), a @ b)) % (2.0 * np.pi)
    return centre, normal, float(np.linalg.norm(a)), angle
