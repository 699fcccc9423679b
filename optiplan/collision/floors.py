"""The distance that each pair of a model keeps: what a scene's `Safety` asks, and less of pairs that stand nearer."""

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from optiplan import cache
from optiplan.arrays import Array, Flags, Index, distinct
from optiplan.collision.bodies_and_pairs import with_asked_checked
from optiplan.collision.contacts import Pair
from optiplan.collision.model import CollisionModel
from optiplan.geometry.safety import BuiltNear, Safety
from optiplan.geometry.scene import Scene
from optiplan.records import dataclass
from optiplan.robot.limits import UNBOUNDED
from optiplan.robot.loaded_robots import once_for_each_robot
from optiplan.robot.robot import Robot
from optiplan.robot.self_collision.pair_survey import content_digest

KEPT = 0.8
"""Share of its own distance that a pair keeps where it stands nearer than required."""

_ALONG = 33
"""Places of a joint at which a pair that it alone moves is measured."""

_SPREAD, _OFTEN = 128, 0.2
"""Configurations at which pairs of links are measured, and the share of those without contact that is often."""

_VERSION = 1
"""Counted up when links that are built nearer are found in another way, so that what is kept is made again."""

_PRIMES = np.array([2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53], dtype=float)
"""Of their square roots no two have a rational ratio."""


class NearPair(NamedTuple):
    """A pair that is nearer than required at an end of the motion, or wherever its joint stands.

    Attributes:
        pair: index in the model.
        asked: m.
        distance: m, there; of a pair that one joint moves the least.
        base: m, its floor there.
        end: which of `Safety.ends`; -1: everywhere.
    """

    pair: int
    asked: float
    distance: float
    base: float
    end: int


@dataclass(frozen=True, eq=False)
class Floors:
    """The floor of each pair of a model as a function of the configuration, see `Safety`.

    Attributes:
        asked: (P,) m, away from the ends.
        near: pairs with a lower floor, and why.
        ends: (E, n) the ends; nan for joints on their way, see `Safety.ends`.
        within: rad or m, summed over the joints that move a pair.
        moved: (P, n) whether a joint of the robot moves a pair.
        taken: (P,) m, what joints off their place can take of the distance of each pair.
    """

    asked: Array
    near: tuple[NearPair, ...]
    ends: Array
    within: float
    moved: Flags
    taken: Array

    @property
    def at_ends(self) -> list[NearPair]:
        """Those that are nearer at an end."""
        return [one for one in self.near if one.end >= 0]

    def with_ends(self, model: CollisionModel, ends: Sequence[Array]) -> "Floors":
        """Return the floors about these ends (n,), where the model measures which pairs are nearer.

        A pair that a joint on its way moves is not measured: it keeps the whole distance.
        """
        near = [one for one in self.near if one.end < 0]
        for k, q in enumerate(ends):
            placed = ~(self.moved & np.isnan(q)).any(axis=1)
            for pair, distance in measured(model, np.nan_to_num(q), np.where(placed, self.asked, 0.0), self.taken):
                if distance > 0.0:
                    base = KEPT * max(distance - float(self.taken[pair]), 0.0)
                    near.append(NearPair(pair, float(self.asked[pair]), distance, base, k))
        return replace(self, near=tuple(near), ends=np.array(ends).reshape(-1, self.ends.shape[1]))

    def over(self, pairs: Index, Q: Array, reach: Array) -> Array:
        """Return the largest floor (K,), m, of pairs (K,) while |q_j - Q_j| <= reach_j; Q and reach (K, n or more).

        Each end gives an upper bound of the floor, the least of them holds: f(q) <= base + rise (|Q - q_e| + reach)_1.
        """
        found = self.asked[pairs]
        for one in self.at_ends:
            rows = np.flatnonzero(pairs == one.pair)
            if len(rows):
                own, moved = rows[:, None], np.flatnonzero(self.moved[one.pair])
                way = (np.abs(Q[own, moved] - self.ends[one.end, moved]) + reach[own, moved]).sum(axis=1)
                share = np.minimum(way / self.within, 1.0)
                found[rows] = np.minimum(found[rows], one.base + (one.asked - one.base) * share)
        return found


