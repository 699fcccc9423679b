"""Bound the approach of two bodies in a short interval by their velocities and accelerations."""

from copy import copy
from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array, Flags, Index
from optiplan.records import dataclass
from optiplan.verify.continuous.bodies import Bodies, PlacedBody


class Boxes(NamedTuple):
    """Bounds of joint motions on N intervals of half width `half` (N,), s, about their middles; the rest is (N, n).

    Attributes:
        q: configuration at the middle; `v`: velocity there.
        reach: bound on |q_j(t) - q_j(middle)|; `speed`, `acceleration`: bounds on |q_j'|, |q_j''| over the interval.
        jump: how far a joint may be off its motion: a tolerated step of position at the ends, or the tracking error.
            Contained in `reach` and in no derivative.
    """

    half: Array
    q: Array
    v: Array
    reach: Array
    speed: Array
    acceleration: Array
    jump: Array


class MotionQuery(NamedTuple):
    """K queries: pair pairs[k] on interval rows[k], where `placed` has its bodies.

    `direction` and `point`, both (N, J, 3), are all joints' axes in the world at the middles of all N intervals.
    """

    rows: Index
    pairs: Index
    placed: PlacedBody
    direction: Array
    point: Array


class Travel(NamedTuple):
    """How far the bodies of K pairs can move against each other on their intervals.

    Of a pair's two sides only those are looked at that some joint moves against the other: M of all.

    Attributes:
        total: (K,) bound on the change of distance, whatever the direction, m.
        item: (M,) of which of the K pairs a side is; `side` (M,): 0 for body a, 1 for b.
        lever: (J, M) the farthest that a point of the body gets from each joint's axis, m; 1 where a joint slides.
        middle: (J, M) the same in the middle.
    """

    total: Array
    item: Index
    side: Index
    lever: Array
    middle: Array


class GapMotion(NamedTuple):
    """Bounds for C pairs on their intervals, (C,) each, m.

    Attributes:
        linear: lower bound of the gap along the normal, were every point to keep its velocity of the middle.
        loss: how far acceleration, and joints off their motion, can take the gap below that.
        gap: the gap along the normal in the middle; less than the distance where bodies are not convex.
        step: how far joints off their motion alone can take it below that there; no shorter interval has less.
        any_way: how far they can move the bodies against each other there, whatever the direction.
    """

    linear: Array
    loss: Array
    gap: Array
    step: Array
    any_way: Array


