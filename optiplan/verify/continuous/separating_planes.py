"""Distances of pairs of bodies, each confirmed by a separating plane, independent of the query's accuracy."""

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import fields
from functools import cached_property
from typing import NamedTuple

import coal
import numpy as np

from optiplan.arrays import Array, Flags, Index, distinct
from optiplan.collision.model import CollisionModel
from optiplan.geometry.coal_queries import DISTANCE_ERROR
from optiplan.records import dataclass
from optiplan.verify.continuous.bodies import Bodies, BodyShape, PlacedBody, parts_of_link, support

_LOOSE = 1e-7  # m that a plane may lose against the measured distance before another one is sought
_MARGIN = DISTANCE_ERROR  # m, and fraction of the distance: subtracted from a distance that no plane confirms


@dataclass(frozen=True, eq=False)
class Distances:
    """Results of K queries.

    Attributes:
        measured: (K,) m, what coal measured; negative is depth of penetration.
        normals: (K, 3) unit vectors from a to b; NaN where coal gives none.
        bound: (K,) m, a lower bound of the distance: from the plane, or where bodies are not convex from coal.
        gjk_only: (K,) whether `bound` rests on coal alone.
        hulls: (K,) whether a plane between the hulls answered; then `measured` is no distance but `bound` again.
        parts: (K,) whether those were the hulls of a mesh's parts, which are near the mesh itself.
    """

    measured: Array
    normals: Array
    bound: Array
    gjk_only: Flags
    hulls: Flags
    parts: Flags

    @cached_property
    def best(self) -> Array:
        """The larger of what was measured and its bound, (K,), m."""
        return np.maximum(self.bound, self.measured)

    @classmethod
    def join(cls, parts: "Sequence[Distances]") -> "Distances":
        """Concatenate."""
        return cls(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(cls)))

    def take(self, chosen: Index) -> "Distances":
        """Those at these positions."""
        return Distances(*(getattr(self, f.name)[chosen] for f in fields(self)))


class Witness(NamedTuple):
    """Distance, m, of a pair of the model and its nearest points (2, 3) on a and b, m, world."""

    distance: float
    points: Array
    pair: int