def floors_of(model: CollisionModel, safety: Safety | None, error: Array | None = None) -> Floors | None:
    """Return the floors of a model's pairs; None where nothing is required.

    Pairs of links that are built nearer are those of the safety, see `with_built`. A pair that no joint moves keeps 0.8
    of its distance: what is held, and the tool that holds it. A link that one joint moves is built nearer to an
    obstacle where it is so at each of 33 places of the joint; it keeps 0.8 of the least distance.

    Args:
        model: its exact distances are measured at the ends, with obstacles at their first places.
        safety: what is required.
        error: (n,) rad or m, how far the joints may be off; what that can take of a pair's distance is taken first.
    """
    if safety is None:
        return None
    asked, scene = asked_of(model, safety)
    taken = np.zeros(len(asked)) if error is None or not error.any() else taken_by(model, error)
    near = _built_nearer(model, safety, asked, scene, taken)
    for one in near:
        asked[one.pair] = one.base
    n = model.robot.n
    built = Floors(asked, tuple(near), np.zeros((0, n)), safety.within, model.bounds.depends[:, :n], taken)
    return built.with_ends(model, safety.ends)


def asked_of(model: CollisionModel, safety: Safety) -> tuple[Array, Array]:
    """Return what is required of each pair (P,), m, and whether it is one with an obstacle (P,)."""
    first = len(model.names) - len(model.scene.obstacles)
    scene = np.array([max(pair.a, pair.b) >= first for pair in model.pairs], dtype=bool)
    known: dict[tuple[str, str, bool], float] = {}

    def of(pair: Pair, obstacle: bool) -> float:
        key = pair.name_a, pair.name_b, obstacle
        if key not in known:
            known[key] = safety.asked(*key)
        return known[key]

    asked = [of(pair, bool(obstacle)) for pair, obstacle in zip(model.pairs, scene, strict=True)]
    return np.array(asked, dtype=float), scene


def measured(model: CollisionModel, q: Array, asked: Array, taken: Array) -> list[tuple[int, float]]:
    """Return the pairs at q (n,) that are nearer than `asked` and `taken` (P,), and their distances, m.

    Pairs with an obstacle that moves are left out: at the end of a motion it is elsewhere.
    """
    limit = asked + taken
    bounds = model.bounds.distances(model.full(q)[None], float(limit.max(initial=0.0)))[0]
    possible = np.flatnonzero((bounds <= limit) & (asked > 0.0)).tolist()
    if not possible:
        return []
    moving = {body.name for body in model.scene.dynamic_obstacles}
    model.place(q)
    found = []
    for pair in possible:
        names = model.pairs[pair]
        if names.name_a in moving or names.name_b in moving:
            continue
        if pair in model.outline.pairs and model.outline.distance(pair) > limit[pair]:
            continue
        distance = model.pair_distance(pair).distance
        if distance < limit[pair]:
            found.append((pair, float(distance)))
    return found


def with_built(safety: Safety | None, robot: Robot) -> Safety | None:
    """Return what is required with the pairs of links that the robot's own structure holds nearer.

    They are found at 128 configurations within the limits of position, spread evenly. A pair that one joint moves is
    built nearer where it never touches and somewhere is nearer than required: it keeps 0.8 of its least distance. Any
    other pair is where it is nearer in a fifth of the configurations in which it does not touch: it does not touch.
    """
    if safety is None or not any((safety.own, *(pair.at_least for pair in safety.pairs))):
        return safety
    known, stated = _known_built(robot), repr((safety.own, safety.pairs))
    built = known.find(stated)
    if built is None:  # other threads do not wait: it takes seconds
        built = known.keep(stated, _kept_built(safety, with_asked_checked(safety, robot)))
    return replace(safety, built=built)


@once_for_each_robot
def _known_built(_robot: Robot) -> cache.MostRecent[tuple[BuiltNear, ...]]:
    """Return what was found of a robot, by the distances required: a file is read more often than it is changed."""
    return cache.MostRecent(8)


def _kept_built(safety: Safety, robot: Robot) -> tuple[BuiltNear, ...]:
    """Return the same as `_built`, kept on disk by the content of the robot, its checked pairs and what is required."""
    limits, checked = (robot.limits.lower, robot.limits.upper), robot.geometry.collisionPairs
    stated = [safety.own, [[pair.of, pair.others, pair.at_least] for pair in safety.pairs]]
    asked = json.dumps([*stated, [[pair.first, pair.second] for pair in checked]])
    name = cache.digest([content_digest(robot.model, robot.geometry, limits, _VERSION).encode(), asked.encode()])

    def make() -> bytes:
        return json.dumps([[one.links, one.distance, one.floor] for one in _built(safety, robot)]).encode()

    found = json.loads(cache.kept(f"built/{name}.json", make))
    return tuple(BuiltNear((first, second), distance, floor) for (first, second), distance, floor in found)


