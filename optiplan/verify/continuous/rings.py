"""Surfaces turned about an axis: which triangles of two bodies could meet, whatever the angle between them."""

import numpy as np

from optiplan.arrays import Array, Flags, Index
from optiplan.geometry.over_cover import halves
from optiplan.verify.tolerances import CLEARANCE_ROUNDING

_MOST_PAIRS = 1_000_000
"""Pairs of triangles looked at in one round; where there are more, those left open count as near."""

_ROUNDS = 24
"""Halvings of triangles, after which pairs left open count as near."""

_BLOCK = 2_000_000
"""Pairs of boxes compared at a time, to bound memory."""


def near_rings(one: Array, other: Array, gap: float) -> tuple[Flags, Flags]:
    """Flag the triangles of two surfaces whose rings come nearer than `gap` to one of the other surface.

    A point p turned about the z axis keeps its radius r and its height z. So two points are never nearer to each other
    than ((r_p - r_q)^2 + (z_p - z_q)^2)^(1/2), whatever the angles: a triangle of one surface and one of the other of
    which not both are flagged stay apart by `gap` at every angle.

    Images of triangles in the plane of r and z are held in boxes; where those of a pair are nearer than `gap`, the
    larger triangle is halved, until they are not, or one point of each is nearer than `gap`.

    Args:
        one: (a, 3, 3) triangles, m, in a frame whose z axis is the axis.
        other: (b, 3, 3) the same of the other surface.
        gap: m.

    Returns:
        (a,) and (b,).
    """
    near = np.zeros(len(one), dtype=bool), np.zeros(len(other), dtype=bool)
    triangles = [one, other]
    boxes = [_boxes(one), _boxes(other)]
    pairs = _pairs(boxes[0], boxes[1], gap)
    if pairs is None:
        return np.ones(len(one), dtype=bool), np.ones(len(other), dtype=bool)
    owners = [np.arange(len(one)), np.arange(len(other))]
    for _ in range(_ROUNDS):
        if len(pairs) > _MOST_PAIRS:
            break
        origin = np.column_stack([owners[side][pairs[:, side]] for side in (0, 1)])
        middles = [_image(triangles[side].mean(axis=1)) for side in (0, 1)]
        apart = middles[0][pairs[:, 0]] - middles[1][pairs[:, 1]]
        meet = np.einsum("ki,ki->k", apart, apart) < gap**2
        for side in (0, 1):
            near[side][origin[meet, side]] = True
        pairs = pairs[~(near[0][origin[:, 0]] & near[1][origin[:, 1]])]
        if not len(pairs):
            return near
        size = [np.linalg.norm(boxes[side][1] - boxes[side][0], axis=1)[pairs[:, side]] for side in (0, 1)]
        first: Flags = size[0] >= size[1]
        pairs = _halved(triangles, owners, pairs, first)
        boxes = [_boxes(triangles[side]) for side in (0, 1)]
        pairs = pairs[_gap(boxes[0], boxes[1], pairs) < gap]
    for side in (0, 1):
        near[side][owners[side][pairs[:, side]]] = True
    return near


def _halved(triangles: list[Array], owners: list[Index], pairs: Index, first: Flags) -> Index:
    """Halve the triangle of one side of each pair, and forget triangles of no pair; returns the pairs (K, 2) left."""
    left = []
    for side, chosen in ((0, first), (1, ~first)):
        own, back = np.unique(pairs[chosen, side], return_inverse=True)
        parts = halves(triangles[side][own])
        start = len(triangles[side])
        triangles[side] = np.concatenate([triangles[side], parts])
        owners[side] = np.concatenate([owners[side], np.repeat(owners[side][own], 2)])
        fresh = np.repeat(pairs[chosen], 2, axis=0)
        fresh[:, side] = start + (2 * back[:, None] + np.arange(2)).ravel()
        left.append(fresh)
    joined = np.concatenate(left)
    for side in (0, 1):
        used, joined[:, side] = np.unique(joined[:, side], return_inverse=True)
        triangles[side], owners[side] = triangles[side][used], owners[side][used]
    return joined


def _image(points: Array) -> Array:
    """Radius and height, m, of points (k, 3): (k, 2)."""
    return np.column_stack([np.hypot(points[:, 0], points[:, 1]), points[:, 2]])


def _boxes(triangles: Array) -> Array:
    """Least and largest radius and height of triangles (k, 3, 3): (2, k, 2), m.

    The radius is convex: it is largest at a corner; it is least at the point of the triangle, seen along the axis, that
    is nearest to the axis.
    """
    flat, height = triangles[:, :, :2], triangles[:, :, 2]
    edge = np.roll(flat, -1, axis=1) - flat
    length = np.einsum("kij,kij->ki", edge, edge)
    along = -np.einsum("kij,kij->ki", flat, edge) / np.where(length > 0.0, length, 1.0)
    nearest = flat + np.clip(along, 0.0, 1.0)[..., None] * edge
    least = np.linalg.norm(nearest, axis=2).min(axis=1)
    side = edge[..., 1] * flat[..., 0] - edge[..., 0] * flat[..., 1]
    least[(side > 0.0).all(axis=1) | (side < 0.0).all(axis=1)] = 0.0  # the axis goes through it
    low = np.column_stack([least, height.min(axis=1)]) - CLEARANCE_ROUNDING
    high = np.column_stack([np.linalg.norm(flat, axis=2).max(axis=1), height.max(axis=1)]) + CLEARANCE_ROUNDING
    return np.stack([low, high])


def _gap(one: Array, other: Array, pairs: Index) -> Array:
    """Distance, m, of the boxes (2, a, 2) and (2, b, 2) of each pair (K, 2): (K,)."""
    a, b = one[:, pairs[:, 0]], other[:, pairs[:, 1]]
    apart = np.maximum(np.maximum(a[0] - b[1], b[0] - a[1]), 0.0)
    return np.asarray(np.hypot(apart[:, 0], apart[:, 1]))


def _pairs(one: Array, other: Array, gap: float) -> Index | None:
    """Find all pairs (K, 2) of boxes (2, a, 2) and (2, b, 2) that are nearer than `gap`; None of too many."""
    order = np.argsort(one[0, :, 1], kind="stable")
    found, count = [np.empty((0, 2), dtype=np.intp)], 0
    step = max(1, min(64, _BLOCK // max(other.shape[1], 1)))
    for k in range(0, len(order), step):
        own = order[k : k + step]
        low, high = one[0, own].min(axis=0) - gap, one[1, own].max(axis=0) + gap
        there = np.flatnonzero(((other[0] <= high) & (other[1] >= low)).all(axis=1))
        a, b = one[:, own][:, :, None], other[:, there][:, None]
        apart = np.maximum(np.maximum(a[0] - b[1], b[0] - a[1]), 0.0)
        rows, columns = np.nonzero(np.einsum("abi,abi->ab", apart, apart) < gap**2)
        found.append(np.column_stack([own[rows], there[columns]]))
        count += len(rows)
        if count > _MOST_PAIRS:
            return None
    return np.concatenate(found)
