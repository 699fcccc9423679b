"""Continuous collision checking of curves for planners; only `optiplan.verify` calls a motion *verified*.

An interval of the curve is free for a pair when the distance at its middle exceeds a bound on the pair's travel to both
ends. Otherwise the interval is subdivided into as many parts as the ratio of the two requires.
"""

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array, Index, parts_of
from optiplan.collision.contacts import Contact
from optiplan.collision.model import CollisionModel
from optiplan.collision.native_model import NativeCollisionModel
from optiplan.geometry.coal_queries import DISTANCE_ERROR
from optiplan.libraries import clock
from optiplan.planners.common.failures import contact_witness
from optiplan.trajectory.joining import with_obstacles
from optiplan.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from optiplan._core._core_base import World

_MARGIN = 2 * DISTANCE_ERROR  # m; subtracted from every distance
_MOST_CUTS = 12  # parts of an interval that is subdivided
_FIRST_STEP = 0.1  # rad or m, summed over joints: length of the initial intervals
_RESOLUTION = 1e-6  # s: smaller intervals are not subdivided
_CHUNK = 256  # intervals proved together: bounds the memory
_LOOK = 24  # intervals checked together: few, so that the first contact is found soon
_POLLED = 0.01  # s: where intervals take longer, fewer are done before `stop` is asked again


class Touch(NamedTuple):
    """Contact along a curve: the parameter `t` (s, or fraction of a path), the configuration and the bodies."""

    t: float
    q: Array
    contact: Contact

    @property
    def words(self) -> str:
        """Which bodies touch, or come nearer than asked."""
        return self.contact.meeting

    def witness(self, motion: Trajectory | None = None) -> dict[str, Any]:
        """Return the contact as a JSON-ready `Failure.witness`, with the `motion` that touches if it is given."""
        moving = {} if motion is None else {"motion": motion.to_dict()}
        return {"t": self.t, **contact_witness(self.q, self.contact), **moving}


def first_contact(
    model: CollisionModel, trajectory: Trajectory, stop: Callable[[], bool] = lambda: False
) -> Touch | None:
    """Return the earliest contact found along a trajectory, or None: free at all times; see `contacts_along`."""
    return next(contacts_along(model, trajectory, stop), None)


def contacts_along(
    model: CollisionModel, trajectory: Trajectory, stop: Callable[[], bool] = lambda: False
) -> Iterator[Touch]:
    """Return contacts along a trajectory, one for each stretch of time in contact; empty: it is free.

    Holds at: everywhere; an empty list is a proof up to coal's tolerance. An interval below 1e-6 s that is neither
    proved free nor found in contact counts as a contact. So does any remaining interval when `stop` returns True:
    callers check their budget before they rely on a contact.
    """
    for touch in _contacts(model, with_obstacles(trajectory, model.motions), stop):
        yield touch._replace(q=touch.q[: trajectory.n])


def _contacts(model: CollisionModel, trajectory: Trajectory, stop: Callable[[], bool]) -> Iterator[Touch]:
    """Yield contacts of a motion whose columns include those of dynamic obstacles."""
    if isinstance(model, NativeCollisionModel) and model.world is not None:
        yield from _natively(model, model.world, trajectory, stop)
        return
    edges = trajectory.breakpoints
    _, D = motion_about(trajectory, 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges))
    middle, half = _subdivide(edges, np.ceil(2.0 * D.sum(axis=1) / _FIRST_STEP))
    seen = before = False
    Q, _ = motion_about(trajectory, middle, half)
    for t, q in zip(middle, Q, strict=True):  # ten times cheaper than a proof: refuse early
        stopped = stop()
        touching = stopped or model.collides(q)
        contact = model.clearance(q) if touching and not before else None
        if contact is not None and (stopped or contact.distance <= 0.0):
            seen = True
            yield Touch(float(t), q, contact)
            if stopped:
                return
        before = touching
    if seen:
        return
    for k in range(0, len(middle), _CHUNK):
        part = slice(k, k + _CHUNK)
        touch = _prove(model, trajectory, (middle[part], half[part]), stop)
        if touch is not None:
            yield touch


def _natively(
    model: CollisionModel, world: "World", trajectory: Trajectory, stop: Callable[[], bool]
) -> Iterator[Touch]:
    """Do the same in the native core; `stop` is polled every few intervals, which changes no answer."""
    rules = np.array([_FIRST_STEP, _MARGIN, _RESOLUTION, _MOST_CUTS])
    edges, coefficients = trajectory.breakpoints, np.ascontiguousarray(trajectory.coefficients)
    sweep = core.Sweep(world, np.ascontiguousarray(edges), coefficients, rules)
    count, seen = sweep.intervals, False
    for look, most in ((sweep.look, _LOOK), (sweep.prove, _CHUNK)):
        begin, step = 0, 1
        while begin < count:
            if stop():
                yield from _touches(model, trajectory, float(edges[0]), None, stopped=True)
                return
            began, end = clock(), min(begin + step, count)
            for found in look(begin, end):
                t, pair = found if isinstance(found, tuple) else (found, None)
                for touch in _touches(model, trajectory, t, pair):
                    seen = True
                    yield touch
            begin, step = end, min(2 * step, most) if clock() - began < _POLLED else 1
        if seen:
            return