class Motion:
    """Bounds on the relative motion of the pairs of bodies; joints that carry both bodies of a pair do not count.

    Arrays of vectors and of joints have these axes first, (3, J, M), and pairs, which are many, last.
    """

    def __init__(self, bodies: Bodies) -> None:
        self._bodies = bodies
        self._slides = np.flatnonzero(bodies.kinematics.revolute < 0.5)
        self._moved: Flags = np.array(bodies.moves.any(axis=2)).T.copy()  # (2, P)
        self._moves = bodies.moves.transpose(2, 1, 0).astype(float)  # (J, 2, P), 1 or 0
        self._moves = self._moves.reshape(len(self._moves), -1)

    def with_obstacles_of(self, bodies: Bodies) -> "Motion":
        """Return the same of bodies of which obstacles stand elsewhere."""
        twin = copy(self)
        twin._bodies = bodies
        return twin

    def of_all_joints(self, boxes: Boxes) -> Boxes:
        """Return the bounds of all J joints: a follower moves by its multiplier times what its leader does.

        `q` stays that of the planned joints.
        """
        kinematics = self._bodies.kinematics
        if not kinematics.follows:
            return boxes
        bounds = (boxes.reach, boxes.speed, boxes.acceleration, boxes.jump)
        reach, speed, acceleration, jump = map(kinematics.joint_reach, bounds)
        return Boxes(boxes.half, boxes.q, kinematics.joint_rates(boxes.v), reach, speed, acceleration, jump)

    def travel(self, boxes: Boxes, query: MotionQuery) -> Travel:
        """Bound how far the bodies of K pairs can move against each other; `boxes` are those of all joints.

        Joints are moved one after another, from the tip to the base. When joint j turns, about its axis at the middle,
        the body has travelled t already: its points are within R_j + t of the axis and move by at most D_j (R_j + t).
        """
        side, item = np.nonzero(self._moved[:, query.pairs])
        rows, bodies = query.rows[item], query.placed.bodies[item, side]
        step = _at(boxes.reach, rows) * self._moving(query, item, side)
        centre = self._bodies.centres(bodies, query.placed.poses[item, side]).T.copy()
        arm = _cross(_at(query.direction, rows), centre[:, None] - _at(query.point, rows))
        lever = np.sqrt(np.einsum("ijm,ijm->jm", arm, arm))
        lever += self._bodies.radius[bodies]
        slides = self._slides.tolist()
        lever[slides] = 1.0
        middle = lever.copy()
        travelled = np.zeros(len(item))
        for j in reversed(range(len(lever))):
            if j not in slides:
                lever[j] += travelled
            travelled += step[j] * lever[j]
        return Travel(_sums(item, travelled, len(query.pairs)), item, side, lever, middle)

    def along_normals(
        self, boxes: Boxes, query: MotionQuery, travel: Travel, normals: Array, chosen: Index
    ) -> GapMotion:
        """Bounds for C of the K pairs, at the positions `chosen`, with unit normals w (K, 3) from a to b at the middle.

        For a point x of a body let f(s) = w . x(middle + s). Then |f(s) - f(0) - f'(0) s| <= F s^2 / 2 with
            F = sum_j A_j L_j + sum_k L_k V_k (V_k + 2 sum_{j<k} V_j) >= |x''|,
        where V and A bound the joints' speed and acceleration and L_j the distance of x from axis j (1 for a prismatic
        joint), because the second partial derivative of x in q_j and q_k is no longer than L of the joint nearer to the
        tip. With Omega, u the body's twist at the middle, f(0) + f'(0) s = x . (w + s w x Omega) + s w . u, whose
        maximum over the body is a support function, convex in s: so its maximum for |s| <= h is at s = h or -h.
        """
        place = np.full(len(query.pairs), -1)
        place[chosen] = np.arange(len(chosen))
        kept = (place[travel.item] >= 0).nonzero()[0]
        item, side, lever = travel.item[kept], travel.side[kept], travel.lever[:, kept]
        rows, at = query.rows[item], place[item]
        moves, half = self._moving(query, item, side), boxes.half[rows]
        speed, acceleration = _at(boxes.speed, rows) * moves, _at(boxes.acceleration, rows) * moves
        before = np.cumsum(speed, axis=0) - speed
        loss = 0.5 * half**2 * np.einsum("jm,jm->m", lever, acceleration + speed * (speed + 2.0 * before))
        w = normals[item].T * (1.0 - 2.0 * side)  # out of either body
        off = _Off(_at(boxes.jump, rows) * moves, lever, travel.middle[:, kept], w)
        step, any_way = self._off_along(off, query, item, side)
        loss += step + off.cross_terms((_at(boxes.reach, rows) - _at(boxes.jump, rows)) * moves)
        omega, u = self._twist(_at(boxes.v, rows) * moves, _at(query.direction, rows), _at(query.point, rows))
        turn, shift = half * _cross(w, omega), half * np.einsum("im,im->m", w, u)
        still = np.ones((2, len(chosen)), dtype=bool)
        still[side, at] = False
        other, fixed = np.nonzero(still)
        asked = np.concatenate([item, item, chosen[fixed]]), np.concatenate([side, side, other])
        outward = normals[chosen[fixed]] * (1.0 - 2.0 * other)[:, None]
        bodies, poses = query.placed.bodies[asked], query.placed.poses[asked]
        height = self._bodies.support(bodies, poses, np.concatenate([(w + turn).T, (w - turn).T, outward]))
        count = len(item)
        after, before, standing = height[:count], height[count : 2 * count], height[2 * count :]
        moved = np.maximum(*(_sums(at, end, len(chosen)) for end in (after + shift, before - shift)))
        linear = -(moved + _sums(fixed, standing, len(chosen)))
        linear[np.isnan(linear)] = -np.inf
        gap = linear
        if off.large:
            own = self._bodies.support(bodies[:count], poses[:count], w.T)
            gap = -(_sums(at, own, len(chosen)) + _sums(fixed, standing, len(chosen)))
        loss, step, any_way = (_sums(at, part, len(chosen)) for part in (loss, step, any_way))
        return GapMotion(linear, loss, gap, step, any_way)

    def _off_along(self, off: "_Off", query: MotionQuery, item: Index, side: Index) -> tuple[Array, Array]:
        """Bound how far bodies get along w (3, M), and in any direction, while joints are off by up to e (J, M): (M,).

        Joints are moved one after another, from the tip to the base. A joint with axis a through p that turns by
        delta <= e moves a point x, which the joints behind it have moved by u, along w by at most
            e |(w x a) . (x - p)| + e |w x a| |u| + e^2 / 2 L,
        with L the distance from the axis; over the points of a body the first term is a support function.
        """
        if not off.large:
            moved = np.asarray(np.einsum("jm,jm->m", off.lever, off.step))
            return moved, moved
        bodies, poses, rows = query.placed.bodies[item, side], query.placed.poses[item, side], query.rows[item]
        direction, point = _at(query.direction, rows), _at(query.point, rows)
        found, moved = np.zeros(len(item)), np.zeros(len(item))
        for j in reversed(range(len(off.step))):
            step, lever = off.step[j], off.middle[j]
            along = np.abs(np.einsum("im,im->m", off.w, direction[:, j]))
            if j not in self._slides:
                d = _cross(off.w, direction[:, j])
                level = np.einsum("im,im->m", d, point[:, j])
                ends = (self._bodies.support(bodies, poses, sign * d.T) - sign * level for sign in (1.0, -1.0))
                lever = lever + moved
                along = np.maximum(*ends) + np.linalg.norm(d, axis=0) * moved + 0.5 * step * lever
            found += step * np.minimum(along, lever)
            moved += step * lever
        return found, moved

    def _moving(self, query: MotionQuery, item: Index, side: Index) -> Array:
        """Which joints move sides of pairs: (J, M), 1 or 0."""
        return np.asarray(self._moves.take(side * self._moved.shape[1] + query.pairs[item], axis=1))

    def _twist(self, v: Array, direction: Array, point: Array) -> tuple[Array, Array]:
        """Angular velocity (3, M), rad/s, and velocity (3, M), m/s, of the body's point at the world's origin."""
        slide = v[self._slides]
        v[self._slides] = 0.0
        omega, u = (np.einsum("jm,ijm->im", v, part) for part in (direction, _cross(point, direction)))
        if len(slide):
            u += np.einsum("jm,ijm->im", slide, direction[:, self._slides])
        return omega, u


