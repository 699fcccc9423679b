"""Points of a path that covers a patch of a mesh: a raster of lines, or a spiral from its middle.

The patch is what a viewer sees who looks along a direction. Lines and spirals are drawn in the plane across it, and
every point is put onto the surface that is nearest to the viewer, with the inward normal there.
"""

from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from optiplan.arrays import Array, Flags, Index
from optiplan.cache import MostRecent
from optiplan.config.document import Strict
from optiplan.config.values import Direction, FileName, Length, NotNegative, Scale
from optiplan.geometry.meshes.reading import open_mesh, read_mesh
from optiplan.geometry.pose import PoseSpec
from optiplan.geometry.poses import pose_from_data
from optiplan.records import dataclass

_STEP = 0.5
"""Share of the spacing between points of a line."""

_FINE = 0.125
"""Share of the spacing between places at which a line is looked for the edge of the patch."""

_TURN = 5
"""Points of a turn from one line to the next."""

_MOST_LINES, _MOST_POINTS = 500, 20_000
_BLOCK = 2_000_000
"""Pairs of points and triangles compared at once."""

_covered: MostRecent[tuple[Array, Array]] = MostRecent(4)
"""Paths over patches, by mesh and statement: to read a problem asks twice."""


class CoverSpec(Strict):
    """A patch of a `mesh` file, times `scale`, at `pose`, as seen along `toward`; covered in lines or in a spiral.

    `spacing` of the lines, m, which lead `along` a direction; without one the way the patch is longest. The path keeps
    `margin`, m, from the edge. The tool's z axis points into the surface.
    """

    mesh: FileName
    scale: Scale = (1.0, 1.0, 1.0)
    pose: PoseSpec = PoseSpec.model_construct()
    pattern: Literal["raster", "spiral"] = "raster"
    spacing: Length
    along: Direction | None = None
    toward: Direction = (0.0, 0.0, -1.0)
    margin: Annotated[NotNegative, Field(le=10.0)] = 0.0