def _touches(
    model: CollisionModel, trajectory: Trajectory, t: float, pair: int | None, stopped: bool = False
) -> Iterator[Touch]:
    """Yield the contact of a pair at t, or of the nearest one if it touches or the work was `stopped`."""
    q = motion_about(trajectory, np.array([t]), np.zeros(1))[0][0]
    contact = model.clearance(q) if pair is None else model.distance(q, pair)
    if contact is not None and (stopped or pair is not None or contact.distance <= 0.0):
        yield Touch(t, q, contact)


def motion_about(trajectory: Trajectory, middle: Array, half: Array) -> tuple[Array, Array]:
    """Return configurations Q (N, n) at times `middle` (N,), and bounds D (N, n) on motion away from them.

    The intervals, of half widths `half` (N,), are each within one piece: D = sum_k |c_k| h^k about the middle.
    """
    piece = np.searchsorted(trajectory.breakpoints[1:-1], middle, side="right")
    c = trajectory.coefficients[piece].copy()  # (N, degree + 1, n)
    local = (middle - trajectory.breakpoints[piece])[:, None]
    degree = c.shape[1] - 1
    for low in range(degree):  # Taylor shift by repeated Horner steps
        for k in range(degree - 1, low - 1, -1):
            c[:, k] += local * c[:, k + 1]
    powers = half[:, None] ** np.arange(1, degree + 1)
    return c[:, 0], np.einsum("nk,nkj->nj", powers, np.abs(c[:, 1:]))


def _prove(
    model: CollisionModel, trajectory: Trajectory, intervals: tuple[Array, Array], stop: Callable[[], bool]
) -> Touch | None:
    """Subdivide intervals (middles (N,), half widths (N,)) until each is proved free, one touches or is too small."""
    middle, half = intervals
    Q, D = motion_about(trajectory, middle, half)
    bounds, travel = model.lower_bounds(Q), model.travel(Q, D)
    rows, pairs = np.nonzero(bounds <= travel)
    travel = travel[rows, pairs]
    while len(rows):
        gap, worst = _gaps(model, Q, rows, pairs, stop)
        if worst is not None:
            return Touch(float(middle[worst[0]]), Q[worst[0]], worst[1])
        left = gap <= travel
        if not left.any():
            return None
        rows, pairs, ratio = rows[left], pairs[left], travel[left] / gap[left]
        too_small = half[rows] < _RESOLUTION
        if too_small.any():
            row, pair = int(rows[too_small][0]), int(pairs[too_small][0])
            return Touch(float(middle[row]), Q[row], model.distance(Q[row], pair))
        middle, half, rows, pairs = _cut(middle, half, rows, pairs, ratio)
        Q, D = motion_about(trajectory, middle, half)
        travel = model.bounds.travel_of(Q, D, rows, pairs)
    return None


def _subdivide(edges: Array, parts: Array) -> tuple[Array, Array]:
    """Return middles and half widths of the intervals between `edges` (m + 1,), each in `parts` (m,) equal parts."""
    count = np.maximum(parts, 1).astype(int)
    piece, place = parts_of(count)
    half = (np.diff(edges) / (2.0 * count))[piece]
    return edges[:-1][piece] + (2 * place + 1) * half, half


def _gaps(
    model: CollisionModel, Q: Array, rows: Index, pairs: Index, stop: Callable[[], bool]
) -> tuple[Array, tuple[int, Contact] | None]:
    """Return the distance of each (row, pair), rows ascending, or the deepest contact of the first row that has one."""
    gap = np.empty(len(rows))
    placed, worst = -1, None
    for k, (row, pair) in enumerate(zip(rows.tolist(), pairs.tolist(), strict=True)):
        if row != placed:
            if worst is not None:
                break
            if stop():
                worst = k
                break
            model.place(Q[row])
            placed = row
        gap[k] = model.pair_gap(pair) - _MARGIN
        if gap[k] <= 0.0 and (worst is None or gap[k] < gap[worst]):
            worst = k
    return gap, None if worst is None else (int(rows[worst]), model.distance(Q[rows[worst]], int(pairs[worst])))


def _cut(middle: Array, half: Array, rows: Index, pairs: Index, ratio: Array) -> tuple[Array, Array, Index, Index]:
    """Subdivide every remaining interval into equal parts, as many as its worst pair requires."""
    used, first, inverse = np.unique(rows, return_index=True, return_inverse=True)
    need = np.clip(np.ceil(np.maximum.reduceat(ratio, first) * 1.05), 2, _MOST_CUTS).astype(int)
    parent, place = parts_of(need)
    new_half = (half[used] / need)[parent]
    new_middle = (middle - half)[used][parent] + (2 * place + 1) * new_half
    pair, child = parts_of(need[inverse])  # every pair goes to all children of its interval
    new_rows = (np.cumsum(need) - need)[inverse][pair] + child
    new_pairs = pairs[pair]
    order = np.lexsort((new_pairs, new_rows))
    return new_middle, new_half, new_rows[order], new_pairs[order]
