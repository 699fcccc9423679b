"""Results of queries: pairs of bodies, their nearest points and the normals between these."""

from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.geometry.coal_queries import DISTANCE_ERROR
from optiplan.records import dataclass


@dataclass(frozen=True, slots=True)
class Pair:
    """Two bodies that must stay apart: indices into `CollisionModel.geometry`, and their names."""

    index: int
    a: int
    b: int
    name_a: str
    name_b: str


@dataclass(frozen=True, eq=False)
class Contact:
    """The nearest points of a pair, world frame.

    Attributes:
        distance: m; negative is the depth of penetration.
        point_a: (3,) on body a; `point_b`: on body b; m.
        normal: (3,) unit vector from a to b, so that distance = normal . (point_b - point_a).
        apart: m, how far the bodies are apart, where `distance` is what is left of that above their floor; else None.
    """

    pair: Pair
    distance: float
    point_a: Array
    point_b: Array
    normal: Array
    apart: float | None = None

    @property
    def bodies_apart(self) -> float:
        """How far the bodies are apart, m."""
        return self.distance if self.apart is None else self.apart

    @property
    def meeting(self) -> str:
        """Return "'a' meets 'b'", with the names of the bodies, or how much nearer than required they come."""
        if self.apart is not None and self.apart > 0.0:
            near = f"comes within {1e3 * self.apart:.3g} mm of"
            return f"'{self.pair.name_a}' {near} '{self.pair.name_b}', nearer than the clearance required"
        return f"'{self.pair.name_a}' meets '{self.pair.name_b}'"

    @property
    def overlap(self) -> str:
        """Return how deep two bodies overlap, or how near they are where that is nearer than required."""
        names = f"'{self.pair.name_a}' and '{self.pair.name_b}'"
        if self.apart is not None and self.apart > 0.0:
            return f"{names} are {1e3 * self.apart:.3g} mm apart, nearer than the clearance required"
        return f"{names} overlap by {1e3 * max(0.0, -self.bodies_apart):.3g} mm"


class Contacts(NamedTuple):
    """K near pairs at N configurations, as arrays.

    Attributes:
        rows: (K,) which configuration.
        pairs: (K,) index of the pair.
        distance: (K,) m, negative when penetrating.
        points: (K, 2, 3) nearest points on bodies a and b, m, world.
        normals: (K, 3) unit vectors from a to b, world.
    """

    rows: Index
    pairs: Index
    distance: Array
    points: Array
    normals: Array


def unit_normals(distances: Array, vectors: Array) -> Array:
    """Return unit normals (K, 3) from a to b; vectors (K, 3, 3) are witness points a and b and coal's normal.

    coal leaves the normal of two triangle meshes unset. If bodies are apart, the witness points define it.
    """
    gap = vectors[:, 1] - vectors[:, 0]
    length = np.linalg.norm(gap, axis=1, keepdims=True)
    apart = (distances > DISTANCE_ERROR)[:, None] & (length > 0.0)
    return np.where(apart, gap / np.where(apart, length, 1.0), vectors[:, 2])
