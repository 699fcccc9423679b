"""Test whether any pair of bodies is nearer than a margin of its own, in C++ and without measuring distances."""

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.geometry.coal_queries import make_exact

_LARGEST_MESH_MARGIN = 0.03
"""m; querying meshes with a larger margin costs more than halving the motion once more."""


class PairMargins:
    """Test of configurations against one margin, m, a pair; use one object a thread.

    It is as cheap as a contact test: boxes grown by the margins exclude most pairs, and the query of another pair ends
    when the sign is known. Distances take ten times longer. Meshes are queried only if their hulls are nearer than the
    margins, and only if no mesh has a margin above `_LARGEST_MESH_MARGIN`; else the hulls decide.
    """

    def __init__(self, model: CollisionModel) -> None:
        self._meshes = np.array(sorted(model.outline.pairs), dtype=np.intp)
        self._hulls, self._wide = _Margins(model, model.outline.geometry), False
        self._bodies = _Margins(model, model.geometry) if len(self._meshes) else self._hulls
        self._waiting: Array | None = None  # margins not yet set for the meshes

    def set(self, margins: Array) -> None:
        """Set the margins (P,) >= 0."""
        self._hulls.set(margins)
        self._wide = bool((margins[self._meshes] > _LARGEST_MESH_MARGIN).any())
        self._waiting = margins

    def near(self, q: Array) -> bool:
        """Return whether any pair, of hulls if a margin is large, is nearer than its margin at q (n,), ± 1e-6 m."""
        if not self._hulls.near(q):
            return False
        if self._wide or not len(self._meshes):
            return True
        if self._waiting is not None:
            self._bodies.set(self._waiting)
            self._waiting = None
        return self._bodies.near(q)


class _Margins:
    def __init__(self, model: CollisionModel, geometry: pin.GeometryModel) -> None:
        self._model, self._geometry = model.model, geometry
        self._data, self._queries = model.model.createData(), geometry.createData()
        make_exact(self._queries)
        self._requests = list(self._queries.collisionRequests)
        self._broad_phase = pin.BroadPhaseManager_DynamicAABBTreeCollisionManager(model.model, geometry, self._queries)
        # The broad phase misses plane meshes, and does not grow half-spaces by the margins.
        self._alone = sorted({*model.bounds.plane_pairs.tolist(), *model.flat_pairs})

    def set(self, margins: Array) -> None:
        """Set the margins (P,) >= 0."""
        for request, margin in zip(self._requests, margins.tolist(), strict=True):
            request.security_margin = margin

    def near(self, q: Array) -> bool:
        """Return whether any pair is nearer than its margin at q (n,), ± 1e-6 m."""
        if pin.computeCollisions(self._model, self._data, self._broad_phase, q, True):
            return True
        return any(pin.computeCollision(self._geometry, self._queries, pair) for pair in self._alone)
