"""Distances of pairs of bodies by coal, with solvers made only for the pairs that are asked."""

from collections.abc import Callable
from copy import copy
from functools import cached_property
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Index
from optiplan.collision.geometry_model import geometry_of

MANY = 2000
"""Pairs from which on solvers are made on demand: pinocchio takes 7 kB for a pair, 14 MB for so many."""


class Ready(NamedTuple):
    """Pairs that can be asked.

    Attributes:
        geometry: bodies and pairs.
        data: where the bodies are, requests and results.
        places: (K,) of the pairs that were meant, among those of `geometry`.
    """

    geometry: pin.GeometryModel
    data: pin.GeometryData
    places: Index


class PairQueries:
    """Queries of the pairs of a geometry model; one object a thread.

    Of up to `MANY` pairs, pinocchio's data of all are made at once. Of more, a model is made of those that have been
    asked so far and of their bodies, anew whenever others are asked: bounding volumes leave a few hundred.

    Args:
        model: the joints that carry the bodies.
        geometry: bodies and pairs.
        prepare: sets the requests of new data.
    """

    def __init__(
        self, model: pin.Model, geometry: pin.GeometryModel, prepare: Callable[[pin.GeometryData], None]
    ) -> None:
        self._model, self._whole, self._prepare = model, geometry, prepare
        self.many = len(geometry.collisionPairs) > MANY
        self._geometry = self._solved = geometry  # solvers point into the model that they were made of
        self._data: Any = None if self.many else self._made(geometry)
        self._places: dict[int, int] = {}
        self._joints: pin.Data | None = None

    def with_placements(self, geometry: pin.GeometryModel) -> "PairQueries":
        """Return queries of the same bodies and pairs, placed as in `geometry`, with a work space of their own.

        Its solvers are copies, and read the shapes of the model that the first ones were made of, which is kept.
        """
        if self.many:
            return PairQueries(self._model, geometry, self._prepare)
        twin = copy(self)
        twin._whole = twin._geometry = geometry
        twin._data, twin._places, twin._joints = self._data.copy(), {}, None
        vars(twin).pop("_broad_phase", None)
        return twin

    def place(self, joints: pin.Data) -> None:
        """Move the bodies to where the joints are in `joints`, which is kept."""
        self._joints = joints
        if self._data is not None:
            pin.updateGeometryPlacements(self._model, joints, self._geometry, self._data)

    def poses(self) -> Array:
        """Poses X_WB (B, 4, 4) of all bodies where `place` put them."""
        assert self._joints is not None
        oMi = self._joints.oMi
        poses = [(oMi[body.parentJoint] * body.placement).homogeneous for body in self._whole.geometryObjects]
        return np.array(poses).reshape(-1, 4, 4)

    def ready(self, pairs: Index) -> Ready:
        """Make these pairs (K,) ready to be asked where `place` put the bodies."""
        if not self.many:
            return Ready(self._geometry, self._data, pairs)
        self._add([pair for pair in np.unique(pairs).tolist() if pair not in self._places])
        return Ready(self._geometry, self._data, np.array([self._places[pair] for pair in pairs.tolist()], np.intp))

    def distance(self, pair: int) -> coal.DistanceResult:
        """Nearest points of a pair where `place` put the bodies; its next query overwrites them."""
        place = self._place_of(pair)
        pin.computeDistance(self._geometry, self._data, place)
        return self._data.distanceResults[place]

    def touches(self, pair: int) -> bool:
        """Whether a pair touches where `place` put the bodies."""
        place = self._place_of(pair)
        return bool(pin.computeCollision(self._geometry, self._data, place))

    def any_touch(self, joints: pin.Data, q: Array) -> bool:
        """Whether any pair touches at q (n,), found by the broad phase; moves `joints`. Only of few pairs."""
        return bool(pin.computeCollisions(self._model, joints, self._broad_phase, q, True))

    def nearest(self, joints: pin.Data, q: Array) -> int:
        """Return the nearest pair at q (n,), whose `result` it leaves; moves `joints`. Only of few pairs."""
        return int(pin.computeDistances(self._model, joints, self._geometry, self._data, q))

    def result(self, pair: int) -> coal.DistanceResult:
        """Return what the last query of a pair found."""
        return self._data.distanceResults[pair]

    @cached_property
    def _broad_phase(self) -> pin.BroadPhaseManager_DynamicAABBTreeCollisionManager:
        return pin.BroadPhaseManager_DynamicAABBTreeCollisionManager(self._model, self._geometry, self._data)

    def _place_of(self, pair: int) -> int:
        if not self.many:
            return pair
        if pair not in self._places:
            self._add([pair])
        return self._places[pair]

    def _add(self, fresh: list[int]) -> None:
        """Make the model of the pairs asked so far anew, with some more."""
        if not fresh and self._data is not None:
            return
        for pair in fresh:
            self._places[pair] = len(self._places)
        whole, found = self._whole, [(p.first, p.second) for p in (self._whole.collisionPairs[k] for k in self._places)]
        bodies = {body: k for k, body in enumerate(sorted({body for pair in found for body in pair}))}
        part = geometry_of([whole.geometryObjects[body] for body in bodies])
        for a, b in found:
            part.addCollisionPair(pin.CollisionPair(bodies[a], bodies[b]))
        self._geometry, self._data = part, self._made(part)
        if self._joints is not None:
            pin.updateGeometryPlacements(self._model, self._joints, part, self._data)

    def _made(self, geometry: pin.GeometryModel) -> pin.GeometryData:
        data = geometry.createData()
        self._prepare(data)
        return data
