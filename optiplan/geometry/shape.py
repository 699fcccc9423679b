"""The interface of every shape of an obstacle or attached object."""

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Self

import coal
import numpy as np

from optiplan.arrays import Array


class Shape(ABC):
    """A solid in its own frame, lengths in m.

    Attributes:
        body_type: class of coal for this shape alone; None where there is none.
        endless: whether it is unbounded, so that no link can hold it.
    """

    body_type: ClassVar[type[coal.CollisionGeometry] | None] = None
    endless: ClassVar[bool] = False

    @classmethod
    @abstractmethod
    def from_data(cls, data: Any) -> Self:
        """Return the shape of a value in `ShapeSpec`."""

    @abstractmethod
    def to_data(self) -> Any:
        """Return its value in a problem file, JSON-ready: the inverse of `from_data`."""

    @abstractmethod
    def body(self) -> coal.CollisionGeometry:
        """Return the geometry of coal.

        Raises:
            ValueError: it cannot be built.
        """

    def same_body(self, other: "Shape") -> bool:
        """Return whether another shape has exactly the same body; files of one name may differ in content."""
        return self == other

    @classmethod
    def of_body(cls, body: Any) -> Self:
        """Return the shape of a body of `body_type`."""
        raise NotImplementedError(cls.__name__)

    def support(self, n: Array) -> Array:
        """Return h(n) = max of n . x over its points x, (K,), m; n (K, 3) of any length; infinite where unknown."""
        return np.full(len(n), np.inf)

    def picture(self) -> dict[str, Any] | Array | None:
        """Return the drawing on the page.

        A `kind` of shapes.js with its dimensions; points (k, 3), m, whose convex hull is drawn; or None, for the
        triangles of the body.
        """
        return None
