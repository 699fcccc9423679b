"""Prove that bodies never meet, whatever the joints do within their limits: interval halving over configurations."""

from collections.abc import Sequence
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Flags, Index
from optiplan.geometry.coal_queries import exact_collision_request, exact_distance_request
from optiplan.geometry.convex import hull_of_mesh
from optiplan.records import dataclass
from optiplan.robot.batched.kinematics import BatchKinematics
from optiplan.robot.self_collision.pair_bounds import PairBounds

GAP = 1e-4
"""Distance, m, beyond which bodies count as apart: a hundred times what coal's distances may be off by."""

BEYOND = 1e-4
"""rad or m by which the box proved passes the limits of position: more than the verifier lets a motion pass them."""

BOXES = 4000
"""Boxes of configurations checked for a pair of links before it is left unproved."""

ALONG = 20_000
"""Boxes for a pair that one joint moves: neighbours often pass each other at a fraction of a millimetre."""

OF_MESHES = 400
"""Boxes for a pair with a mesh, whose distance takes up to a hundred times as long."""

WORK = 2_000_000
"""Boxes for all pairs of a robot together, times its joints, so that a robot of a thousand pairs takes seconds too."""

CHUNK = 1024
"""Boxes handled at once, to bound memory."""

HOPELESS = 30.0
"""A pair is given up when its open boxes seem to need this many times the boxes allowed."""


@dataclass(frozen=True, eq=False)
class _Boxes:
    """K open boxes |q_j - middle_j| <= half_j, each for a pair of bodies: (K,), (K, n), (K, n)."""

    pair: Index
    middle: Array
    half: Array

    @classmethod
    def join(cls, parts: Sequence["_Boxes"]) -> "_Boxes":
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("pair", "middle", "half")))

    def take(self, chosen: Index | Flags | slice) -> "_Boxes":
        return _Boxes(self.pair[chosen], self.middle[chosen], self.half[chosen])

    def halved(self, joint: Index) -> "_Boxes":
        """Each box in two along its joint (K,)."""
        rows = np.arange(len(joint))
        half = self.half.copy()
        half[rows, joint] *= 0.5
        step = np.zeros_like(half)
        step[rows, joint] = half[rows, joint]
        middle = np.concatenate([self.middle - step, self.middle + step])
        return _Boxes(np.tile(self.pair, 2), middle, np.tile(half, (2, 1)))


class _OpenBoxes(NamedTuple):
    """K boxes that are not proved, the travel (K, n) by each joint, m, and the distance less `GAP` (K,), m."""

    boxes: _Boxes
    steps: Array
    margin: Array


