"""What all statements of path constraints share."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self, TypeAlias

import numpy as np
from pydantic import AfterValidator

from optiplan.arrays import Array
from optiplan.config.document import Number, Strict
from optiplan.config.simple_yaml import Place
from optiplan.config.values import Name

During: TypeAlias = tuple[float, float]
"""Part of the motion, as fractions of its duration."""

WHOLE: During = (0.0, 1.0)


class Mention(NamedTuple):
    """A name in a constraint: where it stands under the constraint's key, and of what kind it is."""

    place: Place
    kind: Literal["frame", "body", "joint"]
    name: str


def _ordered(values: tuple[float, ...]) -> tuple[float, ...]:
    if len(values) != 2 or not 0.0 <= values[0] < values[1] <= 1.0:
        expected = "two fractions of the duration, [from, to] with 0 <= from < to <= 1"
        raise ValueError(f"found {list(values)}; expected {expected}")
    return values


Part = Annotated[tuple[Number, ...], AfterValidator(_ordered)]
"""Part of the motion, as a file states it."""


class ConstraintSpec(Strict):
    """What all path constraints have; `frame` is the robot's tool frame without one."""

    frame: Name | None = None
    during: Part | None = None


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

    def to_data(self) -> dict[str, Any]:
        """Return its values as a problem file says them, `frame` and `during` aside: by the names of its attributes."""
        return {name: value for name, value in vars(self).items() if name not in ("frame", "during")}

    def mentioned(self) -> list[Mention]:
        """Return the names of what the robot or the scene must have."""
        frame = getattr(self, "frame", None)
        return [] if frame is None else [Mention(("frame",), "frame", frame)]


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
