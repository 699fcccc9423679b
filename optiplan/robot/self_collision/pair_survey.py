"""Survey of pairs of links: how often they touch, which always do, and which are proved never to."""

import json
import logging
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import combinations
from typing import Any
from weakref import WeakKeyDictionary

import coal
import numpy as np
import numpy.typing as npt
import pinocchio as pin

from optiplan import cache
from optiplan.arrays import Array, Flags, Index
from optiplan.geometry.convex import mesh_triangles, mesh_vertices
from optiplan.records import dataclass
from optiplan.robot.self_collision.pair_proof import GAP, PairProof
from optiplan.robot.urdf.srdf import LinkPair, link_pair

log = logging.getLogger(__name__)

ALWAYS = 0.95
"""Share of a joint's range over which neighbours touch by design; MoveIt's set-up assistant takes the same share.

Neighbours that touch less often have an end of travel that is worth knowing, and stay checked.
"""

OFTEN = 0.2
"""Share of samples above which two links most likely overlap by construction: the robot can hardly move."""

ANGLES = 720
"""Places over a joint's range, in the middles of as many equal parts, at which neighbours are asked."""

SAMPLES, WORK = 2000, 1_000_000
"""Configurations sampled for rates of collision, and pairs of bodies at configurations that this may come to."""

_ROWS = 100_000
"""Pairs of bodies that are placed at once: each takes some kilobytes."""

VERSION = 6
"""Counted up when surveys are made in another way, so that cached ones are made again."""


@dataclass(frozen=True)
class PairSurvey:
    """Result of the survey of the pairs of links that joints move.

    Attributes:
        rates: share of `samples` random configurations in which each pair touches, that is, is nearer than `GAP`; where
            one joint moves it, share of the joint's range.
        adjacent: pairs moved by one joint that touch over at least `ALWAYS` of its range.
        proved: pairs proved to stay farther apart than `GAP` over the joint box.
    """

    samples: int
    rates: Mapping[LinkPair, float]
    adjacent: frozenset[LinkPair]
    proved: frozenset[LinkPair]

    def often_touching(self, allowed: Collection[LinkPair]) -> list[LinkPair]:
        """Return the pairs not in `allowed` that touch in more than `OFTEN` of the samples, the most frequent first."""
        rates = {pair: rate for pair, rate in self.rates.items() if rate > OFTEN and pair not in allowed}
        return sorted(rates, key=lambda pair: (-rates[pair], pair))


def link_pairs(model: pin.Model, geometry: pin.GeometryModel) -> dict[LinkPair, list[tuple[int, int]]]:
    """Pairs of different links with the pairs of their bodies, by index; sorted by name."""
    links = [str(model.frames[item.parentFrame].name) for item in geometry.geometryObjects]
    found: dict[LinkPair, list[tuple[int, int]]] = {}
    for i, j in combinations(range(len(links)), 2):
        if links[i] != links[j]:
            found.setdefault(link_pair(links[i], links[j]), []).append((i, j))
    return dict(sorted(found.items()))


def survey_pairs(
    model: pin.Model,
    geometry: pin.GeometryModel,
    limits: tuple[Array, Array],
    among: Collection[LinkPair] | None = None,
) -> PairSurvey:
    """Find rates of collision, neighbours that always touch, and pairs that never meet; kept on disk.

    Args:
        model: reduced to the planned joints.
        geometry: its bodies.
        limits: lower and upper limits of position, (n,), infinite for joints without end.
        among: pairs of links to survey; None: all.
    """
    key = content_digest(model, geometry, limits, VERSION)
    if among is not None:
        key = cache.digest([key.encode(), json.dumps(sorted(among)).encode()])
    name = f"pairs/{key}.json"

    def make() -> bytes:
        log.info("looking how often links touch, and which never do, once")
        return _write(_Survey(model, geometry, limits, among).make())

    return _read(cache.kept(name, make))