_LARGE = 1e-6
"""rad or m: joints that are less off their motion are bounded as if their bodies moved straight along the normal."""


@dataclass(frozen=True, eq=False)
class _Off:
    """How far joints are off their motion, `step` (J, M), with levers as of `Travel` (J, M), and normals w (3, M)."""

    step: Array
    lever: Array
    middle: Array
    w: Array

    @property
    def large(self) -> bool:
        return bool(self.step.max(initial=0.0) > _LARGE)

    def cross_terms(self, moved: Array) -> Array:
        """Bound by how much joints that have moved by up to `moved` (J, M) change what `step` does: (M,), m.

        sum_jk step_j moved_k L_max(j, k), see `Motion.along_normals`.
        """
        if not self.large:
            return np.zeros(self.step.shape[1])
        steps_before, moved_before = (np.cumsum(part, axis=0) - part for part in (self.step, moved))
        both = self.step * (moved + moved_before) + moved * steps_before
        return np.asarray(np.einsum("jm,jm->m", self.lever, both))


def _at(values: Array, rows: Index) -> Array:
    """Values (N, J) or (N, J, 3) of intervals `rows` (M,), with the axes turned round: (J, M) or (3, J, M)."""
    return np.asarray(values.T.take(rows, axis=-1))


def _sums(item: Index, values: Array, count: int) -> Array:
    """Sums of values (M,) of the same item: (count,)."""
    return np.asarray(np.bincount(item, values, count).astype(float))


def _cross(a: Array, b: Array) -> Array:
    """Vector products along the first axis."""
    result = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(a[j], b[k], out=result[i])
        result[i] -= a[k] * b[j]
    return result
