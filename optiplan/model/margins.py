"""Is any pair of bodies nearer than a distance of its own? One query in C++ that measures no distance."""

import pinocchio as pin

from optiplan.arrays import Array
from optiplan.model.collision import CollisionModel
from optiplan.model.outline import exact_queries


class PairMargins:
    """Margins, m, one a pair, that `near` holds a configuration against; use one object a thread.

    As cheap as asking whether anything touches, because bounding boxes grown by the margins rule out most pairs and
    the others stop at a sign, while distances take ten times longer.
    """

    def __init__(self, model: CollisionModel) -> None:
        self._model, self._geometry = model.robot.model, model.geometry
        self._data, self._queries = model.robot.model.createData(), model.geometry.createData()
        exact_queries(self._queries)
        self._requests = list(self._queries.collisionRequests)
        self._broad_phase = pin.BroadPhaseManager_DynamicAABBTreeCollisionManager(
            model.robot.model, model.geometry, self._queries
        )
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
