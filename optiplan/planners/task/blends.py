"""Rounded corners of two lines, which the tool passes without stopping.

In a corner C the line before, with direction a per metre, and the one after, with b, overlap. Sigma, m, is the way from
the corner along both: p = C + a f(sigma) + b g(sigma) for |sigma| <= r. Of these, f slows down from slope 1 to a stop,
and g runs up. Both are polynomials of degree five whose second derivatives vanish at both ends. So the tool leaves one
line and joins the other twice continuously differentiably, f' + g' = 1, and stays within r of the corner. Rotations
about the axes of both lines overlap in the same way.
"""

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, cross
from optiplan.planners.cartesian.tool_path import line
from optiplan.records import dataclass

_LEAST = 1e-6
"""m: shorter lines, and smaller radii, have no blend."""

_TURN_BACK = -0.999
"""Cosine of the angle between two lines below which the second one leads back."""

_SLOWING = np.array([-1.0, -0.6, -0.2, 0.0, 0.0, 0.0])
"""Control points of f over r, a Bézier curve of degree five; those of g are the same reversed, with the other sign."""

_WITHIN = 0.98
"""Share of the radius that is used: the rest is room for rounding in the proof."""

_OF_LINE = 0.45
"""Share of the length of a line that a corner may take, at most."""


@dataclass(frozen=True, eq=False)
class LineSegment:
    """A line from corner to corner: X(lambda) = (p + lambda d, exp(lambda w) R), lambda in [0, length], m."""

    start: pin.SE3
    length: float
    direction: Array
    turning: Array

    @classmethod
    def between(cls, start: pin.SE3, end: pin.SE3) -> "LineSegment | None":
        """Return the line between two poses; None where it has no length to measure by."""
        path = line(start, end)
        if path.length < _LEAST:
            return None
        return cls(start, path.length, path.velocity / path.length, path.turning / path.length)


@dataclass(frozen=True, eq=False)
class Corner:
    """Where one line ends and the next begins, rounded off within a radius, m."""

    X_WC: pin.SE3
    before: LineSegment
    after: LineSegment
    radius: float

    @classmethod
    def of(cls, before: LineSegment | None, after: LineSegment | None, wanted: float) -> "Corner | None":
        """Return the corner with the wanted radius, or with that of the lines; None where it must be exact."""
        if before is None or after is None or before.direction @ after.direction < _TURN_BACK:
            return None
        radius = min(_WITHIN * wanted, _OF_LINE * before.length, _OF_LINE * after.length)
        return cls(after.start, before, after, radius) if radius >= _LEAST else None

    def state(self, sigma: float) -> tuple[pin.SE3, Array, Array]:
        """Return pose, twist (6,) and its rate (6,) by sigma, m from the corner, negative before it."""
        f, g = _overlap(sigma, self.radius)
        a, b = self.before, self.after
        position = self.X_WC.translation + f[0] * a.direction + g[0] * b.direction
        second = pin.exp3(g[0] * b.turning)
        rotation = second @ pin.exp3(f[0] * a.turning) @ self.X_WC.rotation
        first, spin = second @ a.turning, g[1] * b.turning
        twist = np.concatenate([f[1] * a.direction + g[1] * b.direction, spin + f[1] * first])
        spin_rate = g[2] * b.turning + f[1] * cross(spin, first) + f[2] * first
        return pin.SE3(rotation, position), twist, np.concatenate([f[2] * a.direction + g[2] * b.direction, spin_rate])


class BlendedLine:
    """A line whose corners, at one end or both, are rounded off: from the middle of one to the middle of the other.

    To `path_following.follow` it is a path over s = lambda / length.
    """

    def __init__(self, way: LineSegment, begins: Corner | None, ends: Corner | None) -> None:
        self.way, self.begins, self.ends = way, begins, ends
        self._last: tuple[float, tuple[pin.SE3, Array, Array]] | None = None

    def pose(self, s: float) -> pin.SE3:
        """X_WF(s)."""
        return self._state(s)[0]

    def twist(self, s: float) -> Array:
        """dX/ds (6,), in world axes."""
        return self._state(s)[1] * self.way.length

    def twist_rate(self, s: float) -> Array:
        """d/ds of `twist`, (6,)."""
        return self._state(s)[2] * self.way.length**2

    def _state(self, s: float) -> tuple[pin.SE3, Array, Array]:
        last = self._last
        if last is None or last[0] != s:  # whoever follows the line asks for pose, twist and rate at the same place
            last = self._last = s, self._state_at(s)
        return last[1]

    def _state_at(self, s: float) -> tuple[pin.SE3, Array, Array]:
        way, at = self.way, s * self.way.length
        if self.begins is not None and at <= self.begins.radius:
            return self.begins.state(at)
        if self.ends is not None and at >= way.length - self.ends.radius:
            return self.ends.state(at - way.length)
        rotation = pin.exp3(at * way.turning) @ way.start.rotation
        position = way.start.translation + at * way.direction
        return pin.SE3(rotation, position), np.concatenate([way.direction, way.turning]), np.zeros(6)


def _overlap(sigma: float, radius: float) -> tuple[Array, Array]:
    """Return f and g with two derivatives, (3,) each, at sigma."""
    f, g = _SLOWING * radius, -_SLOWING[::-1] * radius
    u, found = (sigma + radius) / (2.0 * radius), []
    for points in (f, g):
        values, scale = [], 1.0
        for order in range(3):
            values.append(scale * _bezier(points, u))
            scale *= (5 - order) / (2.0 * radius)
            points = np.diff(points)
        found.append(np.array(values))
    return found[0], found[1]


def _bezier(points: Array, u: float) -> float:
    """Return the value of a Bézier curve at u, by de Casteljau's algorithm."""
    while len(points) > 1:
        points = (1.0 - u) * points[:-1] + u * points[1:]
    return float(points[0])
