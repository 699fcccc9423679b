"""Make a `SeamCurve` of given points: the curve through them, woven, and the tool's axes along it."""

import numpy as np

from optiplan.arrays import Array
from optiplan.libraries import loading
from optiplan.problem.seams.curve import SeamCurve
from optiplan.problem.seams.elements import Element, Knots, knots_of, round_part, rounded, spline, straight
from optiplan.records import dataclass
from optiplan.trajectory.paths.hermite import hermite

OPPOSITE = -0.85
"""Cosine of the angle between the axes of two points in a row, below which the way between them is not clear."""

MOST_SWINGS = 5000
"""Swings of a woven path."""

_SWINGS = 24
"""Points of a swing to and fro."""


@dataclass(frozen=True, eq=False)
class SeamShape:
    """What a path is made of.

    Attributes:
        points: (k, 3) m.
        through: points (3,) of arcs, by the number of the point where the arc ends.
        smooth: whether one spline leads through all points; else parts from point to point.
        blend: m, of corners; 0: exact.
        axes: (k, 3) unit directions of the tool's z axis at the points.
        headings: (k, 3) of its x axis; None: it may turn.
        lead, side: rad, tilt of the axes ahead and to the left.
        weave: amplitude and length of a swing, m; None: none.
    """

    points: Array
    through: dict[int, Array]
    smooth: bool
    blend: float
    axes: Array
    headings: Array | None
    lead: float = 0.0
    side: float = 0.0
    weave: tuple[float, float] | None = None

    def elements(self) -> tuple[list[Element], list[int]]:
        """Return the elements of the path, and after which of them there is a corner.

        Raises:
            ValueError: an arc that does not exist, a cusp of a spline, or a path straight back with a blend.
        """
        if self.smooth:
            return spline(self.points), []
        parts = []
        for k in range(1, len(self.points)):
            a, b = self.points[k - 1], self.points[k]
            parts.append(round_part(a, self.through[k], b, k) if k in self.through else straight(a, b, k))
        return rounded(parts, self.blend)

    def curve(self) -> SeamCurve:
        """Return the curve.

        Raises:
            ValueError: as of `elements`, or too many swings.
        """
        knots = knots_of(*self.elements(), len(self.points))
        if self.weave is not None:
            return self._woven(knots)
        return self._with_axes(knots, knots.s)

    def _woven(self, knots: Knots) -> SeamCurve:
        """Return the curve that swings about the one of these knots, sideways to the tool's axis."""
        assert self.weave is not None
        plain = self._with_axes(knots, knots.s)
        amplitude, length = self.weave
        count = max(1, round(plain.length / length))
        if count > MOST_SWINGS:
            raise ValueError(f"{count} swings of {length:g} m on {plain.length:.4g} m; at most {MOST_SWINGS} can be")
        s = np.linspace(0.0, plain.length, count * _SWINGS + 1)
        z, t = plain.directions(s), plain.points(s, 1)
        side = np.cross(t, z)
        side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-9)
        swung = plain.points(s) + amplitude * np.sin(2.0 * np.pi * count * s / plain.length)[:, None] * side
        found = knots_of(spline(swung, parts=1), [], len(swung))
        return self._with_axes(found, np.interp(found.s, found.given, s), knots.given)

    def _with_axes(self, knots: Knots, at: Array, given: Array | None = None) -> SeamCurve:
        """Return the curve of knots with the axes that the points have; `at` (K + 1,) are the lengths these are at."""
        h = np.diff(knots.s)
        position = hermite(knots.begin, knots.end, h) / h[:, None, None] ** np.arange(6)[:, None]
        given = knots.given if given is None else given
        z = _interpolated(given, self.axes, at, self.smooth)
        z /= np.linalg.norm(z, axis=1, keepdims=True)
        x = None if self.headings is None else _interpolated(given, self.headings, at, self.smooth)
        if self.lead or self.side:
            z = self._tilted(z, np.concatenate([knots.begin[:, 1], knots.end[-1:, 1]]))
        return SeamCurve(
            knots.s, position, _cubics(knots.s, z), None if x is None else _cubics(knots.s, x), knots.corners
        )

    def _tilted(self, z: Array, t: Array) -> Array:
        """Return axes (N, 3) tilted ahead along tangents t (N, 3), and to the left, t x z."""
        along = t - (t * z).sum(axis=1, keepdims=True) * z
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
        tilted = z + np.tan(self.lead) * along + np.tan(self.side) * np.cross(along, z)
        return np.asarray(tilted / np.linalg.norm(tilted, axis=1, keepdims=True))


def _interpolated(given: Array, values: Array, at: Array, smooth: bool) -> Array:
    """Return directions (N, 3) at lengths, of those (k, 3) at the given points."""
    with loading():
        from scipy.interpolate import CubicSpline, PchipInterpolator

    if (values == values[0]).all():
        return np.tile(values[0], (len(at), 1))
    if smooth and len(given) > 2:
        return np.asarray(CubicSpline(given, values, bc_type="natural")(at))
    return np.asarray(PchipInterpolator(given, values)(at))


def _cubics(s: Array, values: Array) -> Array:
    """Return cubic pieces (K, 4, 3), twice continuously differentiable, through values (K + 1, 3) at lengths s."""
    with loading():
        from scipy.interpolate import CubicSpline

    if (values == values[0]).all():
        found = np.zeros((len(s) - 1, 4, 3))
        found[:, 0] = values[0]
        return found
    c = CubicSpline(s, values, bc_type="natural").c if len(s) > 2 else None
    if c is None:
        found = np.zeros((1, 4, 3))
        found[0, 0], found[0, 1] = values[0], (values[1] - values[0]) / (s[1] - s[0])
        return found
    return np.asarray(np.swapaxes(c[::-1], 0, 1))
