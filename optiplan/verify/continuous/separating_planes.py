"""Distances of pairs of bodies, each confirmed by a separating plane, independent of the query's accuracy."""

from dataclasses import dataclass
from functools import cached_property

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Flags, Index
from optiplan.collision.model import CollisionModel
from optiplan.collision.pair_queries import PairQueries
from optiplan.geometry.coal_tolerance import DISTANCE_ERROR
from optiplan.geometry.mesh_hulls import exact_queries
from optiplan.verify.continuous.bodies import Bodies, PlacedBody

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
    """

    measured: Array
    normals: Array
    bound: Array
    gjk_only: Flags
    hulls: Flags


class PairDistances:
    """Distance queries on the verifier's own copy of the work space; one object a thread.

    For a unit vector n from a to b, with support function h_X(n) = max over x in X of n . x,
        distance(a, b) >= -h_b(-n) - h_a(n),
    whatever n is; with the right normal both sides are equal for convex bodies. Between cylinders coal's normal is at
    times a tenth of a millimetre off: then the query is repeated with another convergence criterion. The support
    functions of boxes, balls, cylinders and capsules are closed formulas, those of polyhedra and meshes maxima over
    vertices. So a plane between the hulls of two meshes is one between the meshes, and found in a tenth of
    the time.
    """

    def __init__(self, model: CollisionModel, bodies: Bodies) -> None:
        self._outline, self._bodies = model.outline, bodies
        self._robot, self._geometry = model.model, model.geometry
        self._data = self._robot.createData()
        self._convex: Flags = np.logical_and(*bodies.kind(coal.ShapeBase).T)
        self._planes: Flags = bodies.kind(coal.Halfspace)

    @cached_property
    def _placed(self) -> PairQueries:
        # At coal's own 1e-6 the normal of a cylinder can cost the plane 0.2 mm; polyhedra end exactly anyway.
        return self._queries(coal.GJKConvergenceCriterion.Default, 1e-10)

    @cached_property
    def _again(self) -> PairQueries:
        return self._queries(coal.GJKConvergenceCriterion.DualityGap, 1e-6)

    @cached_property
    def _outlined(self) -> PairQueries:
        return PairQueries(self._robot, self._outline.geometry, exact_queries)

    def query(self, Q: Array, rows: Index, pairs: Index, placed: PlacedBody, enough: float = np.inf) -> Distances:
        """Distance k of pair pairs[k] at Q[rows[k]], where `placed` has its bodies; rows ascend, Q (N, n).

        Meshes are queried only where a plane between their hulls proves no more than `enough`, m.
        """
        normals, bound = self._between_hulls(Q, rows, pairs, placed) if np.isfinite(enough) else (None, None)
        if normals is None or bound is None:
            return self._exact(Q, rows, pairs, placed)
        hulls: Flags = bound > enough
        measured, gjk_only = bound.copy(), np.zeros(len(rows), dtype=bool)
        asked = np.flatnonzero(~hulls)
        if len(asked):
            found = self._exact(Q, rows[asked], pairs[asked], placed.take(asked))
            measured[asked], normals[asked], bound[asked] = found.measured, found.normals, found.bound
            gjk_only[asked] = found.gjk_only
        return Distances(measured, normals, bound, gjk_only, hulls)

    def _between_hulls(self, Q: Array, rows: Index, pairs: Index, placed: PlacedBody) -> tuple[Array, Array]:
        """Normals (K, 3) of planes between the hulls of pairs with a mesh, and gaps (K,), m; -inf for other pairs."""
        normals, gap = np.full((len(rows), 3), np.nan), np.full(len(rows), -np.inf)
        asked = np.flatnonzero(~self._convex[pairs] & ~self._planes[pairs].any(axis=1))
        if len(asked):
            normals[asked] = self._measure(self._outlined, Q, rows[asked], pairs[asked], hulls=True)[1]
            gap[asked] = self._gap(placed.take(asked), normals[asked])
        return normals, gap

    def _exact(self, Q: Array, rows: Index, pairs: Index, placed: PlacedBody) -> Distances:
        """Query the bodies themselves."""
        measured, normals = self._measure(self._placed, Q, rows, pairs)
        for side, sign in ((0, 1.0), (1, -1.0)):
            for k in np.flatnonzero(self._planes[pairs, side]):  # the half-space itself is the plane
                own = np.array(self._bodies.shapes[placed.bodies[k, side]].n)
                normals[k] = sign * placed.poses[k, side, :3, :3] @ own
        plane, flat = self._gap(placed, normals), self._planes[pairs].any(axis=1)
        loose = np.flatnonzero(self._convex[pairs] & ~flat & (plane < measured - _LOOSE))
        if len(loose):
            other = self._measure(self._again, Q, rows[loose], pairs[loose])[1]
            gap = self._gap(placed.take(loose), other)
            better = gap > plane[loose]
            normals[loose[better]], plane[loose[better]] = other[better], gap[better]
        measured = np.where(flat, plane, measured)
        coal_says = measured - np.maximum(_MARGIN, _MARGIN * measured)
        gjk_only = ~self._convex[pairs] & (coal_says > plane)
        return Distances(measured, normals, np.where(gjk_only, coal_says, plane), gjk_only, np.zeros_like(gjk_only))

    def witness(self, q: Array, pair: int) -> tuple[float, Array]:
        """Distance, m, and nearest points (2, 3) on a and b of a pair, in the world, m, at q (n,)."""
        pin.forwardKinematics(self._robot, self._data, q)
        self._placed.place(self._data)
        result = self._placed.distance(pair)
        return float(result.min_distance), np.array([result.getNearestPoint1(), result.getNearestPoint2()])

    def _queries(self, criterion: coal.GJKConvergenceCriterion, tolerance: float) -> PairQueries:
        """Queries that start afresh each time and end by this criterion."""

        def prepare(data: pin.GeometryData) -> None:
            for request in data.distanceRequests:
                request.gjk_initial_guess = coal.GJKInitialGuess.DefaultGuess
                request.gjk_convergence_criterion = criterion
                request.gjk_tolerance, request.gjk_max_iterations = tolerance, 500

        return PairQueries(self._robot, self._geometry, prepare)

    def _gap(self, placed: PlacedBody, normals: Array) -> Array:
        """-h_b(-n) - h_a(n), m: a lower bound of the distance for each unit normal (K, 3); -inf where it is NaN."""
        gap = -self._bodies.support(placed, np.stack([normals, -normals])).sum(axis=0)
        return np.asarray(np.nan_to_num(gap, nan=-np.inf))

    def _measure(
        self, queries: PairQueries, Q: Array, rows: Index, pairs: Index, hulls: bool = False
    ) -> tuple[Array, Array]:
        """Measure with coal: distances (K,) and unit normals from a to b (K, 3), NaN where it gives none."""
        measured, normals = np.empty(len(rows)), np.empty((len(rows), 3))
        geometry, placed, places = queries.ready(pairs)
        results, last = placed.distanceResults, -1
        for k, (row, pair, place) in enumerate(zip(rows.tolist(), pairs.tolist(), places.tolist(), strict=True)):
            if row != last:
                pin.updateGeometryPlacements(self._robot, self._data, geometry, placed, Q[row])
                last = row
            pin.computeDistance(geometry, placed, place)
            result = results[place]
            measured[k] = result.min_distance
            if hulls or self._convex[pair]:
                normals[k] = result.normal
            else:  # coal leaves the normal of two meshes unset
                normals[k] = result.getNearestPoint2() - result.getNearestPoint1()
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        with np.errstate(invalid="ignore", divide="ignore"):
            return measured, normals / length
