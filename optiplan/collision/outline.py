"""Hulls in the place of meshes: a bound of the distances of a scene that costs a twentieth of asking the meshes."""

from functools import cached_property

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Index
from optiplan.collision.pair_queries import PairQueries
from optiplan.geometry.coal_tolerance import DISTANCE_ERROR
from optiplan.geometry.mesh_hulls import hull_of_mesh

_MARGIN = 2 * DISTANCE_ERROR
"""m; subtracted from a distance of hulls, so that it is a lower bound."""


class Outline:
    """The bodies with hulls in the place of meshes: their distances are lower bounds of the true ones.

    Attributes:
        geometry: the bodies, in the order of those they stand for.
        pairs: indices of the pairs with a mesh that is not bounded by a half-space.
    """

    def __init__(self, model: pin.Model, geometry: pin.GeometryModel, pairs: Index) -> None:
        """Take the bodies and pairs (P, 2) of `geometry`; those very ones where no pair has a mesh."""
        self._model = model
        meshes, planes = (
            np.array([isinstance(body.geometry, kind) for body in geometry.geometryObjects], dtype=bool)
            for kind in (coal.BVHModelBase, coal.Halfspace)
        )
        asked = np.flatnonzero(meshes[pairs].any(axis=1) & ~planes[pairs].any(axis=1))
        self.pairs = frozenset(asked.tolist())
        self.geometry = geometry.copy() if len(asked) else geometry
        bodies = np.unique(pairs[asked])
        for body in bodies[meshes[bodies]].tolist():
            item = self.geometry.geometryObjects[body]
            item.geometry = hull_of_mesh(item.geometry)

    def with_own_queries(self) -> "Outline":
        """Return the same hulls with a work space of their own."""
        twin = Outline.__new__(Outline)
        twin._model, twin.geometry, twin.pairs = self._model, self.geometry, self.pairs
        return twin

    @cached_property
    def _queries(self) -> PairQueries:
        return PairQueries(self._model, self.geometry)

    def place(self, data: pin.Data) -> None:
        """Move the bodies to where the joints are in `data`."""
        if self.pairs:
            self._queries.place(data)

    def collides(self, data: pin.Data, q: Array) -> bool:
        """Whether any pair of hulls, or of bodies that are no meshes, touches at q (n,); moves the joints in `data`."""
        return self._queries.any_touch(data, q)

    def distance(self, pair: int) -> float:
        """Lower bound, m, of the distance of a pair where `place` put the bodies; negative where hulls meet."""
        return float(self.query(pair).min_distance) - _MARGIN

    def query(self, pair: int) -> coal.DistanceResult:
        """Nearest points of a pair of hulls where `place` put the bodies."""
        return self._queries.distance(pair)