def _built(safety: Safety, robot: Robot) -> tuple[BuiltNear, ...]:
    """Return the pairs of links that are built nearer, see `with_built`."""
    model = CollisionModel(robot, Scene())
    asked, taken = asked_of(model, safety)[0], np.zeros(len(model.pairs))
    distances = np.full((_SPREAD, len(asked)), np.inf)
    for row, q in enumerate(_spread(robot)):
        for pair, distance in measured(model, q, asked, taken):
            distances[row, pair] = distance
    apart, alone = distances > 0.0, model.bounds.depends.sum(axis=1) == 1
    least = np.where(apart, distances, np.inf).min(axis=0, initial=np.inf)
    one_joint = alone & apart.all(axis=0) & np.isfinite(least)
    often = (apart & np.isfinite(distances)).sum(axis=0) > _OFTEN * apart.sum(axis=0)
    found: dict[tuple[str, str], BuiltNear] = {}
    for k in np.flatnonzero(one_joint | (often & np.isfinite(least))).tolist():
        first, second = sorted((model.pairs[k].name_a, model.pairs[k].name_b))
        one = BuiltNear((first, second), float(least[k]), KEPT * float(least[k]) if one_joint[k] else 0.0)
        known = found.get(one.links, one)
        found[one.links] = BuiltNear(one.links, min(one.distance, known.distance), min(one.floor, known.floor))
    return tuple(found[links] for links in sorted(found))


def _spread(robot: Robot) -> Array:
    """Return configurations (128, n) within the limits: multiples of irrational steps, a Kronecker sequence."""
    joints = np.arange(robot.n)
    steps = np.sqrt(_PRIMES[joints % len(_PRIMES)]) / (1 + joints // len(_PRIMES))
    lower, upper = robot.limits.range_about(0.0, 0.0)
    return np.asarray(lower + np.modf(np.arange(1, _SPREAD + 1)[:, None] * steps)[0] * (upper - lower))


def _built_nearer(model: CollisionModel, safety: Safety, asked: Array, scene: Array, taken: Array) -> list[NearPair]:
    """Return the pairs that are nearer than required by structure: links, what is fixed, what one joint moves."""
    built = {one.links: one for one in safety.built}
    found: list[NearPair] = []
    for pair in model.pairs if built else ():
        one = built.get((min(pair.name_a, pair.name_b), max(pair.name_a, pair.name_b)))
        if one is not None and asked[pair.index] > one.floor:
            base = max(one.floor - KEPT * float(taken[pair.index]), 0.0)
            found.append(NearPair(pair.index, float(asked[pair.index]), one.distance, base, -1))
    moved = model.bounds.depends.sum(axis=1)
    fixed = np.where(moved == 0, asked, 0.0)
    fixed[[one.pair for one in found]] = 0.0
    for pair_index, distance in measured(model, np.zeros(model.robot.n), fixed, taken):  # anywhere the same
        if distance > 0.0:
            found.append(NearPair(pair_index, float(asked[pair_index]), distance, KEPT * distance, -1))
    alone = np.flatnonzero((moved == 1) & (asked > 0.0) & scene)
    joints = np.argmax(model.bounds.depends[alone], axis=1) if len(alone) else np.zeros(0, dtype=int)
    for j in distinct(joints[joints < model.robot.n]).tolist():
        only = np.zeros(len(asked))
        only[alone[joints == j]] = asked[alone[joints == j]]
        rows = [dict(measured(model, q, only, taken * (only > 0.0))) for q in _along(model.robot, j)]
        for pair_index in set(rows[0]).intersection(*rows):
            least = min(row[pair_index] for row in rows)
            if least > 0.0:
                base = KEPT * max(least - float(taken[pair_index]), 0.0)
                found.append(NearPair(pair_index, float(asked[pair_index]), least, base, -1))
    return found


def _along(robot: Robot, j: int) -> Array:
    """Return configurations (33, n) over the range of joint j."""
    lower, upper = robot.limits.range_about(0.0, 0.0)
    Q = np.tile(0.5 * (lower + upper), (_ALONG, 1))
    Q[:, j] = np.linspace(lower[j], upper[j], _ALONG)
    return Q


def taken_by(model: CollisionModel, error: Array) -> Array:
    """Return a bound (P,), m, on what joints that are off by `error` (n,) take of the distance of each pair."""
    still = np.full(model.model.nq - model.robot.n, UNBOUNDED)
    arms = model.bounds.moment_arms(np.append(model.robot.limits.stroke, still))
    return np.asarray(arms[:, : len(error)] @ error)
