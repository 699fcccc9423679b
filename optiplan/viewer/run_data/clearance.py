"""Clearance of one run for the page: what the certificate proved at each time, and the distance measured there."""

from typing import Any

import numpy as np

from optiplan.arrays import Array, Flags
from optiplan.collision.contacts import Contact
from optiplan.collision.model import CollisionModel
from optiplan.problem.problem import Problem
from optiplan.problem.task.scene_part import ScenePart
from optiplan.problem.task.timeline import mismatch, proved_parts
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.collision_check import certified
from optiplan.verify.continuous.clearance_record import ClearanceBound, ClearanceRecord
from optiplan.verify.report import VerifyPolicy
from optiplan.viewer.surfaces import base64_of

_EVEN = 160  # samples of the distance, evenly spread
_NEAR = 0.75  # times as many at the most, where the certificate looked closely
_CLOSE = 0.01  # m: closely looked at is what was proved by less
_BISECTIONS = 24
_CHOICES = 8  # pairs that can be looked at alone: those nearest of all at some sample, the nearest first


@dataclass(frozen=True, eq=False)
class _Measured:
    """Clearance of a part of a motion, in the time of the whole: samples, and the certificate's bound if it proves."""

    model: CollisionModel
    t: Array
    Q: Array
    near: list[Contact]
    proved: float | None
    bound: ClearanceBound | None
    contacts: list[list[float]]

    def names(self, pair: int) -> tuple[str, str]:
        """Return the bodies of a pair."""
        return self.model.pairs[pair].name_a, self.model.pairs[pair].name_b

    def named(self, names: tuple[str, str]) -> Flags:
        """Return which pairs (P,) are of these bodies."""
        return np.array([self.names(pair) == names for pair in range(len(self.model.pairs))])

    @property
    def of_scene(self) -> Flags:
        """Which pairs (P,) are of a body of the scene."""
        scene = {body.name for body in self.model.scene.obstacles}
        return np.array([not scene.isdisjoint(self.names(pair)) for pair in range(len(self.model.pairs))])


def clearance_of(
    problem: Problem, trajectory: Trajectory, even: int = _EVEN, chosen: bool = True
) -> dict[str, Any] | None:
    """JSON-ready clearance over time; None where no two bodies can meet. Lengths in m, arrays packed.

    `t` (k,), `distance` (k,), `points` (k, 2, 3), `pair` (k,): the nearest pair of `pairs`, measured at samples.
    `edges` (m + 1,), `proved` (m,), `proved_pair` (m,): the certificate's bound on each interval, only for what is
    proved; its least is the clearance in the report. `least`: the smallest distance. `contacts`: times from and to, s,
    in which bodies overlap. Of a task each part of the motion is measured in its own scene, and what its last event
    leaves at the end of the motion.
    `choices`, if `chosen`: [{`of`, `distance` (k,), `points` (k, 2, 3)}], the same of the scene's pairs alone, of the
    robot's own, and of single pairs; NaN where there is none.
    """
    if problem.task and mismatch(problem, trajectory):
        return None
    parts = [
        measured
        for part in proved_parts(problem, trajectory)
        if (measured := _measured(part, part.motion(trajectory), trajectory.duration, even)) is not None
    ]
    if not parts:
        return None
    at = [part.names(one.pair.index) for part in parts for one in part.near]
    bounds = [(part, part.bound) for part in parts if part.bound is not None]
    proved_at = [part.names(pair) for part, bound in bounds for pair in bound.pair.tolist()]
    index = {names: i for i, names in enumerate(sorted({*at, *proved_at}))}
    shown: dict[str, Any] = {
        "pairs": [list(names) for names in index],
        **_samples(parts),
        "pair": [index[names] for names in at],
        "choices": _choices(parts, [names for names in index if names in at]) if chosen else [],
    }
    if len(bounds) < len(parts):
        return shown
    least = min(part.proved for part in parts if part.proved is not None)
    proved_pair = [index[names] for names in proved_at]
    return shown | _proved([bound for _, bound in bounds]) | {"proved_pair": proved_pair, "proved_least": least}