@dataclass(frozen=True, eq=False)
class Patch:
    """A surface seen along a direction.

    Attributes:
        E: (3, 3) rows: along the lines, across them, and toward the surface.
        corners: (T, 3, 3) corners of triangles in those axes.
        normals: (T, 3, 3) unit normals there, away from the surface, in the world.
    """

    E: Array
    corners: Array
    normals: Array

    @classmethod
    def of(cls, spec: CoverSpec, base: Path) -> "Patch":
        """Read the file; its triangles that face the viewer.

        Raises:
            ValueError: it cannot be read, or nothing of it faces the viewer.
        """
        soup = read_mesh(open_mesh(base / spec.mesh))
        X = pose_from_data(dict(spec.pose))
        vertices = (soup.vertices @ soup.turn.T * np.array(spec.scale)) @ X.rotation.T + X.translation
        points = vertices[soup.triangles]
        facets = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
        toward = np.array(spec.toward, float)
        toward /= np.linalg.norm(toward)
        seen = facets @ toward < -1e-9 * np.linalg.norm(facets, axis=1)
        if not seen.any():
            raise ValueError(f"none of {len(facets)} triangles faces the viewer")
        points, facets = points[seen], facets[seen]
        E = _axes(toward, spec.along, points.reshape(-1, 3))
        return cls(E, points @ E.T, _smooth_normals(points, facets))

    def onto(self, places: Array) -> tuple[Array, Array, Flags]:
        """Return points (N, 3) of the surface at places (N, 2) of the plane, inward directions, and which hit it."""
        best = np.full(len(places), np.inf)
        which, weights = np.zeros(len(places), dtype=np.intp), np.zeros((len(places), 3))
        a, b, c = (self.corners[:, k, :2] for k in range(3))
        double = _cross(b - a, c - a)
        rows = max(1, _BLOCK // len(a))
        for k in range(0, len(places), rows):
            p = places[k : k + rows, None]
            w = np.stack([_cross(b - p, c - p), _cross(c - p, a - p), _cross(a - p, b - p)], axis=2)
            w = w / double[:, None]
            depth = (w * self.corners[:, :, 2]).sum(axis=2)
            depth[(w < -1e-9).any(axis=2)] = np.inf
            nearest = depth.argmin(axis=1)
            own = np.arange(len(nearest))
            best[k : k + rows], which[k : k + rows] = depth[own, nearest], nearest
            weights[k : k + rows] = w[own, nearest]
        hit = np.isfinite(best)
        points = np.column_stack([places, np.where(hit, best, 0.0)]) @ self.E
        inward = -(weights[:, :, None] * self.normals[which]).sum(axis=1)
        inward /= np.maximum(np.linalg.norm(inward, axis=1, keepdims=True), 1e-12)
        return points, inward, hit

    def inside(self, places: Array, margin: float) -> Flags:
        """Return which places (N, 2) are on the patch, and so far from its edge, m, in eight directions."""
        found = self.onto(places)[2]
        for angle in np.arange(8) * (0.25 * np.pi) if margin else ():
            found &= self.onto(places + margin * np.array([np.cos(angle), np.sin(angle)]))[2]
        return found

    def extent(self, axis: int) -> tuple[float, float]:
        """Return from where to where the patch is along an axis of the plane, m."""
        values = self.corners[:, :, axis]
        return float(values.min()), float(values.max())


def cover(spec: CoverSpec, base: Path) -> tuple[Array, Array]:
    """Return points (N, 3), m, and inward directions (N, 3) of a path that covers a patch.

    Raises:
        ValueError: the mesh cannot be read, or the patch cannot be covered like that.
    """
    key = f"{open_mesh(base / spec.mesh).key} {spec.model_dump_json()}"
    return _covered.get(key, lambda: _cover(spec, Patch.of(spec, base)))


def _cover(spec: CoverSpec, patch: Patch) -> tuple[Array, Array]:
    if min(patch.extent(k)[1] - patch.extent(k)[0] for k in (0, 1)) < 2.0 * spec.margin:
        raise ValueError(f"nothing is left within a margin of {spec.margin:g} m")
    places = _raster(patch, spec) if spec.pattern == "raster" else _spiral(patch, spec)
    points, inward, hit = patch.onto(places)
    held: Index = np.maximum.accumulate(np.where(hit, np.arange(len(hit)), 0))
    beside = ~hit  # a turn that leaves the patch: in the plane that touches it where it was left
    if beside.any():
        own = held[beside]
        flat = np.column_stack([places[beside], np.zeros(int(beside.sum()))]) @ patch.E
        toward, n = patch.E[2], inward[own]
        depth = ((points[own] - flat) * n).sum(axis=1) / (n @ toward)
        points[beside], inward[beside] = flat + depth[:, None] * toward, n
    return points, inward


def _raster(patch: Patch, spec: CoverSpec) -> Array:
    """Return places (N, 2) of lines to and fro, each joined to the next by a turn."""
    (low, high), (near, far) = patch.extent(0), patch.extent(1)
    inset = spec.margin + 0.25 * spec.spacing  # the edges of a mesh are not straight
    count = int(np.ceil((far - near - 2.0 * inset) / spec.spacing)) + 1
    if not 1 <= count <= _MOST_LINES:
        raise ValueError(f"{max(count, 0)} lines of {spec.spacing:g} m spacing; between 1 and {_MOST_LINES} can be")
    lines = np.linspace(near + inset, far - inset, count) if count > 1 else np.array([0.5 * (near + far)])
    fine = np.linspace(low, high, min(20_000, int(np.ceil((high - low) / (_FINE * spec.spacing))) + 2))
    found: list[Array] = []
    for v in lines:
        inner = fine[patch.inside(np.column_stack([fine, np.full(len(fine), v)]), spec.margin)]
        pieces = np.split(inner, np.flatnonzero(np.diff(inner) > spec.spacing) + 1)
        long = [piece for piece in pieces if len(piece) and piece[-1] - piece[0] > 1.01 * spec.spacing]
        if len(long) > 1:
            raise ValueError(f"a line that leaves the patch and enters it again, in {len(long)} pieces")
        if not long:
            continue
        a, b = long[0][0] + 0.5 * spec.spacing, long[0][-1] - 0.5 * spec.spacing
        u = np.linspace(a, b, max(2, int(np.ceil((b - a) / (_STEP * spec.spacing)))) + 1)
        u = u[::-1] if len(found) % 2 else u
        found.append(np.column_stack([u, np.full(len(u), v)]))
    if not found:
        raise ValueError(f"no line of {spec.spacing:g} m spacing fits on the patch")
    joined = [found[0]]
    for before, after in pairwise(found):
        way = np.sign(before[-1, 0] - before[0, 0])
        reach = 1.5 * max(float(np.linalg.norm(after[0] - before[-1])), spec.spacing)
        joined += [_turn(before[-1], after[0], np.array([way * reach, 0.0])), after]
    return _few(np.concatenate(joined))


def _turn(a: Array, b: Array, out: Array) -> Array:
    """Return places between two lines, on a cubic that leaves a along `out` and comes to b against it."""
    t = np.linspace(0.0, 1.0, _TURN + 2)[1:-1, None]
    keep, reach = 2.0 * t**3 - 3.0 * t**2 + 1.0, t**3 - 2.0 * t**2 + t - (t**3 - t**2)
    return np.asarray(keep * a + (1.0 - keep) * b + reach * out)


def _spiral(patch: Patch, spec: CoverSpec) -> Array:
    """Return places (N, 2) of a spiral from the middle outwards, as far as it stays on the patch."""
    centre = np.array([0.5 * sum(patch.extent(k)) for k in (0, 1)])
    widest = 0.5 * max(patch.extent(k)[1] - patch.extent(k)[0] for k in (0, 1))
    rate = spec.spacing / (2.0 * np.pi)
    turns = min(widest / spec.spacing + 1.0, float(_MOST_LINES))
    radius = [0.5 * spec.spacing]
    angle = [radius[0] / rate]
    while angle[-1] < 2.0 * np.pi * turns and len(angle) <= _MOST_POINTS:
        angle.append(angle[-1] + min(0.5, _STEP * spec.spacing / (rate * angle[-1])))
    theta = np.array(angle)
    round_ = np.stack([np.cos(theta), np.sin(theta)], axis=1)
    places = centre + rate * theta[:, None] * round_
    hit = patch.inside(places, spec.margin)
    last = len(hit) if hit.all() else int(hit.argmin())
    if last < 8:
        raise ValueError("the middle of the patch is not on it, or no turn of the spiral fits")
    return _few(places[:last])


def _few(places: Array) -> Array:
    if len(places) > _MOST_POINTS:
        raise ValueError(f"{len(places)} points; at most {_MOST_POINTS} can be (a larger spacing)")
    return places


def _axes(toward: Array, along: tuple[float, ...] | None, points: Array) -> Array:
    if along is None:
        flat = points - points.mean(axis=0)
        flat = flat - (flat @ toward)[:, None] * toward
        u = np.linalg.svd(flat, full_matrices=False)[2][0]
        u = u * (1.0 if u[np.abs(u).argmax()] > 0.0 else -1.0)
    else:
        u = np.array(along, float)
    u = u - (u @ toward) * toward
    if np.linalg.norm(u) < 1e-6:
        raise ValueError("lines along the direction of view")
    u /= np.linalg.norm(u)
    return np.stack([u, np.cross(toward, u), toward])


def _smooth_normals(points: Array, facets: Array) -> Array:
    """Return unit normals (T, 3, 3) at corners: the mean of the facets (T, 3) about each, by area."""
    keys, place = np.unique(np.round(points.reshape(-1, 3), 7), axis=0, return_inverse=True)
    total = np.zeros((len(keys), 3))
    np.add.at(total, place.ravel(), np.repeat(facets, 3, axis=0))
    total /= np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)
    return np.asarray(total[place.ravel()].reshape(-1, 3, 3))


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