class _Survey:
    """One survey: bodies of pairs that joints move, and the proof that places and measures them."""

    def __init__(
        self,
        model: pin.Model,
        geometry: pin.GeometryModel,
        limits: tuple[Array, Array],
        among: Collection[LinkPair] | None,
    ) -> None:
        parents = [int(item.parentJoint) for item in geometry.geometryObjects]
        self.bodies = {
            links: moved
            for links, found in link_pairs(model, geometry).items()
            if (among is None or links in among) and (moved := [(i, j) for i, j in found if parents[i] != parents[j]])
        }
        pairs = np.array([pair for found in self.bodies.values() for pair in found], dtype=np.intp).reshape(-1, 2)
        ends = np.cumsum([len(found) for found in self.bodies.values()], dtype=np.intp)
        self.groups: list[Index] = np.split(np.arange(len(pairs)), ends[:-1]) if len(ends) else []
        self.proof = PairProof(model, geometry, pairs, limits)

    def make(self) -> PairSurvey:
        links = list(self.bodies)
        if not links:
            return PairSurvey(0, {}, frozenset(), frozenset())
        count = min(SAMPLES, max(100, WORK // len(self.proof.moves)))
        middle, half = self.proof.middle, np.where(np.isfinite(self.proof.half), self.proof.half, 1.0)
        rng = np.random.default_rng(0)
        share = self.shares()
        # Of a pair that one joint moves its share is the rate: neighbours a hair apart are asked at few angles only.
        sampled = np.flatnonzero(np.isnan(share))
        rates = np.where(np.isnan(share), 0.0, share)
        Q = middle + half * rng.uniform(-1.0, 1.0, (count, len(middle)))
        rates[sampled] = self.touching(Q, sampled).mean(axis=0)
        adjacent = share >= ALWAYS
        open_pairs = np.flatnonzero(~adjacent & (rates == 0.0) & ~(share > 0.0))
        proved = self.proof.prove([self.groups[k] for k in open_pairs])
        return PairSurvey(
            count,
            {pair: float(rate) for pair, rate in zip(links, rates, strict=True)},
            frozenset(pair for pair, always in zip(links, adjacent, strict=True) if always),
            frozenset(links[k] for k, apart in zip(open_pairs, proved, strict=True) if apart),
        )

    def touching(self, Q: Array, chosen: Index) -> Flags:
        """Whether each of the `chosen` pairs of links (K,) is nearer than `GAP` at configurations Q (N, n): (N, K)."""
        result = np.zeros((len(Q), len(chosen)), dtype=bool)
        group = np.full(len(self.proof.moves), -1)
        for place, k in enumerate(chosen.tolist()):
            group[self.groups[k]] = place
        step = max(1, _ROWS // max(len(group), 1))
        for k in range(0, len(Q), step):
            rows, pairs, placed = self.proof.bounds.meeting(Q[k : k + step], GAP)
            asked = group[pairs] >= 0
            rows, pairs, placed = rows[asked], pairs[asked], placed[asked]
            touch = self.proof.touching(placed, pairs)
            result[k + rows[touch], group[pairs[touch]]] = True
        return result

    def shares(self) -> Array:
        """Share of the range of the one joint that moves a pair of links over which it touches; NaN for others.

        All joints go through their ranges at the same time, as each pair heeds its own alone.
        """
        moves = np.array([self.proof.moves[members].any(axis=0) for members in self.groups])
        single = np.flatnonzero(moves.sum(axis=1) == 1)
        finite = np.isfinite(self.proof.half)
        places = (2.0 * np.arange(ANGLES) + 1.0) / ANGLES - 1.0
        Q = self.proof.middle + np.where(finite, self.proof.half, 0.0) * places[:, None]
        result = np.full(len(self.groups), np.nan)
        single = single[finite[moves[single].argmax(axis=1)]]
        owner = np.repeat(single, [len(self.groups[k]) for k in single])
        pairs = np.concatenate([np.empty(0, dtype=np.intp), *(self.groups[k] for k in single)])
        touching = np.zeros((ANGLES, len(self.groups)), dtype=bool)
        step = max(1, _ROWS // max(len(pairs), 1))
        for k in range(0, ANGLES, step):
            rows, columns = np.divmod(np.arange(min(step, ANGLES - k) * len(pairs)), max(len(pairs), 1))
            touch = self.proof.touching_at(Q[k : k + step], rows, pairs[columns])
            touching[k + rows[touch], owner[columns[touch]]] = True
        result[single] = touching[:, single].mean(axis=0)
        return result


def content_digest(model: pin.Model, geometry: pin.GeometryModel, limits: tuple[Array, Array], version: int) -> str:
    """Hash of joints, bodies and limits, and of the version of what is made of them."""
    bodies = [
        f"{model.frames[item.parentFrame].name} {item.parentJoint} {type(item.geometry).__name__}"
        for item in geometry.geometryObjects
    ]
    numbers = [*(item.placement.homogeneous for item in geometry.geometryObjects), *limits]
    if geometry not in _shapes:
        _shapes[geometry] = _digest(array for item in geometry.geometryObjects for array in _numbers(item.geometry))
    text = json.dumps([version, model.saveToString(), bodies, _shapes[geometry]])
    return cache.digest([text.encode(), _digest(numbers).encode()])


_shapes: WeakKeyDictionary[pin.GeometryModel, str] = WeakKeyDictionary()
"""Hash of the numbers of all shapes, which no one changes: to read the triangles of a mesh takes milliseconds."""


def _digest(numbers: Iterable[npt.NDArray[Any]]) -> str:
    return cache.digest(np.ascontiguousarray(array).tobytes() for array in numbers)


def _numbers(shape: coal.CollisionGeometry) -> Sequence[npt.NDArray[Any]]:
    """Return the numbers that identify a shape of its kind: vertices and triangles, or its bounding box."""
    if isinstance(shape, coal.BVHModelBase):
        return [mesh_vertices(shape), mesh_triangles(shape)]
    if isinstance(shape, coal.ConvexBase):
        return [np.array(shape.points())]
    shape.computeLocalAABB()
    return [np.array(shape.aabb_local.min_), np.array(shape.aabb_local.max_)]


def _write(survey: PairSurvey) -> bytes:
    rows = [
        [*pair, rate, "adjacent" if pair in survey.adjacent else "proved" if pair in survey.proved else ""]
        for pair, rate in survey.rates.items()
    ]
    return json.dumps({"samples": survey.samples, "pairs": rows}).encode()


def _read(content: bytes) -> PairSurvey:
    data = json.loads(content)
    pairs = [((a, b), rate, reason) for a, b, rate, reason in data["pairs"]]
    return PairSurvey(
        data["samples"],
        {pair: rate for pair, rate, _ in pairs},
        frozenset(pair for pair, _, reason in pairs if reason == "adjacent"),
        frozenset(pair for pair, _, reason in pairs if reason == "proved"),
    )
