"""Elements of a path: straight and round parts, rounded corners and splines, over a parameter u from 0 to 1."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from optiplan.arrays import Array
from optiplan.libraries import loading
from optiplan.problem.constraints.base import circle_of
from optiplan.records import dataclass
from optiplan.trajectory.paths.hermite import hermite

CORNER = 1e-3
"""rad: parts that meet at a larger angle make a corner."""

_BACK = 1e-2
"""rad: a corner that is nearer to a half turn cannot be rounded."""

_TURN = 0.1
"""rad: largest turn of the curve within a part of an element that becomes a piece."""

_STRAIGHT = 0.02
"""m: longest piece of a straight part, over which directions are interpolated."""

_MOST = 200
"""Pieces of a straight part."""

_BLEND_PARTS = 16
_SPAN_PARTS = 8
_NEAR = 1e-6
"""m: points that are nearer are one."""


@dataclass(frozen=True, eq=False)
class Element:
    """A smooth part of a path.

    Attributes:
        state: p, dp/du and d²p/du² at parameters u (N,) in [0, 1]: (3, N, 3).
        parts: equal parts in u that are about as long, each nearly straight.
        uniform: length, m, where |dp/du| is constant and the part may be cut; 0 elsewhere.
        point: number of the given point where it ends.
        corner: whether it rounds the corner at that point, which is its middle then.
    """

    state: Callable[[Array], Array]
    parts: int
    uniform: float
    point: int
    corner: bool = False

    def cut(self, begin: float, end: float) -> "Element":
        """Return the part from one parameter to another."""
        width = end - begin

        def state(u: Array) -> Array:
            return np.asarray(self.state(begin + width * u) * np.array([1.0, width, width**2])[:, None, None])

        parts = max(1, int(np.ceil(self.parts * width)))
        return Element(state, parts, self.uniform * width, self.point)

    def end(self, u: float) -> Array:
        """Return point, unit tangent and curvature (3, 3) at a parameter."""
        p, d, dd = self.state(np.array([u]))[:, 0]
        return np.array([p, *_by_length(d, dd)])


def _by_length(d: Array, dd: Array) -> tuple[Array, Array]:
    """Return the derivatives (…, 3) over the length, of those over a parameter."""
    speed = np.linalg.norm(d, axis=-1, keepdims=True)
    t = d / speed
    across = dd - (dd * t).sum(axis=-1, keepdims=True) * t
    return t, across / speed**2


def straight(a: Array, b: Array, point: int) -> Element:
    """Return the straight part from a to b (3,), m."""

    def state(u: Array) -> Array:
        along = np.broadcast_to(b - a, (len(u), 3))
        return np.stack([a + u[:, None] * (b - a), along, np.zeros_like(along)])

    length = float(np.linalg.norm(b - a))
    return Element(state, min(_MOST, max(1, int(np.ceil(length / _STRAIGHT)))), length, point)


def round_part(a: Array, through: Array, b: Array, point: int) -> Element:
    """Return the arc from a through a point to b (3,), m; straight where these are in line.

    Raises:
        ValueError: two of the points are one, or b lies between the others.
    """
    if min(np.linalg.norm(b - a), np.linalg.norm(through - a), np.linalg.norm(b - through)) < _NEAR:
        raise ValueError("a point at an end of the arc")
    sides = np.cross(through - a, b - a)
    if np.linalg.norm(sides) < 1e-5 * np.linalg.norm(through - a) * np.linalg.norm(b - a):
        if (through - a) @ (b - through) < 0.0:
            raise ValueError("a point in line with both ends and not between them")
        return straight(a, b, point)
    centre, normal, radius, angle = circle_of(a, through, b)
    x = (a - centre) / radius
    y = np.cross(normal, x)

    def state(u: Array) -> Array:
        c, s = np.cos(angle * u)[:, None], np.sin(angle * u)[:, None]
        out, along = c * x + s * y, c * y - s * x
        return np.stack([centre + radius * out, radius * angle * along, -radius * angle**2 * out])

    return Element(state, max(1, int(np.ceil(angle / _TURN))), radius * angle, point)


def rounded(elements: Sequence[Element], blend: float) -> tuple[list[Element], list[int]]:
    """Return elements with rounded corners between them, and after which of these a corner is left.

    A corner is replaced from `blend`, m, before to as much after it, or half of a part where that is shorter, by a
    polynomial of degree five that keeps tangent and curvature.

    Raises:
        ValueError: a corner to round where the path goes straight back.
    """
    angles = [_angle(a.end(1.0)[1], b.end(0.0)[1]) for a, b in pairwise(elements)]
    found: list[Element] = []
    corners: list[int] = []
    begin = 0.0
    for k, one in enumerate(elements):
        corner = k < len(angles) and angles[k] > CORNER
        if not corner or blend == 0.0:
            found.append(one.cut(begin, 1.0) if begin else one)
            begin = 0.0
            if corner:
                corners.append(len(found) - 1)
            continue
        if angles[k] > np.pi - _BACK:
            raise ValueError(f"no blend rounds the corner at point {one.point + 1}, where it goes straight back")
        after = elements[k + 1]
        radius = min(blend, 0.5 * one.uniform, 0.5 * after.uniform)
        end, begin_after = 1.0 - radius / one.uniform, radius / after.uniform
        if (end - begin) * one.uniform > _NEAR:
            found.append(one.cut(begin, end))
        else:
            end = begin  # two corners share all of the part
        found.append(_blend(one.end(end), after.end(begin_after), 2.0 * radius, one.point))
        begin = begin_after
    return found, corners


def _blend(a: Array, b: Array, speed: float, point: int) -> Element:
    scale = np.array([1.0, speed, speed**2])[:, None]
    c = hermite(a * scale, b * scale, np.array([1.0]))[0]

    def state(u: Array) -> Array:
        found = []
        own = c
        for _ in range(3):
            found.append(u[:, None] ** np.arange(len(own)) @ own)
            own = own[1:] * np.arange(1, len(own))[:, None]
        return np.stack(found)

    return Element(state, _BLEND_PARTS, 0.0, point, corner=True)


def spline(points: Array, parts: int = _SPAN_PARTS) -> list[Element]:
    """Return a cubic spline through points (k, 3), m, over the length of their chords: an element for each span.

    Each has at least so many `parts`.

    Raises:
        ValueError: it has a cusp.
    """
    with loading():
        from scipy.interpolate import CubicSpline

    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    knots = np.concatenate([[0.0], np.cumsum(chords)])
    curve = CubicSpline(knots, points, bc_type="natural" if len(points) > 2 else "not-a-knot")

    def element(k: int) -> Element:
        def state(u: Array) -> Array:
            x = knots[k] + u * chords[k]
            return np.stack([curve(x, order) * chords[k] ** order for order in range(3)])

        _, d, dd = state(np.linspace(0.0, 1.0, 9))
        speed = np.linalg.norm(d, axis=1)
        if speed.min() < 1e-3 * chords[k]:
            raise ValueError("a cusp")
        turn = float((np.linalg.norm(np.cross(d, dd), axis=1) / speed**2).max())
        return Element(state, max(parts, int(np.ceil(turn / _TURN))), 0.0, k + 1)

    return [element(k) for k in range(len(chords))]


def _angle(a: Array, b: Array) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


@dataclass(frozen=True, eq=False)
class Knots:
    """States of a curve over its length at the ends of its pieces.

    Attributes:
        s: (K + 1,) lengths, m.
        begin, end: (K, 3, 3) point, tangent and curvature at the ends of each piece.
        given: (k,) lengths of the given points, m.
        corners: lengths of corners, m.
    """

    s: Array
    begin: Array
    end: Array
    given: Array
    corners: tuple[float, ...]


_GAUSS = np.polynomial.legendre.leggauss(8)


def knots_of(elements: Sequence[Element], corners: Sequence[int], count: int) -> Knots:
    """Return elements as knots over their length; of `count` given points the middles of rounded corners."""
    s, begins, ends = [0.0], [], []
    reached = {0: 0.0}
    stops = []
    x, w = 0.5 * (_GAUSS[0] + 1.0), 0.5 * _GAUSS[1]
    for k, one in enumerate(elements):
        u = np.linspace(0.0, 1.0, one.parts + 1)
        inner = (u[:-1, None] + x / one.parts).ravel()
        speed = np.linalg.norm(one.state(inner)[1], axis=1).reshape(one.parts, -1)
        lengths = speed @ w / one.parts
        since = s[-1]
        s += (since + np.cumsum(lengths)).tolist()
        p, d, dd = one.state(u)
        states = np.stack([p, *_by_length(d, dd)], axis=1)
        begins.append(states[:-1])
        ends.append(states[1:])
        reached[one.point] = 0.5 * (since + s[-1]) if one.corner else s[-1]
        if k in corners:
            stops.append(s[-1])
    given = np.array([reached[k] for k in range(count)])
    return Knots(np.array(s), np.concatenate(begins), np.concatenate(ends), given, tuple(stops))
