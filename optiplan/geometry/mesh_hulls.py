"""Hulls of the meshes of a scene: a bound of their distances that costs a twentieth of asking the meshes."""

import warnings
from collections import OrderedDict
from functools import cached_property

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.cache import digest
from optiplan.geometry.coal_tolerance import DISTANCE_ERROR
from optiplan.geometry.convex_hulls import convex_hull, thickened_hull

_KEPT = 256
"""Hulls kept in memory."""

_MARGIN = 2 * DISTANCE_ERROR
"""m; subtracted from a distance of hulls, so that it is a lower bound."""

SETTLED = 0.01
"""m; bodies whose hulls are farther apart are asked no nearer: the hulls' distance, a lower bound, stands for theirs.

Twice the clearance that planners aim at, so that what they keep away from is the mesh.
"""

_hulls: "OrderedDict[str, coal.ConvexBase]" = OrderedDict()


class Outline:
    """The bodies with hulls in the place of meshes: their distances are lower bounds of the true ones.

    Attributes:
        geometry: the bodies, in the order of those they stand for.
        pairs: indices of the pairs with a mesh that is not bounded by a half-space.
    """

    def __init__(self, model: pin.Model, geometry: pin.GeometryModel) -> None:
        """Take the bodies and pairs of `geometry`."""
        self._model, self.geometry = model, geometry.copy()
        meshes = [isinstance(body.geometry, coal.BVHModelBase) for body in geometry.geometryObjects]
        planes = [isinstance(body.geometry, coal.Halfspace) for body in geometry.geometryObjects]
        found = [(p.first, p.second) for p in geometry.collisionPairs]
        asked = [k for k, (a, b) in enumerate(found) if (meshes[a] or meshes[b]) and not (planes[a] or planes[b])]
        self.pairs = frozenset(asked)
        for body in {body for k in asked for body in found[k] if meshes[body]}:
            item = self.geometry.geometryObjects[body]
            item.geometry = hull_of_mesh(item.geometry)

    def with_own_data(self) -> "Outline":
        """Return the same hulls with a work space of their own."""
        twin = Outline.__new__(Outline)
        twin._model, twin.geometry, twin.pairs = self._model, self.geometry, self.pairs
        return twin

    @cached_property
    def _data(self) -> pin.GeometryData:
        data = self.geometry.createData()
        exact_queries(data)
        return data

    @cached_property
    def _broad_phase(self) -> pin.BroadPhaseManager_DynamicAABBTreeCollisionManager:
        return pin.BroadPhaseManager_DynamicAABBTreeCollisionManager(self._model, self.geometry, self._data)

    def place(self, data: pin.Data) -> None:
        """Move the bodies to where the joints are in `data`."""
        if self.pairs:
            pin.updateGeometryPlacements(self._model, data, self.geometry, self._data)

    def collides(self, data: pin.Data, q: Array) -> bool:
        """Whether any pair of hulls, or of bodies that are no meshes, touches at q (n,); moves the joints in `data`."""
        return bool(pin.computeCollisions(self._model, data, self._broad_phase, q, True))

    def distance(self, pair: int) -> float:
        """Lower bound, m, of the distance of a pair where `place` put the bodies; negative where hulls meet."""
        return float(self.query(pair).min_distance) - _MARGIN

    def query(self, pair: int) -> coal.DistanceResult:
        """Nearest points of a pair of hulls where `place` put the bodies; the pair's next query overwrites them."""
        pin.computeDistance(self.geometry, self._data, pair)
        return self._data.distanceResults[pair]


def hull_of_mesh(mesh: coal.BVHModelBase) -> coal.ConvexBase:
    """Hull of a mesh; made once for each content."""
    vertices = np.array(mesh.vertices(), dtype=np.float64).reshape(-1, 3)
    key = digest([vertices.tobytes()])
    if key not in _hulls:
        try:
            _hulls[key] = convex_hull(vertices)
        except ValueError:  # flat
            _hulls[key] = thickened_hull(vertices).build()
        if len(_hulls) > _KEPT:
            _hulls.popitem(last=False)
    return _hulls[key]


def is_flat(shape: coal.CollisionGeometry) -> bool:
    """Whether this is a mesh that lies in a plane, or within a millionth of its extent of one."""
    if not isinstance(shape, coal.BVHModelBase):
        return False
    vertices = np.array(shape.vertices(), dtype=np.float64).reshape(-1, 3)
    spread = np.linalg.eigvalsh(np.cov(vertices.T))
    return bool(spread[0] <= 1e-12 * spread[-1])


def exact_queries(data: pin.GeometryData) -> None:
    """Make queries start afresh and converge.

    Guesses kept from call to call make a result depend on what was asked before, and at coal's tolerance of 1e-6
    distances to cylinders come out up to 0.17 mm too large.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # the old switch is the one that pinocchio turns on
        for request in (*data.distanceRequests, *data.collisionRequests):
            request.enable_cached_gjk_guess = False
            request.gjk_tolerance = 1e-9
            request.gjk_max_iterations = 500