def joint_box(revolute: Flags, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Middle and half width, (n,), of all configurations within limits; one turn where there are none or more.

    The half width of a sliding joint without limits is infinite.
    """
    whole = revolute & ~(upper - lower + 2.0 * BEYOND < 2.0 * np.pi)
    endless = ~revolute & ~np.isfinite(upper - lower)
    low, high = np.where(whole | endless, 0.0, lower), np.where(whole | endless, 0.0, upper)
    half = 0.5 * (high - low) + BEYOND
    return 0.5 * (low + high), np.where(whole, np.pi, np.where(endless, np.inf, half))


class PairProof:
    """Prove that pairs of links never meet.

    In a box with middle m and half widths D, the distance of two bodies is at least distance(m) - sum_j s_j. Here s_j
    bounds their relative motion by joint j: the smaller of `PairBounds.steps_of` and of the joint's stroke times the
    lengths of all links beyond it. A box with a bound above `GAP` is proved. The others are halved along the joint with
    the largest s_j, until none remains, two bodies are found nearer than `GAP`, or there are too many boxes.

    The distance to a mesh is positive inside, too. So with a mesh, the boxes of the two bodies must be apart at one
    configuration: a body outside there stays outside as long as the surfaces never meet.

    Holds at: every configuration within the limits, and `BEYOND` past them.

    Attributes:
        bounds: bounding volumes of the pairs of bodies.
        moves: (P, n) which planned joints, with their followers, move each pair of bodies.
        middle: (n,) of the joint box; `half` (n,): its half widths, infinite for a sliding joint without limits.
    """

    def __init__(
        self, model: pin.Model, geometry: pin.GeometryModel, pairs: Index, limits: tuple[Array, Array]
    ) -> None:
        """Prepare.

        Args:
            model: the robot.
            geometry: its bodies.
            pairs: (P, 2) bodies of each pair.
            limits: lower and upper, (n,), infinite for joints without end.
        """
        self.bounds = PairBounds(BatchKinematics(model), geometry, [(int(a), int(b)) for a, b in pairs])
        self.moves = self.bounds.depends
        follows = np.abs(self.bounds.kinematics.coupling) > 0.0  # (J, n)
        # What a follower does in one turn of its leader, or at half a turn, is another matter: no turns, no chords.
        alone = follows.sum(axis=0) == 1
        self._turns: Flags = alone & (self.bounds.kinematics.revolute @ follows > 0.5)
        self.middle, self.half = joint_box(self._turns, *limits)
        finite = np.where(np.isfinite(self.half), self.half, 0.0)
        self._arms = self.bounds.moment_arms(np.abs(self.middle) + finite)
        self._shapes = [item.geometry for item in geometry.geometryObjects]
        surface = np.array([isinstance(shape, coal.BVHModelBase) for shape in self._shapes], dtype=bool)
        self._hulls = [hull_of_mesh(s) if mesh else s for s, mesh in zip(self._shapes, surface, strict=True)]
        self._surface: Flags = np.asarray(surface[self.bounds.pairs].any(axis=1))
        self._most = WORK / max(len(self.middle), 1)
        self._request, self._near = exact_distance_request(), exact_collision_request()
        self._near.security_margin = GAP

    def prove(self, groups: Sequence[Index]) -> list[bool]:
        """Whether all pairs of bodies of each group (a pair of links) are proved never to come as near as `GAP`.

        A group that may have no more boxes is given up at its first open one, and its others are left out.
        """
        group = np.full(len(self.moves), -1)
        for index, members in enumerate(groups):
            group[members] = index
        pairs = np.flatnonzero(group >= 0)
        failed = self._hopeless(group, pairs, len(groups))
        spent = np.zeros(len(groups), dtype=np.intp)
        most = np.array([self._allowed(members) for members in groups])
        outside = ~self._surface
        pairs = pairs[~failed[group[pairs]]]
        half = np.where(self.moves[pairs], self.half, 0.0)
        boxes = _Boxes(pairs, np.broadcast_to(self.middle, half.shape), half)
        while len(boxes.pair):
            spent += np.bincount(group[boxes.pair], minlength=len(groups))
            last = (spent > most) | (spent.sum() > self._most)
            found = []
            for k in range(0, len(boxes.pair), CHUNK):
                part = boxes.take(slice(k, k + CHUNK))
                found.append(self._open(part.take(~failed[group[part.pair]]), outside))
                of = group[found[-1].boxes.pair]
                failed[of[last[of] | ~(found[-1].margin > 0.0)]] = True
            boxes = _Boxes.join([part.boxes for part in found])
            steps, margin = np.concatenate([part.steps for part in found]), np.concatenate([p.margin for p in found])
            of = group[boxes.pair]
            wanted = np.bincount(of, weights=_parts(steps, margin), minlength=len(groups))
            given_up: Flags = wanted > HOPELESS * most
            failed[of[given_up[of]]] = True
            left = ~failed[of]
            boxes = boxes.take(left).halved(steps[left].argmax(axis=1))
        failed[group[np.flatnonzero(~outside & (group >= 0))]] = True
        return [not fault for fault in failed.tolist()]

    def _allowed(self, members: Index) -> int:
        if self._surface[members].any():
            return OF_MESHES
        return ALONG if self.moves[members].any(axis=0).sum() == 1 else BOXES

    def touching_at(self, Q: Array, rows: Index, pairs: Index) -> Flags:
        """Return whether each of K pairs of bodies, pairs[k] at Q[rows[k]], Q (N, n), is as near as `GAP`: (K,)."""
        poses, bodies = self.bounds.kinematics.poses(Q), self.bounds.pairs[pairs]
        placed = poses[rows[:, None], self.bounds.joint[bodies]] @ self.bounds.placement[bodies]
        result = np.zeros(len(rows), dtype=bool)
        near = np.flatnonzero(self.bounds.distances_of(placed, pairs) <= 2.0 * GAP)
        result[near] = self.touching(placed[near], pairs[near])
        return result

    def touching(self, placed: Array, pairs: Index) -> Flags:
        """Return whether each of K pairs of bodies, placed at (K, 2, 4, 4), world, is as near as `GAP`: (K,).

        Of meshes it is asked whether triangles are: that ends at the first, and takes a part of the time of a distance.
        """
        found = np.zeros(len(pairs), dtype=bool)
        asked = np.flatnonzero(self._surface[pairs])
        others = np.flatnonzero(~self._surface[pairs])
        found[others] = self.distances(placed[others], pairs[others], np.full(len(others), GAP)) <= GAP
        result = coal.CollisionResult()
        for k in asked.tolist():
            a, b = self.bounds.pairs[pairs[k]].tolist()
            X_a, X_b = (coal.Transform3s(X[:3, :3], X[:3, 3]) for X in placed[k])
            for shapes in (self._hulls, self._shapes):
                result.clear()
                found[k] = coal.collide(shapes[a], X_a, shapes[b], X_b, self._near, result) > 0
                if not found[k]:
                    break
        return found

    def distances(self, placed: Array, pairs: Index, enough: Array) -> Array:
        """Distance, m, of K pairs of bodies placed at (K, 2, 4, 4), world; negative inside.

        Above `enough` (K,), m, the result may be a lower bound above `enough`: the distance of the meshes' hulls, which
        takes a twentieth of the time.
        """
        result, X_a, X_b = coal.DistanceResult(), coal.Transform3s(), coal.Transform3s()
        (R_a, R_b), (t_a, t_b) = (np.moveaxis(part, 1, 0) for part in (placed[..., :3, :3], placed[..., :3, 3]))
        found, surface, bodies = np.empty(len(pairs)), self._surface[pairs].tolist(), self.bounds.pairs[pairs].tolist()
        for k, ((a, b), *poses) in enumerate(zip(bodies, R_a, t_a, R_b, t_b, strict=True)):
            X_a.setTransform(*poses[:2])
            X_b.setTransform(*poses[2:])
            for shapes in (self._hulls, self._shapes) if surface[k] else (self._shapes,):
                result.clear()
                found[k] = coal.distance(shapes[a], X_a, shapes[b], X_b, self._request, result)
                if found[k] > enough[k] + GAP:
                    break
        return found

    def _hopeless(self, group: Index, pairs: Index, count: int) -> Flags:
        """Groups whose joints move too much for the boxes allowed even if they stood as far apart as they can."""
        failed = np.zeros(count, dtype=bool)
        steps = self._stroke(np.where(self.moves[pairs], self.half, 0.0)) * self._arms[pairs]
        fair = min(BOXES, self._most / max(count, 1))
        failed[group[pairs[_parts(steps, self.bounds.reach_of(self.middle, pairs)) > HOPELESS * fair]]] = True
        return failed

    def _open(self, boxes: _Boxes, outside: Flags) -> _OpenBoxes:
        """Return the boxes that are not proved; note in `outside` (P,) the pairs whose boxes are apart."""
        poses, placed = self.bounds.place(boxes.middle, boxes.pair)
        steps = self.bounds.steps_of(poses, placed, boxes.half, boxes.pair)
        coarse = self._stroke(boxes.half) * self._arms[boxes.pair]
        steps = np.where((steps.sum(axis=1) < coarse.sum(axis=1))[:, None], steps, coarse)
        travel, apart = steps.sum(axis=1), self.bounds.distances_of(placed, boxes.pair)
        outside[boxes.pair[apart > 0.0]] = True
        left = np.flatnonzero(~(apart - travel > GAP))
        margin = self.distances(placed[left], boxes.pair[left], travel[left] + GAP) - GAP
        still = ~(margin > travel[left])
        return _OpenBoxes(boxes.take(left[still]), steps[left[still]], margin[still])

    def _stroke(self, half: Array) -> Array:
        """Bound how far each joint moves a point 1 m from its axis, half (K, n): the chord, or the way it slides.

        A joint with followers counts as far as it turns.
        """
        return np.where(self._turns, 2.0 * np.sin(0.5 * np.minimum(half, np.pi)), half)


def _parts(steps: Array, margin: Array) -> Array:
    """How many parts a box seems to need: each of k joints may take up room / k of what its steps (K, n) add up to."""
    moving = (steps > 0.0).sum(axis=1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.asarray(np.fmax(moving * steps / margin[:, None], 1.0).prod(axis=1))
