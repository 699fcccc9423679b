"""Which pairs of links need no self-collision check: those that are joined, always touch, or cannot reach each other.

Sampling as MoveIt's set-up assistant does it, made more careful: a pair counts as never touching only if, after a local
search from its nearest samples, its distance still exceeds `MARGIN`.
"""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.model import gjk as _primed  # noqa: F401  # before the first query of the process
from optiplan.model.srdf import LinkPair, link_pair

MARGIN = 0.01
"""Distance in m that a pair must keep in all samples to count as never touching."""

REACH = 0.1
"""Pairs nearer than this (m) in some sample are searched for a nearer place."""

FIRST, SAMPLES = 200, 5000
"""Samples that sort out the pairs which touch now and then, and samples for the rest."""

STARTS, STEPS = 4, 60
"""Samples that the local search starts from, and its steps."""


@dataclass(frozen=True)
class Kinematics:
    """What pairs are generated from: reduced model, its geometry, links joined to each other, position limits (n,)."""

    model: pin.Model
    geometry: pin.GeometryModel
    joined: frozenset[LinkPair]
    lower: Array
    upper: Array


def rigid_pairs(model: pin.Model, geometry: pin.GeometryModel) -> dict[LinkPair, str]:
    """Pairs of links with no planned joint between them: they never move against each other."""
    pairs = {
        _links(model, a, b) for a, b in combinations(geometry.geometryObjects, 2) if a.parentJoint == b.parentJoint
    }
    return {pair: "Rigid" for pair in sorted(pairs) if pair[0] != pair[1]}


def set_pairs(model: pin.Model, geometry: pin.GeometryModel, allowed: Container[LinkPair]) -> None:
    """Make the collision pairs of `geometry` all those of different links that are not in `allowed`."""
    geometry.removeAllCollisionPairs()
    objects = geometry.geometryObjects
    for i, j in combinations(range(len(objects)), 2):
        links = _links(model, objects[i], objects[j])
        if links[0] != links[1] and links not in allowed:
            geometry.addCollisionPair(pin.CollisionPair(i, j))


def generate_allowed(robot: Kinematics, default: Array, rng: np.random.Generator) -> dict[LinkPair, str]:
    """Pairs that need no check, with MoveIt's word for the reason.

    Adjacent: joined by one joint. Default: touch in the `default` configuration, which is known to be free.
    Always: touch in all samples. Never: farther apart than `MARGIN` in all samples and after the local search.
    Each reason is looked for only where those before it do not hold. The geometry's collision pairs are set anew.

    Args:
        robot: what is sampled.
        default: a configuration of shape (n,) that the robot is known to be able to take.
        rng: source of the samples; the same generator state gives the same answer.
    """
    allowed = rigid_pairs(robot.model, robot.geometry)
    links = {_links(robot.model, a, b) for a, b in combinations(robot.geometry.geometryObjects, 2)}
    allowed |= {pair: "Adjacent" for pair in sorted(links & robot.joined) if pair not in allowed}
    touching = _Distances(robot, allowed)
    allowed |= {pair: "Default" for pair, near in zip(touching.links, touching(default), strict=True) if near <= 0}
    return allowed | _sampled(robot, allowed, rng)


def _links(model: pin.Model, a: pin.GeometryObject, b: pin.GeometryObject) -> LinkPair:
    return link_pair(model.frames[a.parentFrame].name, model.frames[b.parentFrame].name)


