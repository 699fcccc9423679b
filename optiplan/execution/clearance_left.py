"""What is left of the clearance that was proved along a path while the joints are off it."""

from collections.abc import Sequence

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.kept_models import collision_model
from optiplan.collision.model import CollisionModel
from optiplan.problem.task.scene_part import ScenePart
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.collision_check import checked_robot
from optiplan.verify.continuous.certificate import certify
from optiplan.verify.continuous.clearance_record import ClearanceRecord
from optiplan.verify.report import VerifyPolicy

CELL = 0.02
"""s: length of the parts of the path in which a clearance and the moment arms of bodies are kept."""


_SAME, _PROBE = 1e-12, 1e-3
"""s between times that are one; rad or m, with which moment arms are probed."""


@dataclass(frozen=True, eq=False)
class _PartClearance:
    """K cells of a part of the path: edges (K + 1,), s; clearance (K, P), m, and moment arms (K, P, n), m or 1."""

    edges: Array
    clearance: Array
    moment_arms: Array


class ClearanceLeft:
    """Lower bounds of the distance of any two bodies, with the joints off the path by so much.

    In each cell of the path every pair p stays farther apart than the certificate's clearance c_p. Joints that are off
    by d_j move its bodies against each other by at most prod_j (1 + d_j) sum_j L_pj d_j, with L_pj the farthest that a
    point of them gets from the axis of joint j in the cell (1 where it slides): so much less is left.

    Holds at: all places of the path.

    Args:
        parts: of the path, in which the scene stays the same.
        motion: the whole path.
    """

    def __init__(self, parts: Sequence[ScenePart], motion: Trajectory) -> None:
        self._parts = [_clearances(part, part.motion(motion)) for part in parts]

    def least(self, place: float, off: Array) -> float:
        """Return the least distance, m, that is left at a place, s, with joints off by `off` (n,), rad or m.

        inf where no two bodies can meet.
        """
        part = next((one for one in self._parts if place <= one.edges[-1]), self._parts[-1])
        k = int(np.searchsorted(part.edges[1:-1], place, side="right"))
        left = part.clearance[k] - np.exp(off.sum()) * (part.moment_arms[k] @ off)
        return float(left.min(initial=np.inf))


def _clearances(part: ScenePart, motion: Trajectory) -> _PartClearance:
    policy = VerifyPolicy()
    model = collision_model(checked_robot(part.problem, policy), part.problem.scene)
    count = max(1, int(np.ceil(motion.duration / CELL)))
    edges: Array = np.linspace(0.0, motion.duration, count + 1)
    clearance, record = np.full((count, len(model.pairs)), -np.inf), ClearanceRecord()
    known = bool(model.pairs) and certify(model, motion, policy, record).proved
    if known and np.isfinite(record.bound(motion.duration, len(model.pairs)).clearance).all():
        begin, end, pairs, proved = record.proved()
        clearance[:] = np.inf
        first = np.clip(np.searchsorted(edges, begin + _SAME, side="right") - 1, 0, count - 1)
        last = np.clip(np.searchsorted(edges, end - _SAME, side="left"), 1, count)
        for one, low, high, least in zip(pairs, first, last, proved, strict=True):
            clearance[low:high, one] = np.minimum(clearance[low:high, one], least)
    return _PartClearance(edges + part.begin, clearance, _moment_arms(model, motion, edges))


def _moment_arms(model: CollisionModel, motion: Trajectory, edges: Array) -> Array:
    """Return the moment arms (K, P, n): those in the middle of each cell, and how far bodies travel within it."""
    middle, half = motion(0.5 * (edges[1:] + edges[:-1])), 0.5 * float(edges[1] - edges[0])
    fastest = np.maximum(*np.abs(motion.extrema(1)))
    bounds, moment_arms = model.bounds, np.zeros((len(middle), len(model.pairs), motion.n))
    travel = bounds.travel(middle, np.tile(half * fastest, (len(middle), 1)))
    for j in range(motion.n):
        one = np.zeros_like(middle)
        one[:, j] = _PROBE
        found = bounds.travel(middle, one) / _PROBE
        moment_arms[:, :, j] = np.where(found > 0.0, found + travel, 0.0)
    return moment_arms