def _samples(parts: list[_Measured]) -> dict[str, Any]:
    """What was measured at the samples: times, distances and nearest points, the nearest of all, contacts."""
    t = np.concatenate([part.t for part in parts])
    near = [contact for part in parts for contact in part.near]
    distance = np.array([one.distance for one in near])
    k = int(np.argmin(distance))
    return {
        "t": base64_of(t),
        "distance": base64_of(distance),
        "points": base64_of(np.array([[one.point_a, one.point_b] for one in near])),
        "least": _moment(float(t[k]), near[k]),
        "contacts": [contact for part in parts for contact in part.contacts],
    }


def _proved(bounds: list[ClearanceBound]) -> dict[str, Any]:
    """The certificate's bounds of all parts, one after the other."""
    edges = np.concatenate([bounds[0].edges[:1], *(bound.edges[1:] for bound in bounds)])
    proved = np.concatenate([bound.clearance for bound in bounds])
    return {"edges": base64_of(edges, "<f8"), "proved": base64_of(proved, "<f8")}


def _measured(part: ScenePart, motion: Trajectory, duration: float, even: int) -> _Measured | None:
    """Prove and measure a part of a motion; None where no two bodies can meet."""
    record = ClearanceRecord()
    model, motion, _, _, proof = certified(part.problem, motion, VerifyPolicy(), record)
    if not model.pairs:
        return None
    bound = record.bound(motion.duration, len(model.pairs)) if proof.proved else None
    own = max(4, int(np.ceil(even * (part.end - part.begin) / duration)))
    t = _times(motion, bound, own, None if proof.nearest is None else proof.nearest.time)
    near = [_nearest(model, motion, time) for time in t]
    contacts = _contacts(model, motion, t, np.array([one.distance for one in near]))

    def later(times: Array) -> Array:  # a part that takes no time stands still for a second
        return np.minimum(part.begin + times, part.end)

    return _Measured(
        model,
        later(t),
        motion(t),
        near,
        proof.clearance if proof.proved else None,
        None if bound is None else bound._replace(edges=later(bound.edges)),
        [later(np.array(times)).tolist() for times in contacts],
    )


def _choices(parts: list[_Measured], pairs: list[tuple[str, str]]) -> list[dict[str, Any]]:
    """What can be looked at alone: the nearest of the robot and the scene, of the robot itself, and single pairs."""
    nearest = {
        names: min(one.distance for part in parts for one in part.near if part.names(one.pair.index) == names)
        for names in pairs
    }
    found = [
        _chosen("robot – scene", parts, [part.of_scene for part in parts]),
        _chosen("robot – itself", parts, [~part.of_scene for part in parts]),
        *(
            _chosen(" – ".join(names), parts, [part.named(names) for part in parts])
            for names in sorted(nearest, key=nearest.__getitem__)[:_CHOICES]
        ),
    ]
    return [one for one in found if one is not None]


def _chosen(of: str, parts: list[_Measured], which: list[Flags]) -> dict[str, Any] | None:
    """The nearest of some pairs, (P,) of each part, at every sample; None where no part has such a pair."""
    distance = np.full(sum(len(part.t) for part in parts), np.nan)
    points = np.full((len(distance), 2, 3), np.nan)
    k = 0
    for part, chosen in zip(parts, which, strict=True):
        pairs = np.flatnonzero(chosen)
        for i, q in enumerate(part.Q if len(pairs) else (), k):
            found = part.model.nearest_of(q, pairs)
            distance[i], points[i] = found.distance, (found.point_a, found.point_b)
        k += len(part.t)
    if np.isnan(distance).all():
        return None
    return {"of": of, "distance": base64_of(distance), "points": base64_of(points)}


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
