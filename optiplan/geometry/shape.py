"""What every shape of an obstacle or attached object says of itself."""

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Self

import coal
import numpy as np

from optiplan.arrays import Array


class Shape(ABC):
    """A solid in its own frame, lengths in m.

    Attributes:
        body_type: class of coal that is this shape and no other; None where there is none.
        endless: whether it has no bounds, so that nothing can carry it.
    """

    body_type: ClassVar[type[coal.CollisionGeometry] | None] = None
    endless: ClassVar[bool] = False

    @classmethod
    @abstractmethod
    def from_data(cls, data: Any) -> Self:
        """The shape that a value of `ShapeSpec` means."""

    @abstractmethod
    def to_data(self) -> Any:
        """What a problem file says of it, JSON-ready: the inverse of `from_data`."""

    @abstractmethod
    def body(self) -> coal.CollisionGeometry:
        """What coal tests.

        Raises:
            ValueError: it cannot be made.
        """

    def same_body(self, other: "Shape") -> bool:
        """Whether another shape is this body, to the last digit; files of one name may hold others."""
        return self == other

    @classmethod
    def of_body(cls, body: Any) -> Self:
        """The shape of a body of `body_type`."""
        raise NotImplementedError(cls.__name__)

    def support(self, n: Array) -> Array:
        """h(n) = max of n . x over its points x; n (K, 3) of any length, result (K,), m; infinite where unknown."""
        return np.full(len(n), np.inf)

    def picture(self) -> dict[str, Any] | Array | None:
        """What the page draws.

        A `kind` of shapes.js with its dimensions; points (k, 3), m, whose convex hull is drawn; or None, for what the
        triangles of the body tell.
        """
        return None