class _Distances:
    """Distances of the pairs of links that are not in `allowed`."""

    def __init__(self, robot: Kinematics, allowed: Container[LinkPair]) -> None:
        set_pairs(robot.model, robot.geometry, allowed)
        self.robot = robot
        self.data, self.results = robot.model.createData(), robot.geometry.createData()
        objects, pairs = robot.geometry.geometryObjects, robot.geometry.collisionPairs
        named = [_links(robot.model, objects[pair.first], objects[pair.second]) for pair in pairs]
        self.links = sorted(set(named))
        place = {links: column for column, links in enumerate(self.links)}
        self.columns = np.array([place[links] for links in named], dtype=int)

    def __call__(self, q: Array) -> Array:
        """Distance (m) of each of `links` at q (n,), the least over the links' pieces; shape (pairs of links,)."""
        pin.computeDistances(self.robot.model, self.data, self.robot.geometry, self.results, q)
        least = np.full(len(self.links), np.inf)
        np.minimum.at(least, self.columns, [result.min_distance for result in self.results.distanceResults])
        return least

    def of(self, column: int, q: Array) -> float:
        """Distance (m) of one pair of links at q."""
        pin.updateGeometryPlacements(self.robot.model, self.data, self.robot.geometry, self.results, q)
        pieces = np.flatnonzero(self.columns == column)
        return float(min(pin.computeDistance(self.robot.geometry, self.results, int(i)).min_distance for i in pieces))


def _sampled(robot: Kinematics, allowed: Mapping[LinkPair, str], rng: np.random.Generator) -> dict[LinkPair, str]:
    """Reasons Always and Never of the pairs of links that are not in `allowed`."""
    lower, upper = _ranges(robot)
    first = rng.uniform(lower, upper, (FIRST, len(lower)))
    distances = _over(_Distances(robot, allowed), first)
    always = {links for links, column in distances.items() if (column <= 0).all()}
    sometimes = {links for links, column in distances.items() if (column <= 0).any()} - always
    rest = _Distances(robot, {*allowed, *sometimes})
    if not rest.links:
        return {}
    count = min(SAMPLES, max(FIRST, 500_000 // len(rest.columns)))  # keeps robots of a thousand pairs in seconds
    samples = rng.uniform(lower, upper, (count, len(lower)))
    distances = _over(rest, samples)
    reasons = {links: "Always" for links in rest.links if links in always and (distances[links] <= 0).all()}
    for column, links in enumerate(rest.links):
        least = float(distances[links].min())
        if MARGIN < least < REACH:
            starts = samples[np.argsort(distances[links])[:STARTS]]
            least = min(_descend(rest, column, q, rng) for q in starts)
        if least > MARGIN:
            reasons[links] = "Never"
    return reasons


def _over(measure: _Distances, samples: Array) -> dict[LinkPair, Array]:
    table = np.array([measure(q) for q in samples])
    return {links: table[:, column] for column, links in enumerate(measure.links)}


def _ranges(robot: Kinematics) -> tuple[Array, Array]:
    """Intervals to sample, each of shape (n,): a joint without end turns once around."""
    lower = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
    return lower, np.where(np.isfinite(robot.upper), robot.upper, np.pi)


def _descend(measure: _Distances, column: int, start: Array, rng: np.random.Generator) -> float:
    """Smallest distance (m) of one pair of links that random steps of shrinking length find, from one configuration."""
    lower, upper = _ranges(measure.robot)
    q, best, step = start, measure.of(column, start), 0.3
    for _ in range(STEPS):
        trial = np.clip(q + step * rng.standard_normal(len(q)), lower, upper)
        distance = measure.of(column, trial)
        if distance < best:
            q, best = trial, distance
        else:
            step *= 0.93
        if best <= MARGIN:
            break
    return best


def joined_links(edges: Sequence[tuple[str, str]], solid: frozenset[str]) -> frozenset[LinkPair]:
    """Pairs of links with geometry that one joint joins, or a chain of joints over links without geometry.

    Args:
        edges: (parent link, child link) of every joint.
        solid: links with collision geometry.
    """
    neighbours: dict[str, set[str]] = {}
    for a, b in edges:
        neighbours.setdefault(a, set()).add(b)
        neighbours.setdefault(b, set()).add(a)
    pairs = set()
    for start in solid:
        seen, stack = {start}, [start]
        while stack:
            for link in neighbours.get(stack.pop(), set()) - seen:
                seen.add(link)
                if link in solid:
                    pairs.add(link_pair(start, link))
                else:
                    stack.append(link)
    return frozenset(pairs)
