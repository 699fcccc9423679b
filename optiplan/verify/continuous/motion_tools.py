"""What is the same for every motion in a work space, made once."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np

from optiplan.arrays import Index
from optiplan.collision.model import CollisionModel, SameBodies
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.bodies import Bodies
from optiplan.verify.continuous.kept_clearance import KeptClearance, kept_clearances
from optiplan.verify.continuous.motion_bounds import Motion
from optiplan.verify.continuous.proof import SCENE, SELF
from optiplan.verify.continuous.separating_planes import PairDistances
from optiplan.verify.tolerances import LARGEST


@dataclass(frozen=True, eq=False)
class MotionTools:
    """What is the same for every motion in a work space.

    `kinds` (P + H,): `SELF` or `SCENE` of each pair; `kept`: what is proved of pairs for all configurations.
    """

    bodies: Bodies
    distances: PairDistances
    motion: Motion
    kinds: Index
    kept: Mapping[int, KeptClearance]

    @classmethod
    def of(cls, model: CollisionModel) -> "MotionTools":
        """Make the tools for a work space."""
        bodies = Bodies(model)
        obstacle = np.zeros(len(bodies.shapes), dtype=bool)
        obstacle[len(model.names) - len(model.scene.obstacles) : len(model.names)] = True
        kept = kept_clearances(model.robot)
        known = {k: kept[pair] for k, pair in enumerate(map(tuple, model.bounds.pairs.tolist())) if pair in kept}
        kinds = np.where(obstacle[bodies.pairs].any(axis=1), SCENE, SELF)
        return cls(bodies, PairDistances(model, bodies), Motion(bodies), kinds, known)

    def with_obstacles_of(self, model: CollisionModel) -> "MotionTools":
        """Return the same of a model in which obstacles stand elsewhere."""
        bodies = self.bodies.with_obstacles_of(model)
        distances, motion = self.distances.with_obstacles_of(model, bodies), self.motion.with_obstacles_of(bodies)
        return replace(self, bodies=bodies, distances=distances, motion=motion)


_tools: WeakKeyDictionary[CollisionModel, MotionTools] = WeakKeyDictionary()
_last: WeakKeyDictionary[SameBodies, MotionTools] = WeakKeyDictionary()
"""That of the last work space of the same bodies, of which obstacles may have stood elsewhere."""


def tools_of(model: CollisionModel) -> MotionTools:
    """Return the tools for a work space, made where there are none."""
    if model not in _tools:
        known = _last.get(model.same_bodies)
        found = MotionTools.of(model) if known is None else known.with_obstacles_of(model)
        _tools[model] = _last[model.same_bodies] = found
    return _tools[model]


def too_large(trajectory: Trajectory, bodies: Bodies, names: Sequence[str]) -> str:
    """Say why numbers are too large for a proof in floating point; nothing where they are not.

    Args:
        trajectory: whose terms |c_k| h^k of positions are looked at, and those of the joints that follow.
        bodies: of the work space, which say how far each of them reaches, m.
        names: (G,) of the bodies.
    """
    terms = np.abs(trajectory.unit_pieces(0)).max(axis=(0, 2))  # (n,)
    if not bodies.kinematics.joint_reach(terms).max(initial=terms.max()) <= LARGEST:
        return f"a trajectory with terms beyond {LARGEST:g} leaves no digits for a proof"
    far = np.flatnonzero(~(bodies.extent <= LARGEST))
    return f"'{names[far[0]]}', a body beyond {LARGEST:g} leaves no digits for a proof" if len(far) else ""
