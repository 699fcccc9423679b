"""The polygon on which a robot stands, and how far the zero-moment point is inside it."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from optiplan.arrays import Array, ReadOnlyArrays, read_only
from optiplan.records import dataclass

_FLAT = 1e-9
"""m²: points that span less area have no inside."""


@dataclass(frozen=True, eq=False)
class SupportPolygon(ReadOnlyArrays):
    """A convex polygon in the horizontal plane z = `height` of the world.

    Attributes:
        corners: (k, 2) x and y, m, in counter-clockwise order.
        height: z of the ground, m.
    """

    corners: Array
    height: float

    @classmethod
    def of(cls, points: Sequence[Sequence[float]] | Array, height: float) -> "SupportPolygon":
        """Return the convex hull of points (k, 2), m, at a height, m.

        Raises:
            ValueError: the points lie on a line.
        """
        polygon = cls(_convex_hull(np.asarray(points, dtype=np.float64).reshape(-1, 2)), float(height))
        if polygon.area < _FLAT:
            raise ValueError("found points on one line; expected points that span an area")
        return polygon

    @cached_property
    def normals(self) -> Array:
        """Unit normals (k, 2) of the edges, inward; edge i leads from corner i to the next."""
        along = np.roll(self.corners, -1, axis=0) - self.corners
        inward = np.stack([-along[:, 1], along[:, 0]], axis=1)
        return read_only(inward / np.linalg.norm(inward, axis=1)[:, None])

    @cached_property
    def offsets(self) -> Array:
        """Distances (k,) of the edges from the origin along their normals, m: inside is n · p >= offset."""
        return read_only((self.normals * self.corners).sum(axis=1))

    @property
    def area(self) -> float:
        """Area, m²."""
        x, y = self.corners.T
        return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))

    @property
    def perimeter(self) -> float:
        """Perimeter, m."""
        return float(np.linalg.norm(np.roll(self.corners, -1, axis=0) - self.corners, axis=1).sum())

    def rows(self, margin: float = 0.0) -> Array:
        """Rows R (k, 6) with R w = (n · p - offset - margin) F_z, N·m, for wrenches w = [F; M] about the origin.

        p is the zero-moment point, n an edge's inward normal. R w >= 0 in every row, with F_z > 0, says that p lies at
        least `margin`, m, inside. The rows are linear in the wrench, so they have no pole where F_z is 0. Their sum,
        weighted by the edges' lengths, is (2 area - margin perimeter) F_z, so R w >= 0 implies F_z >= 0 where that
        factor is positive.
        """
        h, (nx, ny) = self.height, self.normals.T
        zero = np.zeros(len(nx))
        return np.stack([h * nx, h * ny, -self.offsets - margin, ny, -nx, zero], axis=1)

    def margins(self, wrench: Array) -> Array:
        """Tip-over margins (N,), m, of wrenches (N, 6): the least distance of the zero-moment point from an edge.

        Positive inside. Where the ground would have to pull (F_z <= 0) it is -infinity.
        """
        distance = zero_moment_points(wrench, self.height) @ self.normals.T - self.offsets
        return np.where(wrench[:, 2] > 0.0, distance.min(axis=1), -np.inf)


def zero_moment_points(wrench: Array, height: float) -> Array:
    """Zero-moment points (N, 2), x and y, m, on the plane z = height, of wrenches [F; M] (N, 6) about the origin.

    p = ((h F_x - M_y) / F_z, (h F_y + M_x) / F_z): about p the ground transmits no moment along x and y. Where F_z is 0
    there is none: NaN. Source: M. Vukobratović, B. Borovac, Int. J. Humanoid Robotics 1 (2004).
    """
    force = np.where(wrench[:, 2] != 0.0, wrench[:, 2], np.nan)
    x, y = height * wrench[:, 0] - wrench[:, 4], height * wrench[:, 1] + wrench[:, 3]
    return np.stack([x / force, y / force], axis=1)


def _convex_hull(points: Array) -> Array:
    """Corners (k, 2) of the convex hull of points (m, 2), counter-clockwise from the leftmost; none of a line."""
    from scipy.spatial import ConvexHull, QhullError  # here, for few robots have such a polygon

    ordered = np.unique(points, axis=0)
    try:
        corners = ConvexHull(ordered).vertices
    except (QhullError, ValueError):  # ValueError: no points
        return ordered[:0]
    return np.asarray(ordered[np.roll(corners, -int(corners.argmin()))])