class PairDistances:
    """Distance queries on the verifier's own copy of the work space; one object a thread.

    For a unit vector n from a to b, with support function h_X(n) = max over x in X of n . x,
        distance(a, b) >= -h_b(-n) - h_a(n),
    whatever n is; with the right normal both sides are equal for convex bodies. Between cylinders coal's normal is at
    times a tenth of a millimetre off: then the query is repeated with another convergence criterion. The support
    functions of boxes, balls, cylinders and capsules are closed formulas, those of polyhedra and meshes maxima over
    vertices. So a plane between the hulls of two meshes is one between the meshes, and found in a tenth of
    the time.

    Attributes:
        convex: (P,) whether both bodies of a pair are.
        link_meshes: (P, 2) which sides of pairs are links that are meshes.
    """

    def __init__(self, model: CollisionModel, bodies: Bodies) -> None:
        self._shapes = bodies.shapes
        outline = [body.geometry for body in model.outline.geometry.geometryObjects]
        self._hulls = [*outline, *(hull.shape for hull in bodies.tree.hulls)]
        # At coal's own 1e-6 the normal of a cylinder can cost the plane 0.2 mm; polyhedra end exactly anyway.
        self._request = _request(coal.GJKConvergenceCriterion.Default, 1e-10)
        self._again = _request(coal.GJKConvergenceCriterion.DualityGap, 1e-6)
        self._outline = _request(coal.GJKConvergenceCriterion.Default, 1e-9)
        self.convex: Flags = np.logical_and(*bodies.kind(coal.ShapeBase).T)
        self._planes: Flags = bodies.kind(coal.Halfspace)
        self._flat: Flags = np.asarray(self._planes.any(axis=1))
        self._mesh: Flags = np.array([not isinstance(shape, coal.ShapeBase) for shape in self._shapes], dtype=bool)
        self._no_hulls = bool(self.convex.all()) and not bodies.tree.hulls
        self._any_plane = bool(self._flat.any())
        links: Flags = self._mesh & (np.arange(len(self._mesh)) < len(model.robot.link_boxes))
        self.link_meshes: Flags = links[bodies.pairs] & ~self._flat[:, None]  # (P, 2)
        self._put(model, bodies)

    def _put(self, model: CollisionModel, bodies: Bodies) -> None:
        self._robot, self._bodies = model.robot, bodies
        still = np.flatnonzero(bodies.joints == 0)
        self._stands = np.append(bodies.joints == 0, False)  # the last is of all parts of links
        self._fixed = {
            k: coal.Transform3s(X[:3, :3], X[:3, 3])
            for k, X in zip(still.tolist(), bodies.placements[still], strict=True)
        }

    def with_obstacles_of(self, model: CollisionModel, bodies: Bodies) -> "PairDistances":
        """Return the same of a model in which obstacles stand elsewhere, and its bodies."""
        twin = copy(self)
        twin._put(model, bodies)
        return twin

    def query(self, pairs: Index, placed: PlacedBody, enough: float | Array = np.inf) -> Distances:
        """Distance k of pair pairs[k] (K,) where `placed` has its bodies.

        Meshes are queried only where planes between their hulls prove no more than `enough`, m, one or (K,), and where
        they are links, planes to the hulls of their parts neither; of pairs of hulls that stand for others (`PairTree`)
        nothing else is known.
        """
        if self._no_hulls or not np.isfinite(enough).all():
            return self._exact(pairs, placed)
        normals, bound = self._between_hulls(pairs, placed)
        parts = self._raise_by_parts(pairs, placed, enough, bound)
        hulls: Flags = (bound > enough) | (pairs >= self._bodies.tree.count)
        measured, gjk_only = bound.copy(), np.zeros(len(pairs), dtype=bool)
        asked = np.flatnonzero(~hulls)
        if len(asked):
            found = self._exact(pairs[asked], placed.take(asked))
            measured[asked], normals[asked], bound[asked] = found.measured, found.normals, found.bound
            gjk_only[asked] = found.gjk_only
        return Distances(measured, normals, bound, gjk_only, hulls, parts & hulls)

    def _between_hulls(self, pairs: Index, placed: PlacedBody) -> tuple[Array, Array]:
        """Normals (K, 3) of planes between hulls, and gaps (K,), m; -inf for pairs without a mesh or a cluster."""
        normals, gap = np.full((len(pairs), 3), np.nan), np.full(len(pairs), -np.inf)
        outer = ~self.convex[pairs] | (pairs >= self._bodies.tree.count)
        asked = np.flatnonzero(outer & ~self._flat[pairs])
        if len(asked):
            hulls = placed.take(asked)
            normals[asked] = self._measure(self._hulls, self._outline, hulls)[1]
            gap[asked] = self._gap(hulls, normals[asked])
        return normals, gap

    def _raise_by_parts(self, pairs: Index, placed: PlacedBody, enough: float | Array, bound: Array) -> Flags:
        """Raise bounds (K,), m, of distances of links that are meshes, and of which `bound` is no more than `enough`.

        Parts together hold the mesh, so the least of the gaps between planes that separate each from the other body is
        a bound for the whole. Returns which were raised, (K,).
        """
        raised = np.zeros(len(pairs), dtype=bool)
        for side in (0, 1):
            near = np.flatnonzero(self.link_meshes[pairs, side] & (bound <= enough))
            for body in distinct(placed.bodies[near, side]).tolist():
                items = near[placed.bodies[near, side] == body]
                mesh_first = [side, 1 - side]
                asked = PlacedBody(placed.bodies[items][:, mesh_first], placed.poses[items][:, mesh_first])
                bound[items] = np.maximum(bound[items], self._to_parts(body, asked))
                raised[items] = True
        return raised

    def _to_parts(self, body: int, placed: PlacedBody) -> Array:
        """Lower bounds (K,), m, of the distance of a mesh, side 0, from bodies, by its parts.

        Balls tell which part may be the nearest, and which may be as near as that one.
        """
        parts, other = parts_of_link(self._robot, body), placed.bodies[:, 1]
        R, p = placed.poses[..., :3, :3], placed.poses[..., :3, 3]
        centre = (R[:, 1] @ self._bodies.centre[other][..., None])[..., 0] + p[:, 1]
        apart = ((centre - p[:, 0])[:, None] @ R[:, 0]) - np.array([part.centre for part in parts])  # (K, parts, 3)
        radii = self._bodies.radius[other][:, None] + np.array([part.radius for part in parts])
        gap = np.sqrt(np.einsum("kpi,kpi->kp", apart, apart)) - radii
        first = np.zeros_like(gap, dtype=bool)
        first[np.arange(len(gap)), gap.argmin(axis=1)] = True
        self._to_chosen(parts, placed, first, gap)
        self._to_chosen(parts, placed, ~first & (gap < gap[first][:, None]), gap)
        return np.asarray(gap.min(axis=1))

    def _to_chosen(self, parts: Sequence[BodyShape], placed: PlacedBody, chosen: Flags, gap: Array) -> None:
        """Put gaps of planes, m, in the place of those `chosen` of `gap` (K, parts)."""
        rows, which = np.nonzero(chosen)
        if not len(rows):
            return
        asked = placed.take(rows)
        hulls = PlacedBody(np.column_stack([len(self._hulls) + which, asked.bodies[:, 1]]), asked.poses)
        n = self._measure([*self._hulls, *(part.shape for part in parts)], self._outline, hulls)[1]
        X = asked.poses[:, 0]
        local, height = (n[:, None] @ X[:, :3, :3])[:, 0], np.einsum("ki,ki->k", n, X[:, :3, 3])
        for k, part in enumerate(parts):
            own = which == k
            height[own] += support(None, part.vertices, local[own])
        found = -height - self._bodies.support(asked.bodies[:, 1], asked.poses[:, 1], -n)
        gap[chosen] = np.where(np.isnan(found), -np.inf, found)

    def _exact(self, pairs: Index, placed: PlacedBody) -> Distances:
        """Query the bodies themselves."""
        measured, normals = self._measure(self._shapes, self._request, placed)
        for side, sign in ((0, 1.0), (1, -1.0)) if self._any_plane else ():
            for k in np.flatnonzero(self._planes[pairs, side]):  # the half-space itself is the plane
                own = np.array(self._bodies.shapes[placed.bodies[k, side]].n)
                normals[k] = sign * placed.poses[k, side, :3, :3] @ own
        plane, flat, convex = self._gap(placed, normals), self._flat[pairs], self.convex[pairs]
        loose = np.flatnonzero(convex & ~flat & (plane < measured - _LOOSE))
        if len(loose):
            other = self._measure(self._shapes, self._again, placed.take(loose))[1]
            gap = self._gap(placed.take(loose), other)
            better = gap > plane[loose]
            normals[loose[better]], plane[loose[better]] = other[better], gap[better]
        measured = np.where(flat, plane, measured)
        coal_says = unconfirmed(measured)
        gjk_only = ~convex & (coal_says > plane)
        none = np.zeros_like(gjk_only)
        return Distances(measured, normals, np.where(gjk_only, coal_says, plane), gjk_only, none, none)

    def witness(self, poses: Array, pair: int) -> Witness:
        """Return the nearest of the pairs that one stands for, perhaps itself only, at joint poses (n + 1, 4, 4)."""
        pairs = self._bodies.tree.members(pair)
        placed = self._bodies.place(poses[None], np.zeros(len(pairs), dtype=np.intp), pairs)
        bounds = self._bodies.lower_bound(placed) if len(pairs) > 1 else np.zeros(1)
        best: Witness | None = None
        result = coal.DistanceResult()
        for k in np.argsort(bounds, kind="stable").tolist():
            if best is not None and bounds[k] >= best.distance:
                break
            a, b = placed.bodies[k].tolist()
            X_WA, X_WB = (coal.Transform3s(X[:3, :3], X[:3, 3]) for X in placed.poses[k])
            result.clear()
            distance = coal.distance(self._shapes[a], X_WA, self._shapes[b], X_WB, self._request, result)
            if best is None or distance < best.distance:
                points = np.array([result.getNearestPoint1(), result.getNearestPoint2()])
                best = Witness(float(distance), points, int(pairs[k]))
        assert best is not None
        return best

    def _gap(self, placed: PlacedBody, normals: Array) -> Array:
        """-h_b(-n) - h_a(n), m: a lower bound of the distance for each unit normal (K, 3); -inf where it is NaN."""
        bodies, poses = placed.bodies.T.ravel(), np.concatenate([placed.poses[:, 0], placed.poses[:, 1]])
        height = self._bodies.support(bodies, poses, np.concatenate([normals, -normals]))
        gap = -(height[: len(normals)] + height[len(normals) :])
        gap[np.isnan(gap)] = -np.inf
        return np.asarray(gap)

    def _measure(
        self, shapes: list[coal.CollisionGeometry], request: coal.DistanceRequest, placed: PlacedBody
    ) -> tuple[Array, Array]:
        """Measure with coal: distances (K,) and unit normals from a to b (K, 3), NaN where there is none."""
        measured, normals = np.empty(len(placed.bodies)), np.empty((len(placed.bodies), 3))
        # coal leaves the normal of two meshes unset: there it is the direction between the nearest points.
        meshes = [False] * len(placed.bodies)
        if shapes is self._shapes:
            meshes = np.asarray(self._mesh[placed.bodies].any(axis=1)).tolist()
        result, distance, known = coal.DistanceResult(), coal.distance, self._fixed.get
        X_WA, X_WB = coal.Transform3s(), coal.Transform3s()  # set anew each time, which takes a third of making others
        moving_a, moving_b = (self._moving_poses(placed, side) for side in (0, 1))
        for k, (a, b) in enumerate(placed.bodies.tolist()):
            result.clear()
            X_a, X_b = known(a), known(b)
            if X_a is None:
                X_a = X_WA
                X_a.setTransform(*next(moving_a))
            if X_b is None:
                X_b = X_WB
                X_b.setTransform(*next(moving_b))
            measured[k] = distance(shapes[a], X_a, shapes[b], X_b, request, result)
            normals[k] = result.getNearestPoint2() - result.getNearestPoint1() if meshes[k] else result.normal
        length = np.sqrt(np.einsum("ki,ki->k", normals, normals))[:, None]
        with np.errstate(invalid="ignore", divide="ignore"):
            return measured, normals / length

    def _moving_poses(self, placed: PlacedBody, side: int) -> Iterator[tuple[Array, Array]]:
        """Rotations and origins of those of K bodies of a side that do not stand still: of the rest it is known."""
        stands = self._stands.take(placed.bodies[:, side], mode="clip")
        poses = placed.poses[~stands, side]
        return zip(np.ascontiguousarray(poses[:, :3, :3]), np.ascontiguousarray(poses[:, :3, 3]), strict=True)


def unconfirmed(measured: Array) -> Array:
    """Return lower bounds of distances measured by coal, m, that no plane confirms."""
    return np.asarray(measured - np.maximum(_MARGIN, _MARGIN * measured))


def _request(criterion: coal.GJKConvergenceCriterion, tolerance: float) -> coal.DistanceRequest:
    """Return a request that starts every query afresh and ends it by this criterion."""
    request = coal.DistanceRequest()
    request.gjk_initial_guess = coal.GJKInitialGuess.DefaultGuess
    request.gjk_convergence_criterion = criterion
    request.gjk_tolerance, request.gjk_max_iterations = tolerance, 500
    return request
