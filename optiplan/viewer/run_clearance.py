"""Clearance of one run for the page: what the certificate proved at each time, and the distance measured there."""

from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel, Contact
from optiplan.problem.problem import Problem
from optiplan.trajectory.obstacle_columns import with_obstacles
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.certificate import certify
from optiplan.verify.continuous.clearance_record import ClearanceBound, ClearanceRecord
from optiplan.verify.report import VerifyPolicy
from optiplan.verify.verify import checked_robot
from optiplan.viewer.surfaces import packed

_EVEN = 160  # samples of the distance, evenly spread
_NEAR = 0.75  # times as many at the most, where the certificate looked closely
_CLOSE = 0.01  # m: closely looked at is what was proved by less
_BISECTIONS = 24


def clearance_of(problem: Problem, trajectory: Trajectory, even: int = _EVEN) -> dict[str, Any] | None:
    """JSON-ready clearance over time; None where no two bodies can meet. Lengths in m, arrays packed.

    `t` (k,), `distance` (k,), `points` (k, 2, 3), `pair` (k,): the nearest pair of `pairs`, measured at samples.
    `edges` (m + 1,), `proved` (m,), `proved_pair` (m,): the certificate's bound on each interval, only for what is
    proved; its least is the clearance in the report. `least`: the smallest distance. `contacts`: times from and to, s,
    in which bodies overlap.
    """
    policy = VerifyPolicy()
    model = CollisionModel(checked_robot(problem, policy), problem.scene)
    if not model.pairs:
        return None
    trajectory = with_obstacles(trajectory, model.motions)
    record = ClearanceRecord()
    proof = certify(model, trajectory, policy, record)
    bound = record.bound(trajectory.duration, len(model.pairs)) if proof.proved else None
    t = _times(trajectory, bound, even, None if proof.nearest is None else proof.nearest.time)
    measured = [_nearest(model, trajectory, time) for time in t]
    distance = np.array([one.distance for one in measured])
    points = np.array([[one.point_a, one.point_b] for one in measured])
    k = int(np.argmin(distance))
    near = np.array([one.pair.index for one in measured])
    used = np.unique(near if bound is None else np.append(near, bound.pair))
    shown: dict[str, Any] = {
        "pairs": [[model.pairs[pair].name_a, model.pairs[pair].name_b] for pair in used.tolist()],
        "t": packed(t),
        "distance": packed(distance),
        "points": packed(points),
        "pair": np.searchsorted(used, near).tolist(),
        "least": _moment(float(t[k]), measured[k]),
        "contacts": _contacts(model, trajectory, t, distance),
    }
    if bound is None:
        return shown
    return shown | {
        "edges": packed(bound.edges, "<f8"),
        "proved": packed(bound.clearance, "<f8"),
        "proved_pair": np.searchsorted(used, bound.pair).tolist(),
        "proved_least": proof.clearance,
    }


def _nearest(model: CollisionModel, trajectory: Trajectory, time: float) -> Contact:
    found = model.clearance(trajectory(np.array([time]))[0])
    if found is None:
        raise ValueError("a model without pairs has no clearance")
    return found


def _moment(time: float, contact: Contact) -> dict[str, Any]:
    return {
        "t": time,
        "distance": contact.distance,
        "pair": [contact.pair.name_a, contact.pair.name_b],
        "points": [contact.point_a.tolist(), contact.point_b.tolist()],
    }


def _times(trajectory: Trajectory, bound: ClearanceBound | None, even: int, nearest: float | None) -> Array:
    t = np.linspace(0.0, trajectory.duration, even + 1)
    if bound is not None:
        middles = 0.5 * (bound.edges[1:] + bound.edges[:-1])[bound.clearance < _CLOSE]
        step = max(1, int(np.ceil(len(middles) / (_NEAR * even))))
        t = np.union1d(t, middles[::step])
    return np.asarray(t if nearest is None else np.union1d(t, [nearest]))


def _contacts(model: CollisionModel, trajectory: Trajectory, t: Array, distance: Array) -> list[list[float]]:
    """Times from and to, s, of each stretch whose samples overlap; its ends by bisection."""

    def crossing(free: float, touching: float) -> float:
        for _ in range(_BISECTIONS):
            middle = 0.5 * (free + touching)
            if _nearest(model, trajectory, middle).distance > 0.0:
                free = middle
            else:
                touching = middle
        return touching

    touches = distance <= 0.0
    padded = np.concatenate([[False], touches, [False]])
    first, last = np.flatnonzero(padded[1:] & ~padded[:-1]), np.flatnonzero(padded[:-1] & ~padded[1:]) - 1
    found = []
    for i, k in zip(first.tolist(), last.tolist(), strict=True):
        begin = float(t[i]) if i == 0 else crossing(float(t[i - 1]), float(t[i]))
        end = float(t[k]) if k == len(t) - 1 else crossing(float(t[k + 1]), float(t[k]))
        found.append([begin, end])
    return found
