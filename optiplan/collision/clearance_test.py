"""Is any pair of bodies nearer than a distance of its own? One query in C++ that measures no distance."""

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.geometry.coal_queries import make_exact

_WIDE = 0.03
"""m; asking meshes within a wider margin costs more than cutting the motion once more."""


class PairMargins:
    """Margins, m, one a pair, that `near` holds a configuration against; use one object a thread.

    As cheap as asking whether anything touches, because bounding boxes grown by the margins rule out most pairs and
    the others stop at a sign, while distances take ten times longer. Meshes are asked where their hulls are nearer than
    the margins, and only while no mesh has a margin above `_WIDE`: wider ones are held against the hulls.
    """

    def __init__(self, model: CollisionModel) -> None:
        self._meshes = np.array(sorted(model.outline.pairs), dtype=np.intp)
        self._hulls, self._wide = _Margins(model, model.outline.geometry), False
        self._bodies = _Margins(model, model.geometry) if len(self._meshes) else self._hulls
        self._waiting: Array | None = None  # margins that the meshes have not been told of

    def set(self, margins: Array) -> None:
        """Margins (P,) >= 0 from now on."""
        self._hulls.set(margins)
        self._wide = bool((margins[self._meshes] > _WIDE).any())
        self._waiting = margins

    def near(self, q: Array) -> bool:
        """Whether any pair is nearer than its margin at q (n,), its hulls where its margin is wide; right to 1e-6 m."""
        if not self._hulls.near(q):
            return False
        if self._wide or not len(self._meshes):
            return True
        if self._waiting is not None:
            self._bodies.set(self._waiting)
            self._waiting = None
        return self._bodies.near(q)


class _Margins:
    """Margins of the pairs of one set of bodies."""

    def __init__(self, model: CollisionModel, geometry: pin.GeometryModel) -> None:
        self._model, self._geometry = model.model, geometry
        self._data, self._queries = model.model.createData(), geometry.createData()
        make_exact(self._queries)
        self._requests = list(self._queries.collisionRequests)
        self._broad_phase = pin.BroadPhaseManager_DynamicAABBTreeCollisionManager(model.model, geometry, self._queries)
        # The box around a half-space is not grown by its margins, so those pairs are asked one by one.
        self._planes = model.bounds.plane_pairs.tolist()

    def set(self, margins: Array) -> None:
        """Margins (P,) >= 0 from now on."""
        for request, margin in zip(self._requests, margins.tolist(), strict=True):
            request.security_margin = margin

    def near(self, q: Array) -> bool:
        """Whether any pair is nearer than its margin at q (n,); right to 1e-6 m."""
        if pin.computeCollisions(self._model, self._data, self._broad_phase, q, True):
            return True
        return any(pin.computeCollision(self._geometry, self._queries, pair) for pair in self._planes)
